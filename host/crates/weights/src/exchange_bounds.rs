//! One handle's exchanges of active sets, from a guess to weights that are proven good enough.

use crate::active_set::{ActiveSet, Candidate};
use crate::alternating_directions::Held;
use crate::free_descent::FreeDescent;
use crate::{BiharmonicError, BiharmonicSettings, CholeskyError};

/// An exchange that does not bring the gap below this fraction of the best so far has not paid ...
const PAYS: f64 = 0.5;

/// ... and after this many in a row the guess is renewed.
const PATIENCE: usize = 8;

/// A renewed guess takes no more steps than this.
const MOST_GUESS_STEPS: usize = 1000;

/// What counts as done.
pub(crate) struct Goal<'a> {
    pub(crate) settings: &'a BiharmonicSettings,
    pub(crate) largest_inverse: f64,
}

impl Goal<'_> {
    /// The largest duality gap that meets both bounds for weights of this energy.
    fn gap(&self, energy: f64) -> f64 {
        let wanted = self.settings.error_bound;
        (0.5 * wanted * wanted / self.largest_inverse).min(self.settings.relative_gap * energy)
    }

    pub(crate) fn error_bound(&self, gap: f64) -> f64 {
        (2.0 * gap * self.largest_inverse).sqrt()
    }
}

/// A handle's weights to start from, and which of them are held at a bound.
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

/// Why exchanges ended.
pub(crate) enum End {
    /// Both bounds hold.
    Converged,
    /// The best weights found are all there are; if there are none, their gap is infinite.
    LimitReached,
    /// An unknown was let go whose row of the Hessian is not whole here: on from these weights among more unknowns.
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
    /// Unknowns whose row of the Hessian is not whole; as long as there are unknowns, or empty.
    pub(crate) rim: &'a [bool],
}

/// Makes a better guess out of weights by so many steps.
pub(crate) type Renew<'a> = &'a dyn Fn(&mut [f64], usize) -> Result<Vec<Held>, CholeskyError>;

impl HandleProblem<'_> {
    /// Exchanges active sets until the gap is closed, or the limit or the rim reached, or exchanges stop to pay and
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
        let end = loop {
            if active_sets >= limit || !go_on() {
                break End::LimitReached;
            }
            active_sets += 1;
            // A share of the constant keeps rounding from deciding where the weights cost no energy at all.
            let scale = (descent.energy(self.right) + self.constant).max(1e-10 * self.constant);
            let allowed = goal.gap(scale);
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
