//! Handles that affect a small part of a mesh, each solved over the unknowns near it and proven on the whole mesh.

use super::active_set::ActiveSet;
use super::energy::BiharmonicEnergy;
use super::error::BiharmonicError;
use super::exchange_bounds::{Effort, End, Goal, Guess, HandleProblem, Solve};
use super::held::Held;
use super::neighbourhood::{Neighbourhood, likely_support, rings_from};
use super::problem::BiharmonicProblem;

/// A handle that seems to affect more than this fraction of all unknowns is solved over all of them ...
const LARGEST_GUESS: f64 = 0.2;

/// ... and so is one that turns out to affect more than this.
const LARGEST: f64 = 0.5;

/// What all handles share.
pub(crate) struct NearHandles<'a> {
    problem: &'a BiharmonicProblem<'a>,
    energy: &'a BiharmonicEnergy,
    active_set: &'a ActiveSet<'a>,
    rings: Vec<u32>,
}

impl<'a> NearHandles<'a> {
    /// `active_set` is that of all unknowns.
    pub(crate) fn new(
        problem: &'a BiharmonicProblem<'a>,
        energy: &'a BiharmonicEnergy,
        active_set: &'a ActiveSet<'a>,
    ) -> Self {
        Self { problem, energy, active_set, rings: rings_from(problem.laplacian, problem.fixed) }
    }

    /// `None` if the handle reaches too far or its exchanges do not finish: it is then solved over all unknowns.
    pub(crate) fn solve(
        &self,
        handle: usize,
        goal: &Goal<'_>,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Option<Solve>, BiharmonicError> {
        let Self { problem, energy, .. } = *self;
        let too_many = |count: usize, share: f64| count as f64 > share * energy.len() as f64;
        let given = problem.given(handle);
        let held_by_it = problem.at_vertices(&given);
        let constant = problem.energy(&held_by_it);
        let own: Vec<usize> = held_by_it.iter().map(|&(vertex, _)| vertex).collect();
        let support = likely_support(problem.laplacian, energy, &self.rings, &own);
        if too_many(support.len(), LARGEST_GUESS) {
            return Ok(None);
        }
        let pulled = || given.iter().flat_map(|&(row, _)| energy.pulled(row));
        let mut near = Neighbourhood::around(energy, support.iter().copied().chain(pulled()));
        let mut guess = start(&near, support.into_iter().map(|k| (k, 0.0, Held::Free)));
        let mut effort = Effort::default();
        loop {
            let right = energy.right_hand_side(&given, Some(&near.places));
            let active_set = self.active_set.near(&near);
            let here = HandleProblem { handle, active_set: &active_set, right: &right, constant, rim: &near.rim };
            let (best, end) = here.exchange_bounds(guess, goal, None, &mut effort, go_on)?;
            let at_rim = match end {
                End::Converged => return Ok(Some(Solve { best, places: Some(near.places), effort, converged: true })),
                End::LimitReached => return Ok(None),
                End::AtRim(at_rim) => at_rim,
            };
            let Guess { weights, held } = at_rim;
            let kept = near.places.iter().zip(weights).zip(held).map(|((&k, weight), held)| (k, weight, held));
            let kept: Vec<(u32, f64, Held)> = kept.filter(|(_, _, held)| *held != Held::Lower).collect();
            if too_many(kept.len(), LARGEST) {
                return Ok(None);
            }
            near = Neighbourhood::around(energy, kept.iter().map(|&(k, ..)| k).chain(pulled()));
            guess = start(&near, kept.into_iter());
        }
    }
}

/// These unknowns, given by their positions among all, and zero at all others nearby.
fn start(near: &Neighbourhood, unknowns: impl Iterator<Item = (u32, f64, Held)>) -> Guess {
    let mut guess = Guess { weights: vec![0.0; near.places.len()], held: vec![Held::Lower; near.places.len()] };
    for (k, weight, held) in unknowns {
        if let Ok(here) = near.places.binary_search(&k) {
            (guess.weights[here], guess.held[here]) = (weight, held);
        }
    }
    guess
}
