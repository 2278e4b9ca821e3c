//! Local and global steps with a sparse factor: solve, rotate, until nothing moves (thesis section 7.3.1).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use super::block_factor::NOWHERE;
use super::factor::Factor;
use super::given::Given;
use super::local_step::{Solved, hold_upright, largest_change};
use super::reduction::Reduction;
use super::report::ArapStop;
use super::state::{Maps, State, Turns};
use crate::lanes::{Kernel, LANES};
use crate::nearest_rotation::nearest_rotations_inlined;

pub(super) struct FactorSteps<'a> {
    pub(super) reduction: &'a Reduction,
    pub(super) given: &'a Given,
    pub(super) factor: &'a Factor,
    pub(super) state: &'a mut State,
    pub(super) stop: ArapStop,
}

impl Kernel for FactorSteps<'_> {
    type Output = Solved;

    #[inline(always)]
    fn run(self) -> Solved {
        let Self { reduction, given, factor, state, stop } = self;
        set_base(given, factor, state);
        let mut change = f32::INFINITY;
        let mut iterations = 0;
        while iterations < stop.iterations {
            iterations += 1;
            global_step(reduction, factor, state);
            change = local_step(reduction, state);
            if change <= stop.tolerance {
                break;
            }
        }
        global_step(reduction, factor, state);
        finish(reduction, state);
        Solved { iterations, change, energy: energy(reduction, given, state) }
    }
}

/// What does not change while rotations are sought: the right-hand side without rotations, and known rows of `T`.
#[inline(always)]
fn set_base(given: &Given, factor: &Factor, state: &mut State) {
    let Maps { stacked, fixed, transposed, right, pulled, force, .. } = &mut state.maps;
    for (row, to) in stacked.iter_mut().enumerate() {
        *to = [transposed[0][row], transposed[1][row], transposed[2][row], 0.0];
    }
    fixed.copy_from_slice(&factor.towards_rest);
    for &(place, row, value) in &factor.from_known {
        let from = stacked[row as usize];
        let to = &mut fixed[place as usize];
        (0..4).for_each(|axis| to[axis] += value * from[axis]);
    }
    for &(place, equation, value) in &factor.from_equations {
        let to = &mut fixed[place as usize];
        (0..3).for_each(|axis| to[axis] += value * right[axis][equation as usize]);
    }
    for &(place, spring, value) in &factor.from_springs {
        let to = &mut fixed[place as usize];
        (0..3).for_each(|axis| to[axis] += value * pulled[axis][spring as usize]);
    }
    if factor.is_moving {
        for &row in &given.open {
            let to = &mut fixed[factor.places[row / 4][row % 4] as usize];
            (0..3).for_each(|axis| to[axis] += force[axis][row]);
        }
    }
}

/// `T` for the present rotations.
#[inline(always)]
fn global_step(reduction: &Reduction, factor: &Factor, state: &mut State) {
    let Maps { stacked, fixed, unknowns, .. } = &mut state.maps;
    let rotations = &state.turns.rotations;
    unknowns.copy_from_slice(fixed);
    for cluster in 0..reduction.cluster_count {
        let of_cluster = &rotations[cluster / LANES];
        let lane = cluster % LANES;
        let rows: [[f64; 4]; 3] = std::array::from_fn(|rest| {
            let [x, y, z] = [0, 1, 2].map(|axis| f64::from(of_cluster[rest][axis][lane]));
            [x, y, z, 0.0]
        });
        for (handle, block) in reduction.covariance.row(cluster) {
            for (part, &place) in factor.places[*handle as usize].iter().enumerate() {
                if place == NOWHERE {
                    continue;
                }
                let to = &mut unknowns[place as usize];
                for rest in 0..3 {
                    for axis in 0..4 {
                        to[axis] += block[rest][part] * rows[rest][axis];
                    }
                }
            }
        }
    }
    factor.blocks.solve(unknowns);
    for (places, four) in factor.places.iter().zip(stacked.as_chunks_mut::<4>().0) {
        for (&place, to) in places.iter().zip(four).filter(|(place, _)| **place != NOWHERE) {
            *to = unknowns[place as usize];
        }
    }
    for part in &factor.floating {
        let mut off = part.at_rest.map(|at| -at);
        for &(row, share) in &part.centre {
            (0..3).for_each(|axis| off[axis] += share * stacked[row as usize][axis]);
        }
        for &handle in &part.handles {
            (0..3).for_each(|axis| stacked[4 * handle as usize + 3][axis] -= off[axis]);
        }
    }
}

/// Rotations nearest to what the present `T` does to the clusters; returns the largest change of an entry.
#[inline(always)]
fn local_step(reduction: &Reduction, state: &mut State) -> f32 {
    let stacked = &state.maps.stacked;
    let Turns { rotations, turned, covariances, .. } = &mut state.turns;
    for cluster in 0..reduction.cluster_count {
        let mut sums = [[0.0; 4]; 3];
        for (handle, block) in reduction.covariance.row(cluster) {
            let four = &stacked[4 * *handle as usize..][..4];
            for rest in 0..3 {
                for (part, from) in four.iter().enumerate() {
                    for axis in 0..4 {
                        sums[rest][axis] += block[rest][part] * from[axis];
                    }
                }
            }
        }
        for (rest, sums) in sums.iter().enumerate() {
            for axis in 0..3 {
                covariances[cluster / LANES][rest][axis][cluster % LANES] = sums[axis] as f32;
            }
        }
    }
    for lane in reduction.cluster_count..covariances.len() * LANES {
        // Lanes without a cluster ask for the identity, which takes no iterations.
        for rest in 0..3 {
            for axis in 0..3 {
                covariances[lane / LANES][rest][axis][lane % LANES] = if rest == axis { 1.0 } else { 0.0 };
            }
        }
    }
    for (covariances, out) in covariances.iter_mut().zip(&mut *turned) {
        if reduction.planar {
            hold_upright(covariances);
        }
        *out = nearest_rotations_inlined(covariances);
    }
    reduction.limits.iter().for_each(|pair| pair.hold(covariances, rotations, turned));
    let mut change = 0.0_f32;
    for (now, before) in turned.iter().zip(&*rotations) {
        change = change.max(largest_change(now, before));
    }
    std::mem::swap(rotations, turned);
    change
}

#[inline(always)]
fn finish(reduction: &Reduction, state: &mut State) {
    for (row, from) in state.maps.stacked.iter().enumerate() {
        (0..3).for_each(|axis| state.maps.transposed[axis][row] = from[axis]);
    }
    for cluster in 0..reduction.cluster_count {
        for rest in 0..3 {
            for axis in 0..3 {
                let value = state.turns.rotations[cluster / LANES][rest][axis][cluster % LANES];
                state.turns.wide[axis][3 * cluster + rest] = f64::from(value);
            }
        }
    }
}

/// `½ tr(Tᵀ L̃ T) − tr(R K̃ T)` plus the constant.
#[inline(always)]
fn energy(reduction: &Reduction, given: &Given, state: &State) -> f64 {
    let mut sum = reduction.constant;
    let product = |values: &[f64; 4], four: &[[f64; 4]]| {
        let mut sums = [0.0; 3];
        for (value, from) in values.iter().zip(four) {
            (0..3).for_each(|axis| sums[axis] += value * from[axis]);
        }
        sums
    };
    for row in 0..reduction.stiffness.len() {
        for (handle, block) in reduction.stiffness.row(row) {
            let four = &state.maps.stacked[4 * *handle as usize..][..4];
            for (part, values) in block.iter().enumerate() {
                let pulled = product(values, four);
                (0..3).for_each(|axis| sum += 0.5 * state.maps.stacked[4 * row + part][axis] * pulled[axis]);
            }
        }
    }
    for cluster in 0..reduction.covariance.len() {
        for (handle, block) in reduction.covariance.row(cluster) {
            let four = &state.maps.stacked[4 * *handle as usize..][..4];
            for (rest, values) in block.iter().enumerate() {
                let covariance = product(values, four);
                (0..3).for_each(|axis| sum -= state.turns.wide[axis][3 * cluster + rest] * covariance[axis]);
            }
        }
    }
    sum += given.energy_of_springs(&state.maps.transposed, &state.maps.pulled);
    sum * reduction.energy_unit
}
