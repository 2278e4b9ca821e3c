//! Bounded biharmonic weights that sum to one by construction (the BBW paper's eqs. 2 to 4 with the partition of unity
//! kept as a constraint). The handles are coupled:
//! `min Σ_j ½ w_jᵀ (L M⁻¹ L + K) w_j` with `w_j` given at the handles, `0 ≤ w_j` and `Σ_j w_j = 1`.
//!
//! Alternating directions (Boyd et al. 2011): one shared factorisation moves every handle's weights, then every
//! vertex's weights are projected onto the simplex. The multipliers of the projection are a feasible dual point, so a
//! duality gap bounds the error at any time.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::alternating_directions::AlternatingDirections;
use super::check::{check, reached};
use super::energy::BiharmonicEnergy;
use super::error::BiharmonicError;
use super::far_handles::{BLOCK, RightHandSide, rayleigh_quotient, unbounded};
use super::problem::{BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings};
use crate::progress::report;
use crate::sparse::inverse_diagonal::inverse_diagonal;
use crate::weight_matrix::WeightMatrix;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactPartitionSettings {
    /// Done once no weight can be farther than this from the optimal one.
    pub error_bound: f64,
    /// Maximum number of alternating direction steps.
    pub max_steps: usize,
}

impl Default for ExactPartitionSettings {
    /// Within 2e-3 of the optimal weights, like the interactive tier of normalised weights.
    fn default() -> Self {
        Self { error_bound: 2e-3, max_steps: 4000 }
    }
}

/// The certificate of weights that sum to one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactPartitionReport {
    /// `Σ_j ½ w_jᵀ (L M⁻¹ L + K) w_j`.
    pub energy: f64,
    /// Duality gap: no weights that satisfy the constraints have less energy than `energy - gap`.
    pub gap: f64,
    /// No weight is farther than this from the optimal one: `√(2 · gap · max diag A⁻¹)`.
    pub error_bound: f64,
    /// Largest distance of a vertex's sum from one.
    pub largest_sum_error: f64,
    /// Steps taken.
    pub steps: usize,
    /// How it ended.
    pub outcome: BiharmonicOutcome,
}

/// Weights that sum to one, with their certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct ExactPartition {
    /// n vertices × m handles, not negative.
    pub weights: WeightMatrix,
    /// How good they are.
    pub report: ExactPartitionReport,
    /// Pieces of the mesh without a fixed vertex, each as a list of its vertices; their weights are zero.
    pub unreached: Vec<Vec<usize>>,
}

/// Over-relaxation, as when handles are solved separately.
const RELAXATION: f64 = 1.7;

/// The stiffness ρ in units of the mean Rayleigh quotient of the unbounded weights. Tuned on hand.mesh.
const STIFFNESS: f64 = 30.0;

/// Steps between two certificates.
const BETWEEN_CERTIFICATES: usize = 20;

/// How far from one the given weights of a vertex may sum.
const SUM_TOLERANCE: f64 = 1e-9;

/// Computes all handles' weights together and a bound on how far they are from the optimum.
///
/// `progress` receives the current stage and the fraction of the whole that is done, 0 to 1 and never falling, about
/// every twenty steps; returning `Break` stops the computation.
pub fn exact_partition_weights(
    problem: &BiharmonicProblem<'_>,
    settings: &ExactPartitionSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<ExactPartition, BiharmonicError> {
    report(progress, "preparing the weights", 0.0)?;
    check(problem, &BiharmonicSettings { error_bound: settings.error_bound, ..BiharmonicSettings::interactive() })?;
    check_sums(problem)?;
    let (takes_part, unreached) = reached(problem.laplacian, problem.fixed);
    report(progress, "factorising the energy", 0.02)?;
    let energy =
        BiharmonicEnergy::new(problem.laplacian, problem.mass, problem.shape_preservation, problem.fixed, &takes_part)?;
    let largest_inverse = inverse_diagonal(&energy.factor).into_iter().fold(0.0, f64::max);
    let right: Vec<RightHandSide> =
        (0..problem.handles).into_par_iter().map(|handle| RightHandSide::new(problem, &energy, handle)).collect();
    let unbounded = unbounded(&energy, &right)?;
    let stiffness = STIFFNESS * rayleigh_quotient(problem, &energy, unbounded.iter().enumerate());
    let directions = AlternatingDirections::new(&energy.hessian, &energy.mass, stiffness)?;
    let right: Vec<f64> = right.into_iter().flat_map(|right| right.values).collect();
    let mut steps = Steps::new(&energy, &directions, right, unbounded.concat());
    let mut best: Option<(f64, Vec<f64>)> = None;
    let bound = |gap: f64| (2.0 * gap * largest_inverse).sqrt();
    while steps.taken < settings.max_steps {
        let done = 0.1 + 0.85 * steps.taken as f64 / settings.max_steps as f64;
        report(progress, "solving for all handles together", done)?;
        for _ in 0..BETWEEN_CERTIFICATES.min(settings.max_steps - steps.taken) {
            steps.take()?;
        }
        let gap = steps.gap();
        if !gap.is_finite() {
            return Err(BiharmonicError::NotFinite { handle: 0 });
        }
        if best.as_ref().is_none_or(|(least, _)| gap < *least) {
            best = Some((gap, steps.weights.clone()));
        }
        if bound(gap) <= settings.error_bound {
            break;
        }
    }
    report(progress, "checking the weights", 0.95)?;
    let (gap, weights) = best.unwrap_or((f64::INFINITY, steps.weights));
    let (weights, energy, largest_sum_error) = assemble(problem, &energy, &weights)?;
    let outcome =
        if bound(gap) <= settings.error_bound { BiharmonicOutcome::Converged } else { BiharmonicOutcome::LimitReached };
    let report =
        ExactPartitionReport { energy, gap, error_bound: bound(gap), largest_sum_error, steps: steps.taken, outcome };
    Ok(ExactPartition { weights, report, unreached })
}

/// Weights can sum to one everywhere only if the given ones do.
fn check_sums(problem: &BiharmonicProblem<'_>) -> Result<(), BiharmonicError> {
    let count = problem.fixed.len();
    for (row, &vertex) in problem.fixed.iter().enumerate() {
        let sum: f64 = problem.fixed_weights.iter().skip(row).step_by(count).sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            return Err(BiharmonicError::NoPartition { vertex, sum });
        }
    }
    Ok(())
}

/// The iteration's state: one column of unknowns per handle, one after another.
struct Steps<'a> {
    energy: &'a BiharmonicEnergy,
    directions: &'a AlternatingDirections<'a>,
    right: Vec<f64>,
    /// On the simplex.
    weights: Vec<f64>,
    /// Scaled multipliers: `-ρ M u` are those of the constraints.
    multipliers: Vec<f64>,
    taken: usize,
}

impl<'a> Steps<'a> {
    fn new(
        energy: &'a BiharmonicEnergy,
        directions: &'a AlternatingDirections<'a>,
        right: Vec<f64>,
        start: Vec<f64>,
    ) -> Self {
        let multipliers = vec![0.0; start.len()];
        let mut steps = Self { energy, directions, right, weights: start, multipliers, taken: 0 };
        let all = steps.weights.clone();
        steps.project(&all);
        steps.multipliers.fill(0.0);
        steps
    }

    fn take(&mut self) -> Result<(), BiharmonicError> {
        self.taken += 1;
        let n = self.energy.len();
        if n == 0 {
            return Ok(());
        }
        let penalty = self.directions.penalty();
        let mut relaxed = self.right.clone();
        relaxed
            .par_chunks_mut(n * BLOCK)
            .zip(self.weights.par_chunks(n * BLOCK))
            .zip(self.multipliers.par_chunks(n * BLOCK))
            .try_for_each(|((relaxed, weights), multipliers)| {
                for (k, value) in relaxed.iter_mut().enumerate() {
                    *value += penalty[k % n] * (weights[k] - multipliers[k]);
                }
                self.directions.solve(relaxed)?;
                for (k, value) in relaxed.iter_mut().enumerate() {
                    *value = RELAXATION * *value + (1.0 - RELAXATION) * weights[k] + multipliers[k];
                }
                Ok::<(), BiharmonicError>(())
            })?;
        self.project(&relaxed);
        Ok(())
    }

    /// Splits values into weights (each vertex's on the simplex) and multipliers (the rest).
    fn project(&mut self, values: &[f64]) {
        let n = self.energy.len();
        let handles = values.len().checked_div(n).unwrap_or(0);
        let columns: Vec<&[f64]> = values.chunks(n.max(1)).collect();
        let shifts: Vec<f64> = (0..n)
            .into_par_iter()
            .with_min_len(256)
            .map_init(
                || vec![0.0; handles],
                |row, k| {
                    row.iter_mut().zip(&columns).for_each(|(value, column)| *value = column[k]);
                    simplex_shift(row)
                },
            )
            .collect();
        for (k, &value) in values.iter().enumerate() {
            let weight = (value - shifts[k % n]).max(0.0);
            self.weights[k] = weight;
            self.multipliers[k] = value - weight;
        }
    }

    /// Energy of the weights minus that of the multipliers' dual point: with `r_j = A w_j - b_j + ρ M u_j` this is
    /// `Σ ½ r_jᵀ A⁻¹ r_j`, because the projection leaves weights and multipliers complementary.
    fn gap(&self) -> f64 {
        let n = self.energy.len().max(1);
        let penalty = self.directions.penalty();
        let one = |((weights, multipliers), right): ((&[f64], &[f64]), &[f64])| {
            let mut residual = vec![0.0; weights.len()];
            self.energy.hessian.multiply_into(weights, &mut residual);
            for (k, r) in residual.iter_mut().enumerate() {
                *r += penalty[k] * multipliers[k] - right[k];
            }
            0.5 * self.energy.factor.inverse_norm_squared(&mut residual)
        };
        let columns = self.weights.par_chunks(n).zip(self.multipliers.par_chunks(n)).zip(self.right.par_chunks(n));
        let gaps: Vec<f64> = columns.map(one).collect();
        gaps.iter().sum()
    }
}

/// What must be subtracted from all values so that the positive rest sums to one (Michelot 1986).
fn simplex_shift(values: &[f64]) -> f64 {
    let mut shift = f64::NEG_INFINITY;
    loop {
        let above = || values.iter().filter(|value| **value > shift);
        let next = (above().sum::<f64>() - 1.0) / above().count().max(1) as f64;
        if next.is_nan() || next <= shift {
            return shift;
        }
        shift = next;
    }
}

/// Weights of all vertices, their energy, and how far their sums are from one.
fn assemble(
    problem: &BiharmonicProblem<'_>,
    energy: &BiharmonicEnergy,
    columns: &[f64],
) -> Result<(WeightMatrix, f64, f64), BiharmonicError> {
    let n = energy.len();
    let mut total = 0.0;
    let mut sums = vec![0.0; problem.mass.len()];
    let whole = (0..problem.handles).map(|handle| {
        let weights = problem.whole(energy, handle, None, &columns[handle * n..(handle + 1) * n]);
        total += problem.energy(&weights);
        weights.iter().for_each(|&(vertex, weight)| sums[vertex] += weight);
        weights
    });
    let weights = WeightMatrix::from_sparse_columns(problem.mass.len(), whole).ok_or(problem.out_of_memory())?;
    let worst = energy.unknowns.iter().map(|&vertex| (sums[vertex as usize] - 1.0_f64).abs()).fold(0.0, f64::max);
    Ok((weights, total, worst))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_positive_rest_sums_to_one() {
        for values in [&[0.3, 0.2, 0.9][..], &[-1.0, 5.0], &[0.25; 4], &[1.0, 1e-9, -3.0, 0.5], &[7.0]] {
            let shift = simplex_shift(values);
            let sum: f64 = values.iter().map(|value| (value - shift).max(0.0)).sum();
            assert!((sum - 1.0).abs() < 1e-12, "{values:?}: {sum}");
        }
    }
}
