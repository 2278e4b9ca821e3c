//! Handles that affect much of a mesh, solved over all its unknowns: a guess by alternating directions with one shared
//! factorisation, then exchanges that start from it.

use rayon::prelude::*;

use super::active_set::ActiveSet;
use super::alternating_directions::AlternatingDirections;
use super::energy::BiharmonicEnergy;
use super::error::BiharmonicError;
use super::exchange_bounds::{Effort, End, Goal, Guess, HandleProblem, Solve};
use super::held::Held;
use super::problem::BiharmonicProblem;
use crate::sparse::cholesky::CholeskyError;
use crate::sparse::solve_together::LANES;

/// Handles guessed together; a constant, so that results do not depend on the number of threads.
pub(crate) const BLOCK: usize = LANES;

/// The guess's stiffness ρ in units of the mean Rayleigh quotient of the unbounded weights, `Σ wᵀAw / Σ wᵀMw`. On large
/// meshes handles differ, and exchanges soon get further than steps; tuned on hand.mesh.
const STIFFNESS: f64 = 30.0;

/// Meshes with fewer unknowns are small: all handles are about as stiff, and accelerated steps alone often reach the
/// certificate.
pub(crate) const FEWEST: usize = 3000;

/// Stiffness and most steps there. Tuned on volumes of 1,900 to 2,900 vertices with 4 to 24 bones.
const STIFFNESS_OF_SMALL: f64 = 200.0;
const STEPS_OF_SMALL: usize = 40;

/// Accelerated steps between certificates.
const ROUND: usize = 20;

/// What these handles share.
pub(crate) struct FarHandles<'a> {
    active_set: &'a ActiveSet<'a>,
    directions: AlternatingDirections<'a>,
    small: bool,
}

/// A handle with its right-hand side and its guess.
pub(crate) struct FarHandle {
    handle: usize,
    right: RightHandSide,
    guess: Guess,
}

impl<'a> FarHandles<'a> {
    /// Factorises for `handles` and guesses their weights, block by block.
    pub(crate) fn guess(
        problem: &BiharmonicProblem<'_>,
        energy: &'a BiharmonicEnergy,
        active_set: &'a ActiveSet<'a>,
        handles: &[usize],
        goal: &Goal<'_>,
    ) -> Result<(Self, Vec<FarHandle>), BiharmonicError> {
        let right: Vec<RightHandSide> =
            handles.par_iter().map(|&handle| RightHandSide::new(problem, energy, handle)).collect();
        let unbounded = unbounded(energy, &right)?;
        let small = energy.len() < FEWEST;
        let stiffness = if small { STIFFNESS_OF_SMALL } else { STIFFNESS }
            * rayleigh_quotient(problem, energy, handles.iter().copied().zip(&unbounded));
        let directions = AlternatingDirections::new(&energy.hessian, &energy.mass, stiffness)?;
        let blocks = unbounded.par_chunks(BLOCK).zip(right.par_chunks(BLOCK));
        let guess = |(unbounded, right): (&[Vec<f64>], &[RightHandSide])| {
            if small {
                guess_accelerated(active_set, &directions, (unbounded, right), goal)
            } else {
                guess_block(&directions, unbounded, right, goal.settings.guess_steps)
            }
        };
        let guesses: Result<Vec<Vec<Guess>>, CholeskyError> = blocks.map(guess).collect();
        let guessed = handles.iter().zip(right).zip(guesses?.into_iter().flatten());
        let items = guessed.map(|((&handle, right), guess)| FarHandle { handle, right, guess }).collect();
        Ok((Self { active_set, directions, small }, items))
    }

    /// Exchanges bounds until the weights are good enough or the limit is reached.
    pub(crate) fn solve(
        &self,
        far: FarHandle,
        goal: &Goal<'_>,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Solve, BiharmonicError> {
        let FarHandle { handle, right, guess } = far;
        let (active_set, constant) = (self.active_set, right.constant);
        let problem = HandleProblem { handle, active_set, right: &right.values, constant, rim: &[] };
        let renew = |weights: &mut [f64], steps| self.directions.run(&right.values, weights, steps);
        let mut effort = Effort::default();
        if self.small
            && let Some(best) = problem.already_good(&guess.weights, goal)
        {
            return Ok(Solve { best, places: None, effort, converged: true });
        }
        let (best, end) = problem.exchange_bounds(guess, goal, Some(&renew), &mut effort, go_on)?;
        if best.certificate.gap.is_finite() {
            Ok(Solve { best, places: None, effort, converged: matches!(end, End::Converged) })
        } else {
            Err(BiharmonicError::NotFinite { handle })
        }
    }
}

/// How one handle's given weights act on the unknowns.
pub(crate) struct RightHandSide {
    pub(crate) values: Vec<f64>,
    /// Energy of the given weights alone.
    constant: f64,
}

impl RightHandSide {
    pub(crate) fn new(problem: &BiharmonicProblem<'_>, energy: &BiharmonicEnergy, handle: usize) -> Self {
        let given = problem.given(handle);
        Self { values: energy.right_hand_side(&given, None), constant: problem.energy(&problem.at_vertices(&given)) }
    }
}

/// Weights without bounds, one column per handle.
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

/// `Σ wᵀAw / Σ wᵀMw` over handles, each with its unknowns' weights: the stiffness of the weights, as energy per mass.
pub(crate) fn rayleigh_quotient<'a>(
    problem: &BiharmonicProblem<'_>,
    energy: &BiharmonicEnergy,
    columns: impl Iterator<Item = (usize, &'a Vec<f64>)>,
) -> f64 {
    let (mut energies, mut masses) = (0.0, 0.0);
    for (handle, column) in columns {
        let weights = problem.whole(energy, handle, None, column);
        energies += 2.0 * problem.energy(&weights);
        masses += weights.iter().map(|&(vertex, w)| w * w * problem.mass[vertex]).sum::<f64>();
    }
    // If one handle holds everything there is no energy, and any stiffness will do.
    let quotient = energies / masses;
    if quotient.is_normal() { quotient } else { f64::MIN_POSITIVE }
}

/// A first guess for a few handles at once.
fn guess_block(
    directions: &AlternatingDirections<'_>,
    unbounded: &[Vec<f64>],
    right: &[RightHandSide],
    steps: usize,
) -> Result<Vec<Guess>, CholeskyError> {
    let n = unbounded[0].len();
    let mut weights: Vec<f64> = unbounded.iter().flatten().map(|w| w.clamp(0.0, 1.0)).collect();
    let right: Vec<f64> = right.iter().flat_map(|right| right.values.iter().copied()).collect();
    let held = if n == 0 { Vec::new() } else { directions.run(&right, &mut weights, steps)? };
    let start =
        |k: usize| Guess { weights: weights[k * n..(k + 1) * n].to_vec(), held: held[k * n..(k + 1) * n].to_vec() };
    Ok((0..unbounded.len()).map(start).collect())
}

/// The same by accelerated steps; stops early once all of them are good enough.
fn guess_accelerated(
    active_set: &ActiveSet<'_>,
    directions: &AlternatingDirections<'_>,
    (unbounded, right): (&[Vec<f64>], &[RightHandSide]),
    goal: &Goal<'_>,
) -> Result<Vec<Guess>, CholeskyError> {
    let n = unbounded[0].len();
    if n == 0 {
        return Ok(unbounded.iter().map(|_| Guess { weights: Vec::new(), held: Vec::new() }).collect());
    }
    let weights: Vec<f64> = unbounded.iter().flatten().map(|w| w.clamp(0.0, 1.0)).collect();
    let all: Vec<f64> = right.iter().flat_map(|right| right.values.iter().copied()).collect();
    let mut steps = directions.start(&all, &weights);
    let most_steps = STEPS_OF_SMALL.min(2 * goal.settings.guess_steps);
    let mut taken = 0;
    while taken < most_steps {
        let round = ROUND.min(most_steps - taken);
        steps.advance(round)?;
        taken += round;
        let good = |(weights, RightHandSide { values, constant }): (&[f64], &RightHandSide)| {
            let constant = *constant;
            HandleProblem { handle: 0, active_set, right: values, constant, rim: &[] }
                .already_good(weights, goal)
                .is_some()
        };
        if steps.weights().chunks(n).zip(right).all(good) {
            break;
        }
    }
    let (weights, held) = (steps.weights(), steps.held());
    let guess = |(weights, held): (&[f64], &[Held])| Guess { weights: weights.to_vec(), held: held.to_vec() };
    Ok(weights.chunks(n).zip(held.chunks(n)).map(guess).collect())
}
