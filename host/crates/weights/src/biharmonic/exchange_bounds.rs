//! One handle's exchanges of active sets, from a guess to weights that are provably good enough.

use super::active_set::{ActiveSet, Candidate};
use super::error::BiharmonicError;
use super::free_descent::FreeDescent;
use super::held::Held;
use super::problem::BiharmonicSettings;
use crate::sparse::cholesky::CholeskyError;

/// An exchange that does not bring the gap below this fraction of the best so far has not paid off ...
const PAYS: f64 = 0.5;

/// ... and after this many of those in a row the guess is renewed.
const PATIENCE: usize = 8;

/// A renewed guess that does not bring the certificate below this fraction of the last one has gained nothing, and after
/// so many of those in a row the weights are as good as they get: on thousands of flat elements, rounding decides which
/// are held. Long thin bars still converge after a few.
const GAINS: f64 = 0.5;
const HOPELESS: usize = 6;

/// A renewed guess takes at most this many steps.
const MOST_GUESS_STEPS: usize = 1000;

/// What counts as done.
pub(crate) struct Goal<'a> {
    pub(crate) settings: &'a BiharmonicSettings,
    pub(crate) largest_inverse: f64,
}

impl Goal<'_> {
    /// The largest duality gap that meets both bounds for weights with this energy.
    fn gap(&self, energy: f64) -> f64 {
        let wanted = self.settings.error_bound;
        (0.5 * wanted * wanted / self.largest_inverse).min(self.settings.relative_gap * energy)
    }

    /// The same for unknowns with this energy beside the constant one of given weights. A fraction of that keeps rounding
    /// from deciding where the weights cost no energy.
    pub(crate) fn gap_at(&self, energy: f64, constant: f64) -> f64 {
        self.gap((energy + constant).max(1e-10 * constant))
    }

    pub(crate) fn error_bound(&self, gap: f64) -> f64 {
        (2.0 * gap * self.largest_inverse).sqrt()
    }
}

/// Initial weights for a handle, and which of them are held at a bound.
pub(crate) struct Guess {
    pub(crate) weights: Vec<f64>,
    pub(crate) held: Vec<Held>,
}

/// What has been spent on a handle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Effort {
    pub(crate) active_sets: usize,
    pub(crate) factorisations: usize,
    pub(crate) iterations: usize,
}

/// A handle's final weights.
pub(crate) struct Solve {
    pub(crate) best: Candidate,
    /// Positions of the unknowns that the weights are of, ascending; `None` where they are of all.
    pub(crate) places: Option<Vec<u32>>,
    pub(crate) effort: Effort,
    pub(crate) converged: bool,
}

/// Why exchanges ended.
pub(crate) enum End {
    /// Both bounds hold.
    Converged,
    /// The best weights found are all there is; if there are none, their gap is infinite.
    LimitReached,
    /// A released unknown's row of the Hessian is incomplete here: continue from these weights with more unknowns.
    AtRim(Guess),
}

/// One handle's problem: `min ½ wᵀ A w - bᵀ w + c` within the bounds.
pub(crate) struct HandleProblem<'a> {
    pub(crate) handle: usize,
    pub(crate) active_set: &'a ActiveSet<'a>,
    /// `b`.
    pub(crate) right: &'a [f64],
    /// `c`: energy of the given weights alone.
    pub(crate) constant: f64,
    /// Unknowns whose row of the Hessian is not whole; those beyond its end are.
    pub(crate) rim: &'a [bool],
}

/// Makes a better guess from weights in the given number of steps.
pub(crate) type Renew<'a> = &'a dyn Fn(&mut [f64], usize) -> Result<Vec<Held>, CholeskyError>;

impl HandleProblem<'_> {
    /// The certificate of guessed weights, if they need no exchanges.
    pub(crate) fn already_good(&self, weights: &[f64], goal: &Goal<'_>) -> Option<Candidate> {
        let (candidate, energy) = self.active_set.measure(self.right, weights.to_vec());
        let allowed = goal.gap_at(energy, self.constant);
        (candidate.certificate.gap <= allowed).then_some(candidate)
    }

    /// Exchanges active sets until the gap is closed, the limit or the rim is reached, or exchanges stop paying off and
    /// there is no way to `renew` the guess.
    pub(crate) fn exchange_bounds(
        &self,
        guess: Guess,
        goal: &Goal<'_>,
        renew: Option<Renew<'_>>,
        effort: &mut Effort,
        go_on: &dyn Fn() -> bool,
    ) -> Result<(Candidate, End), BiharmonicError> {
        let Guess { weights, mut held } = guess;
        let mut descent = self.active_set.start(self.right, weights, &held);
        let limit = goal.settings.max_active_sets;
        let mut best = Candidate::default();
        best.certificate.gap = f64::INFINITY;
        let mut least = f64::INFINITY;
        let (mut unpaid, mut guess_steps, mut active_sets) = (0, goal.settings.guess_steps, 0);
        let (mut renewed, mut in_vain) = (f64::INFINITY, 0);
        let end = loop {
            if active_sets >= limit || !go_on() {
                break End::LimitReached;
            }
            active_sets += 1;
            let allowed = goal.gap_at(descent.energy(self.right), self.constant);
            let certify = active_sets == limit;
            let exchanged = self.active_set.exchange(self.right, &mut descent, &mut held, allowed, certify)?;
            if !exchanged.gained.is_finite() {
                return Err(BiharmonicError::NotFinite { handle: self.handle });
            }
            unpaid = if exchanged.gained < PAYS * least { 0 } else { unpaid + 1 };
            least = least.min(exchanged.gained);
            if let Some(candidate) = exchanged.candidate
                && candidate.certificate.gap < best.certificate.gap
            {
                best = candidate;
                if best.certificate.gap <= allowed {
                    break End::Converged;
                }
            }
            if self.rim.iter().zip(&held).any(|(rim, held)| *rim && *held != Held::Lower) {
                break End::AtRim(Guess { weights: std::mem::take(&mut descent.weights), held });
            }
            if unpaid >= PATIENCE {
                let Some(renew) = renew else { break End::LimitReached };
                guess_steps = (2 * guess_steps).min(MOST_GUESS_STEPS);
                let mut weights: Vec<f64> = descent.weights.iter().map(|weight| weight.clamp(0.0, 1.0)).collect();
                held = renew(&mut weights, guess_steps)?;
                let (candidate, energy) = self.active_set.measure(self.right, weights.clone());
                if candidate.certificate.gap < best.certificate.gap {
                    best = candidate;
                }
                if best.certificate.gap <= goal.gap_at(energy, self.constant) {
                    break End::Converged;
                }
                in_vain = if best.certificate.gap < GAINS * renewed { 0 } else { in_vain + 1 };
                renewed = best.certificate.gap;
                if in_vain == HOPELESS {
                    break End::LimitReached;
                }
                descent = descent.restart(self.active_set.start(self.right, weights, &held));
                (unpaid, least) = (0, f64::INFINITY);
            }
        };
        effort.active_sets += active_sets;
        effort.add(&descent);
        Ok((best, end))
    }
}

impl Effort {
    fn add(&mut self, descent: &FreeDescent<'_>) {
        self.factorisations += descent.factorisations;
        self.iterations += descent.iterations;
    }
}
