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

use std::ops::ControlFlow;

use armature_geometry::SparseMatrix;
use rayon::prelude::*;

use crate::active_set::{ActiveSet, Candidate};
use crate::alternating_directions::{AlternatingDirections, Held};
use crate::biharmonic_check::{BiharmonicError, check, reached};
use crate::biharmonic_energy::BiharmonicEnergy;
use crate::gather_reports::gather_reports;
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

/// Handles guessed together; a constant, so that results do not depend on the number of threads.
pub(crate) const BLOCK: usize = 5;

/// The guess's stiffness ρ in units of the mean Rayleigh quotient of the unbounded weights, `Σ wᵀAw / Σ wᵀMw`.
/// Tuned on hand.mesh.
const STIFFNESS: f64 = 30.0;

/// An exchange that does not bring the gap below this fraction of the best so far has not paid ...
const PAYS: f64 = 0.5;

/// ... and after this many in a row the guess is renewed.
const PATIENCE: usize = 8;

/// A renewed guess takes no more steps than this.
const MOST_GUESS_STEPS: usize = 1000;

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
    report_at(Phase::Guess, 0.1)?;
    let right: Vec<RightHandSide> =
        (0..problem.handles).into_par_iter().map(|handle| RightHandSide::new(problem, &energy, handle)).collect();
    let unbounded = unbounded(&energy, &right)?;
    let stiffness = STIFFNESS * rayleigh_quotient(problem, &energy, &unbounded);
    let directions = AlternatingDirections::new(&energy, stiffness)?;
    let guesses = guess(&directions, &right, &unbounded, settings.guess_steps)?;
    let active_set = ActiveSet::new(&energy);
    let goal = Goal { settings, largest_inverse: active_set.largest_inverse() };
    let solver = Solver { active_set, directions, goal };
    report_at(Phase::Exchange, 0.2)?;
    let (mut done, share) = (0.2, 0.1 / guesses.len().max(1) as f64);
    let mut cancelled = None;
    let between = || {
        // Never falling, and never quite there.
        done += share * (0.95 - done);
        cancelled = report_at(Phase::Exchange, done).err();
        if cancelled.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let items: Vec<_> = guesses.into_iter().zip(&right).enumerate().collect();
    let work = |(handle, (guess, right)): (usize, (Guess, &RightHandSide)), go_on: &dyn Fn() -> bool| {
        solver.solve(handle, guess, right, go_on)
    };
    let solved = gather_reports(items, work, between);
    let solves: Result<Vec<Solve>, BiharmonicError> = match (cancelled, solved) {
        (None, Some(solves)) => solves.into_iter().collect(),
        (cancelled, _) => Err(cancelled.unwrap_or(BiharmonicError::Cancelled(Phase::Exchange))),
    };
    let solves = solves?;
    report_at(Phase::Finish, 0.95)?;
    assemble(problem, &energy, solves, unreached, &solver.goal)
}

/// What counts as done.
struct Goal<'a> {
    settings: &'a BiharmonicSettings,
    largest_inverse: f64,
}

impl Goal<'_> {
    /// The largest duality gap that meets both bounds for weights of this energy.
    fn gap(&self, energy: f64) -> f64 {
        let wanted = self.settings.error_bound;
        (0.5 * wanted * wanted / self.largest_inverse).min(self.settings.relative_gap * energy)
    }

    fn error_bound(&self, gap: f64) -> f64 {
        (2.0 * gap * self.largest_inverse).sqrt()
    }
}

/// A handle's weights to start from.
struct Guess {
    weights: Vec<f64>,
    held: Vec<Held>,
}

/// A handle's final weights.
#[derive(Default)]
struct Solve {
    best: Candidate,
    energy: f64,
    active_sets: usize,
    factorisations: usize,
    iterations: usize,
    converged: bool,
}

/// What all handles share.
struct Solver<'a> {
    active_set: ActiveSet<'a>,
    directions: AlternatingDirections<'a>,
    goal: Goal<'a>,
}

impl Solver<'_> {
    /// Exchanges active sets until the gap is closed or the limit reached.
    fn solve(
        &self,
        handle: usize,
        guess: Guess,
        right: &RightHandSide,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Solve, BiharmonicError> {
        let limit = self.goal.settings.max_active_sets;
        let Guess { weights, mut held } = guess;
        let mut descent = self.active_set.start(&right.values, weights, &held);
        let mut best: Option<Candidate> = None;
        let mut least = f64::INFINITY;
        let (mut unpaid, mut guess_steps) = (0, self.goal.settings.guess_steps);
        let mut solve = Solve::default();
        while solve.active_sets < limit && !solve.converged && go_on() {
            solve.active_sets += 1;
            // A share of the constant keeps rounding from deciding where the weights cost no energy at all.
            let scale = (descent.energy(&right.values) + right.constant).max(1e-10 * right.constant);
            let allowed = self.goal.gap(scale);
            let certify = solve.active_sets == limit;
            let exchanged = self.active_set.exchange(&right.values, &mut descent, &mut held, allowed, certify)?;
            if !exchanged.gained.is_finite() {
                return Err(BiharmonicError::NotFinite { handle });
            }
            unpaid = if exchanged.gained < PAYS * least { 0 } else { unpaid + 1 };
            least = least.min(exchanged.gained);
            if let Some(candidate) = exchanged.candidate
                && best.as_ref().is_none_or(|best| candidate.certificate.gap < best.certificate.gap)
            {
                solve.converged = candidate.certificate.gap <= allowed;
                best = Some(candidate);
            }
            if unpaid >= PATIENCE && !solve.converged {
                guess_steps = (2 * guess_steps).min(MOST_GUESS_STEPS);
                let mut weights: Vec<f64> = descent.weights.iter().map(|weight| weight.clamp(0.0, 1.0)).collect();
                held = self.directions.run(&right.values, &mut weights, guess_steps)?;
                descent = descent.restart(self.active_set.start(&right.values, weights, &held));
                (unpaid, least) = (0, f64::INFINITY);
            }
        }
        (solve.factorisations, solve.iterations) = (descent.factorisations, descent.iterations);
        solve.best = best.unwrap_or_default();
        solve.energy = solve.best.energy + right.constant;
        if solve.best.certificate.gap.is_finite() { Ok(solve) } else { Err(BiharmonicError::NotFinite { handle }) }
    }
}

/// What one handle's given weights do to the unknowns.
pub(crate) struct RightHandSide {
    pub(crate) values: Vec<f64>,
    /// Energy of the given weights alone.
    constant: f64,
}

impl RightHandSide {
    pub(crate) fn new(problem: &BiharmonicProblem<'_>, energy: &BiharmonicEnergy, handle: usize) -> Self {
        let given = problem.given(handle);
        let mut weights = vec![0.0; problem.mass.len()];
        problem.fixed.iter().zip(given).for_each(|(&vertex, &weight)| weights[vertex] = weight);
        Self { values: energy.right_hand_side(given), constant: problem.energy(&weights) }
    }
}

/// Weights without bounds, one column for every handle.
pub(crate) fn unbounded(energy: &BiharmonicEnergy, right: &[RightHandSide]) -> Result<Vec<Vec<f64>>, CholeskyError> {
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
pub(crate) fn rayleigh_quotient(
    problem: &BiharmonicProblem<'_>,
    energy: &BiharmonicEnergy,
    columns: &[Vec<f64>],
) -> f64 {
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
) -> Result<Vec<Guess>, CholeskyError> {
    let one = |(block, right): (&[Vec<f64>], &[RightHandSide])| {
        let n = block[0].len();
        let mut weights: Vec<f64> = block.iter().flatten().map(|w| w.clamp(0.0, 1.0)).collect();
        let right: Vec<f64> = right.iter().flat_map(|right| right.values.iter().copied()).collect();
        let held = if n == 0 { Vec::new() } else { directions.run(&right, &mut weights, steps)? };
        let start =
            |k: usize| Guess { weights: weights[k * n..(k + 1) * n].to_vec(), held: held[k * n..(k + 1) * n].to_vec() };
        Ok((0..block.len()).map(start).collect::<Vec<_>>())
    };
    let blocks: Result<Vec<_>, CholeskyError> =
        unbounded.par_chunks(BLOCK).zip(right.par_chunks(BLOCK)).map(one).collect();
    Ok(blocks?.into_iter().flatten().collect())
}

fn assemble(
    problem: &BiharmonicProblem<'_>,
    energy: &BiharmonicEnergy,
    solves: Vec<Solve>,
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
            factorisations: solve.factorisations,
            iterations: solve.iterations,
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
    pub(crate) fn whole(&self, energy: &BiharmonicEnergy, handle: usize, column: &[f64]) -> Vec<f64> {
        let mut weights = vec![0.0; self.mass.len()];
        energy.unknowns.iter().zip(column).for_each(|(&vertex, &weight)| weights[vertex as usize] = weight);
        self.fixed.iter().zip(self.given(handle)).for_each(|(&vertex, &weight)| weights[vertex] = weight);
        weights
    }

    /// `½ wᵀ (L M⁻¹ L + K) w`, summed from squares, so that the huge entries of slivers do not cancel.
    pub(crate) fn energy(&self, weights: &[f64]) -> f64 {
        let curvature = self.laplacian.multiply(weights);
        let squares = curvature.iter().zip(self.mass).filter(|(c, _)| **c != 0.0).map(|(c, m)| c * c / m);
        let kept = self
            .shape_preservation
            .map_or(0.0, |k| k.multiply(weights).iter().zip(weights).map(|(gradient, weight)| gradient * weight).sum());
        0.5 * (squares.sum::<f64>() + kept)
    }
}
