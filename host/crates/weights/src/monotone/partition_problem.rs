//! The quadratic problem of monotone weights that sum to one, for given directed edges, and its certificate.

use std::ops::ControlFlow;

use armature_geometry::operators::SparseMatrix;

use super::error::MonotoneError;
use super::monotone_functions::MonotoneSettings;
use super::polyharmonic::polyharmonic;
use super::problem::MonotoneProblem;
use super::shared_levels::{NONE, QUANTUM, SharedLevels};
use crate::handles::HandleBoundary;
use crate::quadratic::{
    LinearConditions, QuadraticError, QuadraticProblem, QuadraticSettings, QuadraticSolution, constrained_minimum,
};
use crate::sparse::cholesky::{CholeskyError, SparseCholesky};
use crate::sparse::inverse_diagonal::inverse_diagonal;
use crate::sparse::symmetric::Symmetric;

/// How much weights rise along every directed edge: an eighth of a quantum, which the harmonic weights rise at least, and
/// hundreds of times the rounding of a sum.
const MARGIN: f64 = QUANTUM / 8.0;

/// What the solver is asked for, so that rounding cannot pass the margin.
const ASKED: f64 = 4.0 * MARGIN;

/// Weights are multiples of this, so that their sums are exact.
const GRAIN: f64 = f64::EPSILON;

/// What the solver is asked for, relative to the energy: its last steps are its fastest, and the error bound needs them.
const GAP: f64 = 1e-10;

/// What is being done.
pub(super) const SOLVING: &str = "solving for all handles together";

/// All handles' weights for one set of directed edges.
pub(super) struct PartitionProblem<'a> {
    held: &'a HandleBoundary,
    order: usize,
    levels: SharedLevels,
    /// The energy on classes, and the factor of its part on those that are not fixed, with their places in it.
    energy: Symmetric,
    factor: SparseCholesky,
    place: Vec<u32>,
    largest_inverse: f64,
    /// Unknown of each class and handle, or [`NONE`].
    unknown: Vec<u32>,
    unknowns: usize,
    /// Handle and its directed edge.
    rising: Vec<(usize, [u32; 2])>,
}

/// Weights that sum to one and rise by the margin.
pub(super) struct Found {
    /// n for each handle.
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) energy: f64,
    pub(super) gap: f64,
    pub(super) smallest_rise: f64,
    pub(super) margin: f64,
    pub(super) repair: f64,
    pub(super) steps: usize,
}

impl<'a> PartitionProblem<'a> {
    pub(super) fn new(
        problem: &MonotoneProblem<'_>,
        held: &'a HandleBoundary,
        levels: SharedLevels,
    ) -> Result<Self, MonotoneError> {
        let order = problem.order;
        let failed = |reason: CholeskyError| MonotoneError::Factorisation { order, reason };
        let energy = on_classes(&polyharmonic(problem.laplacian, problem.mass, order, problem.blend), &levels);
        let free: Vec<u32> = (0..levels.classes() as u32).filter(|&c| levels.fixed_row[c as usize] == NONE).collect();
        let (natural, _) = energy.at(&free);
        let elimination = natural.elimination_order().map_err(failed)?;
        let mut place = vec![NONE; levels.classes()];
        elimination.iter().enumerate().for_each(|(k, &at)| place[free[at] as usize] = k as u32);
        let factor = natural.permuted(&elimination).factorise_shifted(&[]).map_err(failed)?;
        let largest_inverse = inverse_diagonal(&factor).into_iter().fold(0.0, f64::max);
        let mut unknown = vec![NONE; levels.pinned_row.len()];
        let mut unknowns = 0;
        for (unknown, &pinned) in unknown.iter_mut().zip(&levels.pinned_row) {
            if pinned == NONE {
                (*unknown, unknowns) = (unknowns, unknowns + 1);
            }
        }
        let rising =
            (0..levels.handles).flat_map(|j| levels.rising(j).into_iter().map(move |edge| (j, edge))).collect();
        let unknowns = unknowns as usize;
        Ok(Self { held, order, levels, energy, factor, place, largest_inverse, unknown, unknowns, rising })
    }

    /// Directed edges.
    pub(super) fn edges(&self) -> usize {
        self.rising.len()
    }

    /// Whether a vertex is in a piece with a fixed one.
    pub(super) fn reached(&self) -> Vec<bool> {
        self.levels.class_of.iter().map(|&class| class != NONE).collect()
    }

    /// The gap that is small enough.
    pub(super) fn allowed(&self, energy: f64, settings: &MonotoneSettings) -> f64 {
        let MonotoneSettings { error_bound, relative_gap, .. } = settings;
        (0.5 * error_bound * error_bound / self.largest_inverse).min(relative_gap * energy.abs())
    }

    /// No weight is farther than this from the best.
    pub(super) fn error_bound(&self, gap: f64) -> f64 {
        (2.0 * gap * self.largest_inverse).sqrt()
    }

    pub(super) fn solve(
        &self,
        settings: &MonotoneSettings,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Found, MonotoneError> {
        let how = QuadraticSettings {
            feasibility: 0.25 * MARGIN,
            relative_gap: GAP,
            most_steps: settings.most_steps.min(QuadraticSettings::default().most_steps),
            ..QuadraticSettings::default()
        };
        let solved = constrained_minimum(&self.quadratic(), &how, &mut |_, done| progress(done));
        let solved = solved.map_err(|error| match error {
            QuadraticError::Cancelled { .. } => MonotoneError::Cancelled { stage: SOLVING },
            QuadraticError::Factorisation(reason) => MonotoneError::Factorisation { order: self.order, reason },
            other => MonotoneError::Quadratic(other),
        })?;
        let on_levels: Vec<f64> = self.levels.levels.iter().map(|&level| level as f64 * QUANTUM).collect();
        let at = |class_and_handle: usize| match self.unknown[class_and_handle] {
            NONE => 0.0,
            unknown => solved.values[unknown as usize],
        };
        let computed: Vec<f64> = (0..self.unknown.len()).map(at).collect();
        let mut weights = self.exact(&computed);
        let before = self.energy_of(&weights);
        let (mut rise, mut share) = (self.smallest_rise(&weights), f64::EPSILON);
        // The harmonic weights rise by a quantum: as much of them as it takes.
        while rise < MARGIN && share <= 1.0 {
            let mixed = computed.iter().zip(&on_levels).map(|(a, b)| a + share * (b - a));
            weights = self.exact(&mixed.collect::<Vec<_>>());
            rise = self.smallest_rise(&weights);
            share *= 2.0;
        }
        let energy = self.energy_of(&weights);
        let of_handle = |handle: usize| {
            let weight = |&class: &u32| if class == NONE { 0.0 } else { weights[self.at(class, handle)] };
            self.levels.class_of.iter().map(weight).collect()
        };
        Ok(Found {
            gap: self.gap(&weights, &solved),
            columns: (0..self.levels.handles).map(of_handle).collect(),
            energy,
            smallest_rise: rise,
            margin: MARGIN,
            repair: energy - before,
            steps: solved.steps,
        })
    }

    fn at(&self, class: u32, handle: usize) -> usize {
        class as usize * self.levels.handles + handle
    }

    /// The given weight of a class on a plateau.
    fn given(&self, at: usize) -> f64 {
        let row = self.levels.pinned_row[at] as usize;
        self.held.fixed_weights[at % self.levels.handles * self.held.fixed.len() + row]
    }

    /// The least energy of the unknowns, sums of one, and rises.
    fn quadratic(&self) -> QuadraticProblem {
        let (m, classes, unknowns) = (self.levels.handles, self.levels.classes(), self.unknowns);
        let (mut entries, mut linear) = (Vec::new(), vec![0.0; unknowns]);
        let given = |at: usize| if self.unknown[at] == NONE { self.given(at) } else { 0.0 };
        let constant = self.energy_of(&(0..self.unknown.len()).map(given).collect::<Vec<_>>());
        let (mut sums, mut ones) = (Vec::new(), Vec::new());
        for class in 0..classes {
            let row = ones.len() as u32;
            let mut rest = 1.0;
            let mut any = false;
            for handle in 0..m {
                let column = self.unknown[class * m + handle];
                if column == NONE {
                    rest -= self.given(class * m + handle);
                    continue;
                }
                any = true;
                sums.push((row, column, 1.0));
                for (other, value) in self.energy.column(class) {
                    match self.unknown[other * m + handle] {
                        NONE => linear[column as usize] += value * self.given(other * m + handle),
                        unknown => entries.push((unknown, column, value)),
                    }
                }
            }
            if any {
                ones.push(rest);
            }
        }
        let (mut rises, mut bounds) = (Vec::new(), Vec::new());
        for &(handle, edge) in &self.rising {
            let mut bound = -ASKED;
            let row = bounds.len() as u32;
            for (class, sign) in edge.into_iter().zip([1.0, -1.0]) {
                let at = self.at(class, handle);
                match self.unknown[at] {
                    NONE => bound -= sign * self.given(at),
                    unknown => rises.push((row, unknown, sign)),
                }
            }
            bounds.push(bound);
        }
        let matrix = |rows: usize, entries: &[(u32, u32, f64)]| {
            SparseMatrix::from_triplets(rows, unknowns, entries).unwrap_or_default()
        };
        QuadraticProblem {
            quadratic: matrix(unknowns, &entries),
            linear,
            constant,
            equalities: LinearConditions { matrix: matrix(ones.len(), &sums), bounds: ones },
            inequalities: LinearConditions { matrix: matrix(bounds.len(), &rises), bounds },
        }
    }

    /// Weights of all classes that sum to one exactly: what is missing is shared by the unknowns, they are rounded to
    /// grains, and the largest takes what that leaves.
    fn exact(&self, computed: &[f64]) -> Vec<f64> {
        let m = self.levels.handles;
        let mut weights = vec![0.0; computed.len()];
        for (class, weights) in weights.chunks_mut(m.max(1)).enumerate() {
            let first = class * m;
            let free: Vec<usize> = (0..m).filter(|handle| self.unknown[first + handle] != NONE).collect();
            for (handle, weight) in weights.iter_mut().enumerate() {
                let at = first + handle;
                *weight = if self.unknown[at] == NONE { self.given(at) } else { computed[at] };
            }
            let Some(&largest) = free.iter().max_by(|a, b| computed[first + **a].total_cmp(&computed[first + **b]))
            else {
                continue;
            };
            let missing = (1.0 - weights.iter().sum::<f64>()) / free.len() as f64;
            for &handle in &free {
                weights[handle] = ((weights[handle] + missing) / GRAIN).round() * GRAIN;
            }
            weights[largest] = 0.0;
            weights[largest] = 1.0 - weights.iter().sum::<f64>();
        }
        weights
    }

    fn smallest_rise(&self, weights: &[f64]) -> f64 {
        let rise =
            |&(handle, [low, high]): &(usize, [u32; 2])| weights[self.at(high, handle)] - weights[self.at(low, handle)];
        self.rising.iter().map(rise).fold(f64::INFINITY, f64::min)
    }

    /// The energy's product with one handle's weights.
    fn product(&self, weights: &[f64], handle: usize) -> (Vec<f64>, Vec<f64>) {
        let own: Vec<f64> = weights.iter().skip(handle).step_by(self.levels.handles).copied().collect();
        let mut product = vec![0.0; own.len()];
        self.energy.multiply_into(&own, &mut product);
        (own, product)
    }

    fn energy_of(&self, weights: &[f64]) -> f64 {
        let of_handle = |handle: usize| {
            let (own, product) = self.product(weights, handle);
            0.5 * own.iter().zip(product).map(|(a, b)| a * b).sum::<f64>()
        };
        (0..self.levels.handles).map(of_handle).sum()
    }

    /// How much less energy there can be at most: for multipliers `λ ≥ 0` of the rises and any `y` of the sums,
    /// `Σ ½ rᵀ A⁻¹ r + λᵀ (rise - margin)` with `r = A w - y - Dᵀ λ`.
    fn gap(&self, weights: &[f64], solved: &QuadraticSolution) -> f64 {
        let (m, classes) = (self.levels.handles, self.levels.classes());
        let mut residual = vec![0.0; weights.len()];
        for handle in 0..m {
            let (_, product) = self.product(weights, handle);
            product.into_iter().enumerate().for_each(|(class, value)| residual[class * m + handle] = value);
        }
        let mut slack = 0.0;
        for (&(handle, [low, high]), &multiplier) in self.rising.iter().zip(&solved.inequality_multipliers) {
            let (low, high) = (self.at(low, handle), self.at(high, handle));
            residual[low] += multiplier;
            residual[high] -= multiplier;
            if self.unknown[low] != NONE || self.unknown[high] != NONE {
                slack += multiplier * (weights[high] - weights[low] - MARGIN).max(0.0);
            }
        }
        // The best y is the mean over the handles that are free there.
        for (class, residual) in residual.chunks_mut(m.max(1)).enumerate() {
            let is_free = |handle: usize| self.unknown[class * m + handle] != NONE;
            let count = (0..m).filter(|&handle| is_free(handle)).count().max(1) as f64;
            let mean = (0..m).filter(|&handle| is_free(handle)).map(|handle| residual[handle]).sum::<f64>() / count;
            let less = |(handle, r): (usize, &mut f64)| *r = if is_free(handle) { *r - mean } else { 0.0 };
            residual.iter_mut().enumerate().for_each(less);
        }
        let mut gap = slack;
        for handle in 0..m {
            let mut own = vec![0.0; self.factor.rows()];
            for class in (0..classes).filter(|&class| self.place[class] != NONE) {
                own[self.place[class] as usize] = residual[class * m + handle];
            }
            gap += 0.5 * self.factor.inverse_norm_squared(&mut own);
        }
        gap
    }
}

/// The matrix of an energy of functions that are constant on each class.
fn on_classes(whole: &Symmetric, levels: &SharedLevels) -> Symmetric {
    let mut entries = Vec::new();
    for (column, &to) in levels.class_of.iter().enumerate().filter(|(_, class)| **class != NONE) {
        let own = whole.column(column).map(|(row, value)| (levels.class_of[row], to, value));
        entries.extend(own.filter(|entry| entry.0 != NONE));
    }
    let classes = levels.classes();
    Symmetric::of(&SparseMatrix::from_triplets(classes, classes, &entries).unwrap_or_default())
}
