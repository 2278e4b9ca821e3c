//! Bounded biharmonic weights (Jacobson et al. 2011; thesis 4.3): for every handle the smoothest weights between
//! zero and one that take given values at the handles,
//! `min ½ wᵀ (L M⁻¹ L + K) w` with `w_b = given` and `0 ≤ w ≤ 1`.
//!
//! Handles are solved apart from each other (the partition of unity comes afterwards, by normalising). A few steps
//! of alternating directions with one shared factorisation guess which weights lie at a bound; an active set method
//! then exchanges them until the duality gap proves the weights right. Mostly ten to twenty exchanges do; three or
//! four of them factorise the free weights' part of the Hessian, the others make do with an older factor and a few
//! conjugate gradients. Where exchanges stop to pay, more and more steps of alternating directions, which always
//! converge, give a better guess.

use std::ops::{ControlFlow, Range};

use armature_geometry::SparseMatrix;
use rayon::prelude::*;

use crate::active_set::{ActiveSet, Candidate};
use crate::biharmonic_check::{BiharmonicError, check, reached};
use crate::biharmonic_energy::BiharmonicEnergy;
use crate::exchange_bounds::{Effort, Goal};
use crate::far_handles::FarHandles;
use crate::gather_reports::gather_reports;
use crate::near_handles::NearHandles;
use crate::{Phase, Progress, WeightMatrix};

/// What is to be solved; triangles and tetrahedra alike.
#[derive(Clone, Copy, Debug)]
pub struct BiharmonicProblem<'a> {
    /// n×n cotangent Laplacian, symmetric; its sign does not matter.
    pub laplacian: &'a SparseMatrix,
    /// n lumped masses, positive wherever the Laplacian has an entry.
    pub mass: &'a [f64],
    /// Vertices whose weights are given, each once.
    pub fixed: &'a [usize],
    /// Their weights: `fixed.len()` × m handles, column-major, each within 0..=1.
    pub fixed_weights: &'a [f64],
    /// Number of handles m.
    pub handles: usize,
    /// The shape-preservation brush's term `K` (thesis eq. 4.9): n×n, symmetric positive semidefinite.
    pub shape_preservation: Option<&'a SparseMatrix>,
}

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiharmonicSettings {
    /// A handle is done when no weight can be farther than this from the optimal one ...
    pub error_bound: f64,
    /// ... and no weights have an energy lower by more than this fraction.
    pub relative_gap: f64,
    /// Steps of alternating directions for the first guess.
    pub guess_steps: usize,
    /// Active sets tried before a handle is given up.
    pub max_active_sets: usize,
}

impl BiharmonicSettings {
    /// Optimal to 2e-5 in every weight and to ten digits in the energy.
    pub fn certified() -> Self {
        Self { error_bound: 2e-5, relative_gap: 1e-10, guess_steps: 40, max_active_sets: 200 }
    }

    /// Every weight within 2e-3 of the optimal one: not to be seen in any deformation.
    pub fn interactive() -> Self {
        Self { error_bound: 2e-3, relative_gap: 1.0, guess_steps: 40, max_active_sets: 200 }
    }
}

impl Default for BiharmonicSettings {
    fn default() -> Self {
        Self::interactive()
    }
}

/// How the computation of one handle's weights ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BiharmonicOutcome {
    /// Both bounds of the settings hold.
    Converged,
    /// The best weights found within the limit; the report says how good they are.
    LimitReached,
}

/// The certificate of one handle's weights. It speaks of the weights before normalisation.
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
    /// Largest multiplier of the wrong sign at a bound, over the Hessian's diagonal: how far that weight alone would
    /// move if it were let go.
    pub largest_wrong_multiplier: f64,
    /// Largest gradient at a weight between the bounds, in the same measure.
    pub stationarity: f64,
    /// Active sets tried.
    pub active_sets: usize,
    /// Factorisations made for them; others made do with an older one and conjugate gradients.
    pub factorisations: usize,
    /// Iterations of conjugate gradients over all active sets.
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
    /// Pieces of the mesh without a fixed vertex, each as its vertices; their weights are zero.
    pub unreached: Vec<Vec<usize>>,
    /// Entries of the shared Cholesky factor.
    pub factor_entries: usize,
}

/// Computes every handle's weights and proves how good they are.
///
/// Scaling or moving the mesh changes nothing beside rounding; neither does the number of threads change a bit.
/// `progress` is called about once for each exchange of active sets; returning `Break` stops the computation.
pub fn bounded_biharmonic_weights(
    problem: &BiharmonicProblem<'_>,
    settings: &BiharmonicSettings,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<BiharmonicWeights, BiharmonicError> {
    let mut report_at = |phase, done| match progress(Progress { phase, done }) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(BiharmonicError::Cancelled(phase)),
    };
    report_at(Phase::Prepare, 0.0)?;
    check(problem, settings)?;
    let (takes_part, unreached) = reached(problem.laplacian, problem.fixed);
    report_at(Phase::Factorise, 0.02)?;
    let energy =
        BiharmonicEnergy::new(problem.laplacian, problem.mass, problem.shape_preservation, problem.fixed, &takes_part)?;
    let active_set = ActiveSet::new(&energy);
    let goal = Goal { settings, largest_inverse: active_set.largest_inverse() };
    report_at(Phase::Exchange, 0.1)?;
    let near = NearHandles::new(problem, &energy, &active_set);
    let all: Vec<usize> = (0..problem.handles).collect();
    let mut solves = exchange_all(all, |handle, go_on| near.solve(handle, &goal, go_on), 0.1..0.5, &mut report_at)?;
    let left: Vec<usize> = (0..problem.handles).filter(|&handle| solves[handle].is_none()).collect();
    if !left.is_empty() {
        report_at(Phase::Guess, 0.5)?;
        let (far, items) = FarHandles::guess(problem, &energy, &active_set, &left, settings.guess_steps)?;
        report_at(Phase::Exchange, 0.6)?;
        let solved = exchange_all(items, |item, go_on| far.solve(item, &goal, go_on), 0.6..0.95, &mut report_at)?;
        left.iter().zip(solved).for_each(|(&handle, solve)| solves[handle] = Some(solve));
    }
    report_at(Phase::Finish, 0.95)?;
    assemble(problem, &energy, solves.into_iter().flatten().collect(), unreached, &goal)
}

/// Solves for every item, in order; the part done goes through `range` without ever coming to its end.
fn exchange_all<T: Send, R: Send>(
    items: Vec<T>,
    solve: impl Fn(T, &dyn Fn() -> bool) -> Result<R, BiharmonicError> + Sync,
    range: Range<f64>,
    report_at: &mut dyn FnMut(Phase, f64) -> Result<(), BiharmonicError>,
) -> Result<Vec<R>, BiharmonicError> {
    let (mut done, share) = (range.start, 0.1 / items.len().max(1) as f64);
    let mut cancelled = None;
    let between = || {
        done += share * (range.end - done);
        cancelled = report_at(Phase::Exchange, done).err();
        if cancelled.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let solved = gather_reports(items, solve, between);
    match (cancelled, solved) {
        (None, Some(solves)) => solves.into_iter().collect(),
        (cancelled, _) => Err(cancelled.unwrap_or(BiharmonicError::Cancelled(Phase::Exchange))),
    }
}

/// A handle's final weights.
pub(crate) struct Solve {
    pub(crate) best: Candidate,
    /// Positions of the unknowns that the weights are of, ascending; all of them if that is not told.
    pub(crate) places: Option<Vec<u32>>,
    pub(crate) effort: Effort,
    pub(crate) converged: bool,
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

impl BiharmonicProblem<'_> {
    /// The given weights of one handle that are not zero, by their row among the fixed vertices.
    pub(crate) fn given(&self, handle: usize) -> Vec<(usize, f64)> {
        let given = &self.fixed_weights[handle * self.fixed.len()..(handle + 1) * self.fixed.len()];
        given.iter().copied().enumerate().filter(|(_, weight)| *weight != 0.0).collect()
    }

    /// The same by vertex.
    pub(crate) fn at_vertices(&self, given: &[(usize, f64)]) -> Vec<(usize, f64)> {
        given.iter().map(|&(row, weight)| (self.fixed[row], weight)).collect()
    }

    /// Given and computed weights of one handle together, without zeros, by ascending vertices; `column` is of the
    /// unknowns in `places` or of all.
    pub(crate) fn whole(
        &self,
        energy: &BiharmonicEnergy,
        handle: usize,
        places: Option<&[u32]>,
        column: &[f64],
    ) -> Vec<(usize, f64)> {
        let vertex = |at: usize| energy.unknowns[places.map_or(at, |places| places[at] as usize)] as usize;
        let moved = column.iter().enumerate().filter(|(_, weight)| **weight != 0.0);
        let mut weights: Vec<(usize, f64)> = moved.map(|(at, &weight)| (vertex(at), weight)).collect();
        weights.extend(self.at_vertices(&self.given(handle)));
        weights.sort_unstable_by_key(|&(vertex, _)| vertex);
        weights
    }

    /// `½ wᵀ (L M⁻¹ L + K) w`, summed from squares, so that the huge entries of slivers do not cancel; `weights` are
    /// those that are not zero, by ascending vertices.
    pub(crate) fn energy(&self, weights: &[(usize, f64)]) -> f64 {
        let mut curvature = vec![0.0; self.mass.len()];
        let touched = multiply_sparse(self.laplacian, weights, &mut curvature);
        let bent = touched.into_iter().filter(|&row| curvature[row] != 0.0);
        let squares: f64 = bent.map(|row| curvature[row] * curvature[row] / self.mass[row]).sum();
        let kept: f64 = self.shape_preservation.map_or(0.0, |k| {
            let mut gradient = vec![0.0; self.mass.len()];
            multiply_sparse(k, weights, &mut gradient);
            weights.iter().map(|&(vertex, weight)| gradient[vertex] * weight).sum()
        });
        0.5 * (squares + kept)
    }

    pub(crate) fn out_of_memory(&self) -> BiharmonicError {
        BiharmonicError::OutOfMemory { vertices: self.mass.len(), handles: self.handles }
    }
}

/// Adds a matrix times a sparse vector to `product`, which is zero; the rows that the vector reaches, ascending.
fn multiply_sparse(matrix: &SparseMatrix, vector: &[(usize, f64)], product: &mut [f64]) -> Vec<usize> {
    let mut reached = vec![false; product.len()];
    let mut rows = Vec::new();
    for &(column, factor) in vector {
        for (row, value) in matrix.column(column) {
            product[row] += value * factor;
            if !std::mem::replace(&mut reached[row], true) {
                rows.push(row);
            }
        }
    }
    rows.sort_unstable();
    rows
}
