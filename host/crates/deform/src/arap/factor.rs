//! The global step by a sparse factorisation: for hundreds of handles.
//!
//! Handles that share no vertices do not occur in each other's equations, so that the system of eq. 7.19 is nearly as
//! sparse as the tree of the bones. It is solved with its multipliers,
//!
//! `[H + ρ EᵀE, Eᵀ; E, −ε] [T; Λ] = [K̃ᵀRᵀ + ρ Eᵀp; p]`,
//!
//! where `ρ EᵀE` changes nothing about the solution, but lets translations that only equations determine be eliminated
//! first, and `ε` lets redundant and contradictory equations do no harm: those are met as well as they can be together.
//! A little of the distance from rest, `δ`, decides what nothing else does.

use super::block_factor::{BlockFactor, Group, NOWHERE};
use super::blocks::BlockRows;
use super::constraint::HandleConstraint;
use super::given::{Given, Resistance, Source};
use super::reduction::Reduction;

/// `δ` as a fraction of the largest stiffness: far below any stiffness, above rounding.
const TOWARDS_REST: f64 = 1e-11;
/// How much of that holds the numbers of a handle that moves no mass.
const OF_WEIGHTLESS: f64 = 1e-2;
/// `ε ρ`.
const SOFTNESS: f64 = 1e-9;
/// A pivot below this multiple of `δ` means that nothing else determines the motion.
const UNDETERMINED: f64 = 30.0;

/// Everything for one set of constraints.
#[derive(Clone, Debug, Default)]
pub(super) struct Factor {
    pub(super) blocks: BlockFactor,
    /// For each handle, the places of its rows of `T` among the unknowns.
    pub(super) places: Vec<[u32; 4]>,
    /// The place of each equation's multiplier, or [`NOWHERE`] where nothing in it is open.
    pub(super) multipliers: Vec<u32>,
    /// What known rows of `T` add to the right-hand side: place, row, factor.
    pub(super) from_known: Vec<(u32, u32, f64)>,
    /// What right-hand sides of equations add besides to that of the unknowns: place, equation, factor.
    pub(super) from_equations: Vec<(u32, u32, f64)>,
    /// What the targets of springs add: place, spring, factor.
    pub(super) from_springs: Vec<(u32, u32, f64)>,
    /// `δ` times the rest pose, by place.
    pub(super) towards_rest: Vec<[f64; 4]>,
    /// Parts of the shape whose place nothing determines.
    pub(super) floating: Vec<Floating>,
    /// Whether the shape moves on its own: then forces act on the rows of `T`.
    pub(super) is_moving: bool,
}

/// Handles that can be moved together without affecting anything: the mass they move keeps its place.
#[derive(Clone, Debug)]
pub(super) struct Floating {
    pub(super) handles: Vec<u32>,
    /// What each row of `T` adds to the place of the centre of mass.
    pub(super) centre: Vec<(u32, f64)>,
    /// Where that is at rest.
    pub(super) at_rest: [f64; 3],
}

impl Factor {
    /// Also counts the motions that nothing determines, in each coordinate.
    pub(super) fn new(reduction: &Reduction, given: &Given, resistance: Option<Resistance>) -> (Self, usize) {
        let handles = reduction.handle_count;
        let largest = reduction.stiffness.largest_diagonal().max(f64::MIN_POSITIVE);
        let delta = TOWARDS_REST * largest;
        let mut matrix = reduction.stiffness.clone();
        let mut rest = vec![[0.0; 4]; 4 * handles];
        let inertia = resistance.map_or(0.0, |Resistance(weight)| weight);
        let viscosity = if resistance.is_some() { reduction.viscosity() } else { 0.0 };
        let alone = |handle: usize| if reduction.weightless.contains(&handle) { OF_WEIGHTLESS } else { 0.0 };
        for handle in 0..handles {
            let of_each = alone(handle);
            for (other, block) in reduction.closeness.row(handle) {
                let own = handle == *other as usize;
                let to = matrix.at_mut(handle, *other);
                for part in 0..4 {
                    for column in 0..4 {
                        let on_diagonal = own && part == column;
                        let pull = delta * (block[part][column] + if on_diagonal { of_each } else { 0.0 });
                        let resisting = inertia * block[part][column] + if on_diagonal { viscosity } else { 0.0 };
                        to[part][column] += pull + resisting;
                        if column < 3 {
                            rest[4 * handle + part][column] += pull;
                        }
                    }
                }
            }
        }
        let mut factor = Self { is_moving: resistance.is_some(), ..Self::default() };
        for spring in &given.springs {
            for (a, of_a) in &spring.terms {
                for (b, of_b) in &spring.terms {
                    let to = matrix.at_mut(*a as usize, *b);
                    (0..4).for_each(|i| (0..4).for_each(|j| to[i][j] += spring.strength * of_a[i] * of_b[j]));
                }
            }
        }
        let mut groups: Vec<Group> = (0..handles).map(|h| group_of(given.constraints[h], reduction.planar)).collect();
        for (number, equation) in given.equations.iter().enumerate() {
            let multiplier = (handles + number) as u32;
            matrix.push_row(Vec::new());
            matrix.at_mut(handles + number, multiplier)[0][0] = -SOFTNESS / largest;
            for (a, of_a) in &equation.terms {
                for (b, of_b) in &equation.terms {
                    let to = matrix.at_mut(*a as usize, *b);
                    (0..4).for_each(|i| (0..4).for_each(|j| to[i][j] += largest * of_a[i] * of_b[j]));
                }
                matrix.at_mut(multiplier as usize, *a)[0] = *of_a;
                let column = matrix.at_mut(*a as usize, multiplier);
                (0..4).for_each(|part| column[part][0] = of_a[part]);
            }
            groups.push(Group { open: [true, false, false, false], is_multiplier: true });
        }
        if resistance.is_none() {
            factor.floating = floating(reduction, given, &matrix, largest);
        }
        factor.blocks = BlockFactor::new(&matrix, &groups);
        factor.places = (0..handles).map(|handle| factor.blocks.places(handle)).collect();
        factor.multipliers = (0..given.equations.len()).map(|e| factor.blocks.places(handles + e)[0]).collect();
        factor.gather_known(&matrix, &groups, handles);
        for (number, equation) in given.equations.iter().enumerate() {
            for (handle, values) in &equation.terms {
                for (place, value) in factor.places[*handle as usize].into_iter().zip(values) {
                    if place != NOWHERE && *value != 0.0 {
                        factor.from_equations.push((place, number as u32, largest * value));
                    }
                }
            }
            if factor.multipliers[number] != NOWHERE {
                factor.from_equations.push((factor.multipliers[number], number as u32, 1.0));
            }
        }
        for (number, spring) in given.springs.iter().enumerate() {
            for (handle, values) in &spring.terms {
                for (place, value) in factor.places[*handle as usize].into_iter().zip(values) {
                    if place != NOWHERE && *value != 0.0 {
                        factor.from_springs.push((place, number as u32, spring.strength * value));
                    }
                }
            }
        }
        factor.towards_rest = vec![[0.0; 4]; factor.blocks.size()];
        let mut undetermined = 0;
        for (row, pull) in rest.iter().enumerate() {
            let place = factor.places[row / 4][row % 4];
            if place != NOWHERE {
                factor.towards_rest[place as usize] = *pull;
                let resists = factor.blocks.pivot(place);
                let of_rest = delta * (reduction.closeness.diagonal(row) + alone(row / 4));
                undetermined += usize::from(!factor.is_moving && resists < UNDETERMINED * of_rest);
            }
        }
        (factor, undetermined)
    }

    /// The known rows of `T`, moved to the right-hand side.
    fn gather_known(&mut self, matrix: &BlockRows<4>, groups: &[Group], handles: usize) {
        for group in 0..groups.len() {
            for (other, block) in matrix.row(group).iter().filter(|(other, _)| (*other as usize) < handles) {
                for (part, place) in self.blocks.places(group).into_iter().enumerate().filter(|(_, p)| *p != NOWHERE) {
                    for (column, value) in block[part].iter().enumerate() {
                        if self.places[*other as usize][column] == NOWHERE && *value != 0.0 {
                            self.from_known.push((place, 4 * other + column as u32, -value));
                        }
                    }
                }
            }
        }
    }
}

/// A motion of the largest stiffness times this is none.
const FREE: f64 = 1e-9;

/// Parts that no given transformation and no equation but joints between them hold in place.
fn floating(reduction: &Reduction, given: &Given, matrix: &BlockRows<4>, largest: f64) -> Vec<Floating> {
    let handles = reduction.handle_count;
    let mut part_of = vec![u32::MAX; handles];
    let mut parts: Vec<(Vec<u32>, bool)> = Vec::new();
    for first in 0..handles {
        if part_of[first] != u32::MAX {
            continue;
        }
        let part = parts.len() as u32;
        part_of[first] = part;
        let mut found = vec![first as u32];
        let mut next = 0;
        while let Some(&handle) = found.get(next) {
            next += 1;
            for (other, _) in matrix.row(handle as usize).iter().filter(|(other, _)| (*other as usize) < handles) {
                if std::mem::replace(&mut part_of[*other as usize], part) == u32::MAX {
                    found.push(*other);
                }
            }
        }
        let is_held = found.iter().any(|handle| given.constraints[*handle as usize] == HandleConstraint::Full);
        parts.push((found, is_held));
    }
    for equation in given.equations.iter().filter(|equation| equation.source != Source::Joint) {
        equation.terms.iter().for_each(|(handle, _)| parts[part_of[*handle as usize] as usize].1 = true);
    }
    for spring in given.springs.iter().filter(|spring| spring.strength > 0.0) {
        spring.terms.iter().for_each(|(handle, _)| parts[part_of[*handle as usize] as usize].1 = true);
    }
    let free = parts.into_iter().filter(|(_, is_held)| !is_held).filter_map(|(mut handles, _)| {
        handles.sort_unstable();
        // Additional handles do not move everything by their translations; without them, nothing resists.
        let together = |matrix: &BlockRows<4>, row: u32| -> f64 {
            matrix.row(row as usize / 4).iter().map(|(_, block)| block[row as usize % 4][3]).sum()
        };
        let rows = || handles.iter().flat_map(|handle| 4 * handle..4 * handle + 4);
        let resisted = rows().map(|row| together(&reduction.stiffness, row).abs()).fold(0.0, f64::max);
        let centre: Vec<(u32, f64)> = rows().map(|row| (row, together(&reduction.closeness, row))).collect();
        let mass: f64 = centre.iter().filter(|(row, _)| row % 4 == 3).map(|(_, share)| share).sum();
        (resisted < FREE * largest && mass > 0.0).then(|| {
            let centre: Vec<(u32, f64)> = centre.iter().map(|(row, share)| (*row, share / mass)).collect();
            let at = |axis: u32| centre.iter().filter(|(row, _)| row % 4 == axis).map(|(_, share)| share).sum();
            Floating { at_rest: [at(0), at(1), at(2)], handles, centre }
        })
    });
    free.collect()
}

fn group_of(constraint: HandleConstraint, planar: bool) -> Group {
    let open = match constraint {
        HandleConstraint::Full => [false; 4],
        HandleConstraint::Orientation => [false, false, false, true],
        // A flat shape never moves along z.
        HandleConstraint::Position | HandleConstraint::Free => [true, true, !planar, true],
    };
    Group { open, is_multiplier: false }
}
