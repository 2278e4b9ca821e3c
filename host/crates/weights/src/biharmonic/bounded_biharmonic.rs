//! Bounded biharmonic weights (Jacobson et al. 2011; thesis 4.3): for every handle the smoothest weights between
//! zero and one that take given values at the handles,
//! `min ½ wᵀ (L M⁻¹ L + K) w` with `w_b = given` and `0 ≤ w ≤ 1`.
//!
//! Each handle is solved on its own (normalising afterwards gives the partition of unity). A few alternating direction
//! steps with one shared factorisation guess which weights are at a bound; an active set method then exchanges them
//! until the duality gap proves the weights good enough. Ten to twenty exchanges are usual; three or four of them
//! factorise the free weights' part of the Hessian, the others reuse an older factor with a few conjugate gradient
//! iterations. Where exchanges stop paying off, a growing number of alternating direction steps, which always converge,
//! gives a better guess.

use std::ops::{ControlFlow, Range};

use rayon::prelude::*;

use super::active_set::ActiveSet;
use super::check::{check, reached};
use super::energy::BiharmonicEnergy;
use super::error::BiharmonicError;
use super::exchange_bounds::{Goal, Solve};
use super::far_handles::{FEWEST, FarHandles};
use super::near_handles::NearHandles;
use super::problem::{BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings};
use crate::gather_reports::gather_reports;
use crate::progress::{Stopped, report};
use crate::weight_matrix::WeightMatrix;

/// The certificate of one handle's weights, before normalisation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandleReport {
    /// `½ wᵀ (L M⁻¹ L + K) w`.
    pub energy: f64,
    /// Duality gap: no feasible weights have less energy than `energy - gap`.
    pub gap: f64,
    /// No weight is farther than this from the optimal one: `√(2 · gap · max diag A⁻¹)`, as
    /// `½ ‖w - w*‖²_A ≤ gap`.
    pub error_bound: f64,
    /// Largest distance of a weight from 0..=1.
    pub largest_bound_violation: f64,
    /// Largest wrong-signed multiplier at a bound over the Hessian's diagonal: how far that weight alone would move if
    /// it were released.
    pub largest_wrong_multiplier: f64,
    /// Largest gradient at a weight between the bounds, in the same measure.
    pub stationarity: f64,
    /// Active sets tried.
    pub active_sets: usize,
    /// Factorisations made for them; the other sets reused an older one with conjugate gradients.
    pub factorisations: usize,
    /// Conjugate gradient iterations over all active sets.
    pub iterations: usize,
    /// How it ended.
    pub outcome: BiharmonicOutcome,
}

/// Weights with their certificates.
#[derive(Clone, Debug, PartialEq)]
pub struct BiharmonicWeights {
    /// n vertices × m handles, each within 0..=1, not normalised.
    pub weights: WeightMatrix,
    /// One for every handle.
    pub reports: Vec<HandleReport>,
    /// Pieces of the mesh without a fixed vertex, each as a list of its vertices; their weights are zero.
    pub unreached: Vec<Vec<usize>>,
    /// Number of entries in the shared Cholesky factor.
    pub factor_entries: usize,
}

/// Stages that report progress more than once.
const NEAR: &str = "solving for the handles, each among the vertices near it";
const FAR: &str = "refining the weights that reach far";

/// Computes every handle's weights and a bound on how far they are from the optimum.
///
/// Scaling or moving the mesh changes the weights by no more than rounding, and they are the same to the last bit
/// whatever the number of threads. `progress` receives the current stage and the fraction of the whole that is done,
/// 0 to 1 and never falling, about once per exchange of active sets; returning `Break` stops the computation.
pub fn bounded_biharmonic_weights(
    problem: &BiharmonicProblem<'_>,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<BiharmonicWeights, BiharmonicError> {
    report(progress, "preparing the weights", 0.0)?;
    check(problem, settings)?;
    let (takes_part, unreached) = reached(problem.laplacian, problem.fixed);
    report(progress, "factorising the energy", 0.02)?;
    let energy =
        BiharmonicEnergy::new(problem.laplacian, problem.mass, problem.shape_preservation, problem.fixed, &takes_part)?;
    let active_set = ActiveSet::new(&energy);
    let goal = Goal { settings, largest_inverse: active_set.largest_inverse() };
    report(progress, NEAR, 0.1)?;
    let near = NearHandles::new(problem, &energy, &active_set);
    let all: Vec<usize> = (0..problem.handles).collect();
    // Going through a small mesh twice would cost more than it saves.
    let all_far = energy.len() < FEWEST;
    let solve_near =
        |handle, go_on: &dyn Fn() -> bool| if all_far { Ok(None) } else { near.solve(handle, &goal, go_on) };
    let mut solves = exchange_all(all, solve_near, NEAR, 0.1..0.5, progress)?;
    let left: Vec<usize> = (0..problem.handles).filter(|&handle| solves[handle].is_none()).collect();
    if !left.is_empty() {
        report(progress, "guessing the weights that reach far", 0.5)?;
        let (far, items) = FarHandles::guess(problem, &energy, &active_set, &left, &goal)?;
        report(progress, FAR, 0.6)?;
        let solve_far = |item, go_on: &dyn Fn() -> bool| far.solve(item, &goal, go_on);
        let solved = exchange_all(items, solve_far, FAR, 0.6..0.95, progress)?;
        left.iter().zip(solved).for_each(|(&handle, solve)| solves[handle] = Some(solve));
    }
    report(progress, "checking the weights", 0.95)?;
    assemble(problem, &energy, solves.into_iter().flatten().collect(), unreached, &goal)
}

/// Solves for every item, in order; progress runs through `range` without reaching its end.
fn exchange_all<T: Send, R: Send>(
    items: Vec<T>,
    solve: impl Fn(T, &dyn Fn() -> bool) -> Result<R, BiharmonicError> + Sync,
    stage: &'static str,
    range: Range<f64>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Vec<R>, BiharmonicError> {
    let (mut done, share) = (range.start, 0.1 / items.len().max(1) as f64);
    let between = || {
        done += share * (range.end - done);
        progress(stage, done)
    };
    let solved = gather_reports(items, solve, between).ok_or(Stopped { stage })?;
    solved.into_iter().collect()
}

fn assemble(
    problem: &BiharmonicProblem<'_>,
    energy: &BiharmonicEnergy,
    solves: Vec<Solve>,
    unreached: Vec<Vec<usize>>,
    goal: &Goal<'_>,
) -> Result<BiharmonicWeights, BiharmonicError> {
    let one = |(handle, solve): (usize, Solve)| {
        let Solve { best, places, effort, converged } = solve;
        let certificate = best.certificate;
        let weights = problem.whole(energy, handle, places.as_deref(), &best.weights);
        let report = HandleReport {
            energy: problem.energy(&weights),
            gap: certificate.gap,
            error_bound: goal.error_bound(certificate.gap),
            largest_bound_violation: weights.iter().map(|(_, w)| (-w).max(w - 1.0).max(0.0)).fold(0.0, f64::max),
            largest_wrong_multiplier: certificate.wrong_multiplier,
            stationarity: certificate.stationarity,
            active_sets: effort.active_sets,
            factorisations: effort.factorisations,
            iterations: effort.iterations,
            outcome: if converged { BiharmonicOutcome::Converged } else { BiharmonicOutcome::LimitReached },
        };
        (weights, report)
    };
    let (columns, reports): (Vec<Vec<(usize, f64)>>, _) =
        solves.into_par_iter().enumerate().map(one).collect::<Vec<_>>().into_iter().unzip();
    let weights = WeightMatrix::from_sparse_columns(problem.mass.len(), columns).ok_or(problem.out_of_memory())?;
    Ok(BiharmonicWeights { weights, reports, unreached, factor_entries: energy.factor.stored() })
}
