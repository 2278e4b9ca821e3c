//! Bounded biharmonic weights (Jacobson et al. 2011; thesis 4.3): for every handle the smoothest weights between
//! zero and one that take given values at the handles,
//! `min ½ wᵀ (L M⁻¹ L + K) w` with `w_b = given` and `0 ≤ w ≤ 1`.
//!
//! Handles are solved apart from each other (the partition of unity comes afterwards, by normalising). A few steps
//! of alternating directions with one shared factorisation guess which weights lie at a bound; a primal-dual active
//! set method then exchanges them until the duality gap proves the weights right. Mostly five to fifteen exchanges
//! do, each costing one factorisation of the free weights' part of the Hessian. Where exchanges stop to pay, more and
//! more steps of alternating directions, which always converge, give a better guess.

use std::ops::ControlFlow;

use armature_geometry::SparseMatrix;
use rayon::prelude::*;

use crate::active_set::{ActiveSet, Candidate, Certificate};
use crate::alternating_directions::{AlternatingDirections, Held};
use crate::biharmonic_check::{BiharmonicError, check, reached};
use crate::biharmonic_energy::BiharmonicEnergy;
use crate::inverse_diagonal::inverse_diagonal;
use crate::{CholeskyError, Phase, Progress, WeightMatrix};

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
    /// Optimal to 1e-5 in every weight and to ten digits in the energy.
    pub fn certified() -> Self {
        Self { error_bound: 1e-5, relative_gap: 1e-10, guess_steps: 40, max_active_sets: 200 }
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
    /// Active sets tried, each one factorisation.
    pub active_sets: usize,
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

/// Handles guessed together; a constant, so that results do not depend on the number of threads.
const BLOCK: usize = 5;

/// The guess's stiffness ρ in units of the mean Rayleigh quotient of the unbounded weights, `Σ wᵀAw / Σ wᵀMw`.
/// Tuned on hand.mesh.
const STIFFNESS: f64 = 30.0;

/// An exchange that does not bring the gap below this fraction of the best so far has not paid ...
const PAYS: f64 = 0.5;

/// ... and after this many in a row the guess is renewed.
const PATIENCE: usize = 8;

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
    let largest_inverse = inverse_diagonal(&energy.factor).into_iter().fold(0.0, f64::max);
    report_at(Phase::Guess, 0.1)?;
    let right: Vec<RightHandSide> =
        (0..problem.handles).into_par_iter().map(|handle| RightHandSide::new(problem, &energy, handle)).collect();
    let unbounded = unbounded(&energy, &right)?;
    let stiffness = STIFFNESS * rayleigh_quotient(problem, &energy, &unbounded);
    let directions = AlternatingDirections::new(&energy, stiffness)?;
    let mut solves = guess(&directions, &right, &unbounded, settings.guess_steps)?;
    let goal = Goal { settings, largest_inverse };
    let active_set = ActiveSet::new(&energy);
    let count = solves.len().max(1) as f64;
    let mut done = 0.0;
    for _ in 0..settings.max_active_sets {
        let open: Vec<(usize, &mut HandleSolve)> =
            solves.iter_mut().enumerate().filter(|(_, solve)| !solve.converged).collect();
        if open.is_empty() {
            break;
        }
        // Never falling, and never quite there while a handle is open.
        done += (1.0 - open.len() as f64 / count - done).max(0.0) + 0.05 * (1.0 - done) / count;
        report_at(Phase::Exchange, 0.2 + 0.75 * done.min(1.0))?;
        open.into_par_iter()
            .with_max_len(1)
            .try_for_each(|(handle, solve)| solve.advance(&active_set, &directions, &right[handle], &goal, handle))?;
    }
    report_at(Phase::Finish, 0.95)?;
    assemble(problem, &energy, solves, unreached, &goal)
}

/// What counts as done.
struct Goal<'a> {
    settings: &'a BiharmonicSettings,
    largest_inverse: f64,
}

impl Goal<'_> {
    fn error_bound(&self, gap: f64) -> f64 {
        (2.0 * gap * self.largest_inverse).sqrt()
    }
}

/// One handle on its way.
struct HandleSolve {
    held: Vec<Held>,
    best: Candidate,
    energy: f64,
    active_sets: usize,
    unpaid: usize,
    guess_steps: usize,
    converged: bool,
}

impl HandleSolve {
    /// Tries one more active set.
    fn advance(
        &mut self,
        active_set: &ActiveSet<'_>,
        directions: &AlternatingDirections<'_>,
        right: &RightHandSide,
        goal: &Goal<'_>,
        handle: usize,
    ) -> Result<(), BiharmonicError> {
        let candidate = active_set.step(&right.values, &mut self.held)?;
        self.active_sets += 1;
        let gap = candidate.certificate.gap;
        if !gap.is_finite() {
            return Err(BiharmonicError::NotFinite { handle });
        }
        let best = self.best.certificate.gap;
        self.unpaid = if gap < PAYS * best { 0 } else { self.unpaid + 1 };
        if gap < best {
            self.best = candidate;
            self.energy = active_set.energy(&right.values, &self.best.weights) + right.constant;
            // A share of the constant keeps rounding from deciding where the weights cost no energy at all.
            let scale = self.energy.max(1e-10 * right.constant);
            self.converged =
                goal.error_bound(gap) <= goal.settings.error_bound && gap <= goal.settings.relative_gap * scale;
        }
        if self.unpaid >= PATIENCE && !self.converged {
            self.guess_steps *= 2;
            let mut weights = self.best.weights.clone();
            self.held = directions.run(&right.values, &mut weights, self.guess_steps)?;
            self.unpaid = 0;
        }
        Ok(())
    }
}

/// What one handle's given weights do to the unknowns.
struct RightHandSide {
    values: Vec<f64>,
    /// Energy of the given weights alone.
    constant: f64,
}

impl RightHandSide {
    fn new(problem: &BiharmonicProblem<'_>, energy: &BiharmonicEnergy, handle: usize) -> Self {
        let given = problem.given(handle);
        let mut weights = vec![0.0; problem.mass.len()];
        problem.fixed.iter().zip(given).for_each(|(&vertex, &weight)| weights[vertex] = weight);
        Self { values: energy.right_hand_side(given), constant: problem.energy(&weights) }
    }
}

/// Weights without bounds, one column for every handle.
fn unbounded(energy: &BiharmonicEnergy, right: &[RightHandSide]) -> Result<Vec<Vec<f64>>, CholeskyError> {
    let solve = |block: &[RightHandSide]| {
        let mut columns: Vec<f64> = block.iter().flat_map(|right| right.values.iter().copied()).collect();
        energy.factor.solve_here(&mut columns)?;
        Ok(columns.chunks(energy.len().max(1)).map(<[f64]>::to_vec).collect::<Vec<_>>())
    };
    if energy.len() == 0 {
        return Ok(vec![Vec::new(); right.len()]);
    }
    let blocks: Result<Vec<_>, CholeskyError> = right.par_chunks(BLOCK).map(solve).collect();
    Ok(blocks?.into_iter().flatten().collect())
}

/// `Σ wᵀAw / Σ wᵀMw` over all handles: the energy per mass at which weights resist.
fn rayleigh_quotient(problem: &BiharmonicProblem<'_>, energy: &BiharmonicEnergy, columns: &[Vec<f64>]) -> f64 {
    let (mut energies, mut masses) = (0.0, 0.0);
    for (handle, column) in columns.iter().enumerate() {
        let weights = problem.whole(energy, handle, column);
        energies += 2.0 * problem.energy(&weights);
        masses += weights.iter().zip(problem.mass).map(|(w, m)| w * w * m).sum::<f64>();
    }
    // Where one handle holds everything there is no energy, and any stiffness will do.
    let quotient = energies / masses;
    if quotient.is_normal() { quotient } else { f64::MIN_POSITIVE }
}

/// A first guess for every handle.
fn guess(
    directions: &AlternatingDirections<'_>,
    right: &[RightHandSide],
    unbounded: &[Vec<f64>],
    steps: usize,
) -> Result<Vec<HandleSolve>, CholeskyError> {
    let one = |(block, right): (&[Vec<f64>], &[RightHandSide])| {
        let n = block[0].len();
        let mut weights: Vec<f64> = block.iter().flatten().map(|w| w.clamp(0.0, 1.0)).collect();
        let right: Vec<f64> = right.iter().flat_map(|right| right.values.iter().copied()).collect();
        let held = if n == 0 { Vec::new() } else { directions.run(&right, &mut weights, steps)? };
        let start = |k: usize| HandleSolve {
            held: held[k * n..(k + 1) * n].to_vec(),
            best: Candidate { weights: weights[k * n..(k + 1) * n].to_vec(), certificate: Certificate::NOTHING_KNOWN },
            energy: f64::INFINITY,
            active_sets: 0,
            unpaid: 0,
            guess_steps: steps,
            converged: false,
        };
        Ok((0..block.len()).map(start).collect::<Vec<_>>())
    };
    let blocks: Result<Vec<_>, CholeskyError> =
        unbounded.par_chunks(BLOCK).zip(right.par_chunks(BLOCK)).map(one).collect();
    Ok(blocks?.into_iter().flatten().collect())
}

fn assemble(
    problem: &BiharmonicProblem<'_>,
    energy: &BiharmonicEnergy,
    solves: Vec<HandleSolve>,
    unreached: Vec<Vec<usize>>,
    goal: &Goal<'_>,
) -> Result<BiharmonicWeights, BiharmonicError> {
    let (n, m) = (problem.mass.len(), problem.handles);
    let out_of_memory = BiharmonicError::OutOfMemory { vertices: n, handles: m };
    let mut values = Vec::new();
    let entries = n.checked_mul(m).ok_or(out_of_memory.clone())?;
    values.try_reserve_exact(entries).map_err(|_| out_of_memory.clone())?;
    let mut reports = Vec::with_capacity(m);
    for (handle, solve) in solves.into_iter().enumerate() {
        let weights = problem.whole(energy, handle, &solve.best.weights);
        let certificate = solve.best.certificate;
        reports.push(HandleReport {
            energy: problem.energy(&weights),
            gap: certificate.gap,
            error_bound: goal.error_bound(certificate.gap),
            largest_bound_violation: weights.iter().map(|w| (-w).max(w - 1.0).max(0.0)).fold(0.0, f64::max),
            largest_wrong_multiplier: certificate.wrong_multiplier,
            stationarity: certificate.stationarity,
            active_sets: solve.active_sets,
            outcome: if solve.converged { BiharmonicOutcome::Converged } else { BiharmonicOutcome::LimitReached },
        });
        values.extend(weights);
    }
    let weights = WeightMatrix::from_columns(n, m, values).ok_or(out_of_memory)?;
    Ok(BiharmonicWeights { weights, reports, unreached, factor_entries: energy.factor.stored() })
}

impl BiharmonicProblem<'_> {
    /// The given weights of one handle.
    fn given(&self, handle: usize) -> &[f64] {
        &self.fixed_weights[handle * self.fixed.len()..(handle + 1) * self.fixed.len()]
    }

    /// Given and computed weights of one handle together, n long.
    fn whole(&self, energy: &BiharmonicEnergy, handle: usize, column: &[f64]) -> Vec<f64> {
        let mut weights = vec![0.0; self.mass.len()];
        energy.unknowns.iter().zip(column).for_each(|(&vertex, &weight)| weights[vertex as usize] = weight);
        self.fixed.iter().zip(self.given(handle)).for_each(|(&vertex, &weight)| weights[vertex] = weight);
        weights
    }

    /// `½ wᵀ (L M⁻¹ L + K) w`, summed from squares, so that the huge entries of slivers do not cancel.
    fn energy(&self, weights: &[f64]) -> f64 {
        let curvature = self.laplacian.multiply(weights);
        let squares = curvature.iter().zip(self.mass).filter(|(c, _)| **c != 0.0).map(|(c, m)| c * c / m);
        let kept = self
            .shape_preservation
            .map_or(0.0, |k| k.multiply(weights).iter().zip(weights).map(|(gradient, weight)| gradient * weight).sum());
        0.5 * (squares.sum::<f64>() + kept)
    }
}
