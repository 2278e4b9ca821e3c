//! An active set method for one handle (primal-dual as in Hintermüller, Ito & Kunisch 2003; thesis 2.2.3), with a
//! certificate of optimality.
//!
//! Exchanging every unknown with a wrong sign, as the plain method does, overshoots: where weights swing below zero,
//! holding the lowest of them at the bound lifts the rest, and far from the handle hundreds of negligible weights
//! change sides at every step. So an unknown is held only where it violates a bound most among its neighbours, and
//! released only where that can lower the energy by more than a set share of what is still to be gained.

use super::energy::BiharmonicEnergy;
use super::free_descent::FreeDescent;
use super::held::Held;
use super::neighbourhood::Neighbourhood;
use crate::sparse::cholesky::{CholeskyError, SparseCholesky};
use crate::sparse::inverse_diagonal::inverse_diagonal;
use crate::sparse::symmetric::Symmetric;

/// An unknown beyond a bound is held there if its violation is at least this fraction of the worst among its
/// neighbours. Tuned on hand.mesh: 0 needs a third more exchanges.
const DEEP: f64 = 0.7;

/// Wrong multipliers are left alone while all they can change together, as a distance in the energy norm, is less than
/// this fraction of what the last step changed ...
const SHARE: f64 = 0.005;

/// ... or less than this fraction of what is allowed.
const ALLOWED_SHARE: f64 = 0.3;

/// A certificate is worth computing after a step that gains less than this multiple of the allowed gap.
const NEAR: f64 = 30.0;

/// How far weights are known to be from the optimum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Certificate {
    /// Energy of the weights minus that of a feasible dual point: no weights have an energy lower by more than this.
    pub(crate) gap: f64,
    /// Largest wrong-signed multiplier at a bound over the Hessian's diagonal.
    pub(crate) wrong_multiplier: f64,
    /// Largest gradient between the bounds over the Hessian's diagonal.
    pub(crate) stationarity: f64,
}

/// Weights within the bounds, and how good they are.
#[derive(Clone, Debug, Default)]
pub(crate) struct Candidate {
    pub(crate) weights: Vec<f64>,
    pub(crate) certificate: Certificate,
}

/// The unknowns being exchanged: all, or those near a handle.
pub(crate) struct ActiveSet<'a> {
    hessian: &'a Symmetric,
    /// Cholesky factor of the whole Hessian, and the place there of each unknown here; `None` where all are here.
    factor: &'a SparseCholesky,
    places: Option<&'a [u32]>,
    diagonal: Vec<f64>,
    /// Square roots of the diagonal of the Hessian's inverse: how far a unit gradient there can move the weights in the
    /// energy norm.
    reach: Vec<f64>,
}

/// One exchange's outcome.
pub(crate) struct Exchanged {
    /// Energy that the descent still had to gain.
    pub(crate) gained: f64,
    /// The minimum clamped to the bounds, if it may be good enough or was asked for.
    pub(crate) candidate: Option<Candidate>,
}

impl<'a> ActiveSet<'a> {
    /// Of all unknowns.
    pub(crate) fn new(energy: &'a BiharmonicEnergy) -> Self {
        let reach = inverse_diagonal(&energy.factor).into_iter().map(f64::sqrt).collect();
        let diagonal = energy.hessian.diagonal();
        Self { hessian: &energy.hessian, factor: &energy.factor, places: None, diagonal, reach }
    }

    /// Of those near a handle; all others are zero.
    pub(crate) fn near(&self, neighbourhood: &'a Neighbourhood) -> Self {
        let here = |of_all: &[f64]| neighbourhood.places.iter().map(|&k| of_all[k as usize]).collect();
        Self {
            hessian: &neighbourhood.hessian,
            factor: self.factor,
            places: Some(&neighbourhood.places),
            diagonal: here(&self.diagonal),
            reach: here(&self.reach),
        }
    }

    /// Largest entry of the diagonal of the Hessian's inverse.
    pub(crate) fn largest_inverse(&self) -> f64 {
        self.reach.iter().map(|reach| reach * reach).fold(0.0, f64::max)
    }

    /// A descent from guessed weights, with held ones set to their bounds.
    pub(crate) fn start(&self, right: &[f64], mut weights: Vec<f64>, held: &[Held]) -> FreeDescent<'a> {
        for (weight, held) in weights.iter_mut().zip(held) {
            *weight = held.bound().unwrap_or(*weight);
        }
        FreeDescent::new(self.hessian, right, weights)
    }

    /// Minimises over the free unknowns, then holds some of them and releases some held ones; `allowed` is the duality
    /// gap wanted.
    pub(crate) fn exchange(
        &self,
        right: &[f64],
        descent: &mut FreeDescent<'a>,
        held: &mut [Held],
        allowed: f64,
        certify: bool,
    ) -> Result<Exchanged, CholeskyError> {
        // The certificate measures the rest with the whole inverse, which can amplify it a thousandfold.
        let gained = descent.minimise(held, 1e-6 * allowed)?;
        let wrong = self.wrong(&descent.gradient, held);
        let near = gained <= NEAR * allowed;
        // In the end only dust is left beyond the bounds, and it has to go.
        for (k, side) in self.beyond(&descent.weights, held, if near { 0.0 } else { DEEP }) {
            held[k] = side;
            descent.put(k, side.bound().unwrap_or_default());
        }
        let candidate = if certify || near { Some(self.bounded(right, descent)) } else { None };
        let spare = (ALLOWED_SHARE * allowed.sqrt()).max(SHARE * gained.sqrt()) * std::f64::consts::SQRT_2;
        let mut left_alone = 0.0;
        for (change, k) in wrong {
            left_alone += change;
            if left_alone > spare {
                held[k] = Held::Free;
            }
        }
        Ok(Exchanged { gained, candidate })
    }

    /// Held unknowns with a wrong-signed multiplier, each with how far it can move the weights in the energy norm (by
    /// the triangle inequality these add up); smallest first.
    fn wrong(&self, gradient: &[f64], held: &[Held]) -> Vec<(f64, usize)> {
        let mut wrong = Vec::new();
        for (k, (&slope, side)) in gradient.iter().zip(held).enumerate() {
            if (*side == Held::Lower && slope < 0.0) || (*side == Held::Upper && slope > 0.0) {
                wrong.push((slope.abs() * self.reach[k], k));
            }
        }
        wrong.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        wrong
    }

    /// Free unknowns beyond a bound by at least this fraction of their worst neighbour's violation, and which bound.
    fn beyond(&self, weights: &[f64], held: &[Held], fraction: f64) -> Vec<(usize, Held)> {
        let mut beyond = Vec::new();
        for (k, &weight) in weights.iter().enumerate() {
            if held[k] != Held::Free {
                continue;
            }
            let neighbours = || self.hessian.column(k).map(|(row, _)| weights[row]);
            if weight < 0.0 && weight <= fraction * neighbours().fold(0.0, f64::min) {
                beyond.push((k, Held::Lower));
            } else if weight > 1.0 && weight - 1.0 >= fraction * (neighbours().fold(1.0, f64::max) - 1.0) {
                beyond.push((k, Held::Upper));
            }
        }
        beyond
    }

    /// The descent's weights, clamped to the bounds.
    fn bounded(&self, right: &[f64], descent: &FreeDescent<'_>) -> Candidate {
        // Measured anew, without the rounding errors of many updates.
        self.measure(right, descent.weights.iter().map(|weight| weight.clamp(0.0, 1.0)).collect()).0
    }

    /// Weights within the bounds with their certificate, and `½ wᵀ A w - bᵀ w`.
    pub(crate) fn measure(&self, right: &[f64], weights: Vec<f64>) -> (Candidate, f64) {
        let mut gradient = vec![0.0; weights.len()];
        self.hessian.multiply_into(&weights, &mut gradient);
        gradient.iter_mut().zip(right).for_each(|(g, b)| *g -= b);
        let terms = weights.iter().zip(&gradient).zip(right);
        let energy = 0.5 * terms.map(|((weight, slope), right)| (slope - right) * weight).sum::<f64>();
        (self.certify(weights, gradient), energy)
    }

    /// How far weights within the bounds are from the optimum.
    ///
    /// Let `g = A w - b`. Multipliers `λ = g` where `w` is at a bound and `g` points out of the range, zero elsewhere,
    /// leave a residual `r = g - λ`, and the dual energy at `λ` is lower than that of `w` by `½ rᵀ A⁻¹ r`.
    fn certify(&self, weights: Vec<f64>, mut gradient: Vec<f64>) -> Candidate {
        let (mut wrong_multiplier, mut stationarity) = (0.0_f64, 0.0_f64);
        for (k, r) in gradient.iter_mut().enumerate() {
            if weights[k] <= 0.0 {
                *r = r.min(0.0);
                wrong_multiplier = wrong_multiplier.max(-*r / self.diagonal[k]);
            } else if weights[k] >= 1.0 {
                *r = r.max(0.0);
                wrong_multiplier = wrong_multiplier.max(*r / self.diagonal[k]);
            } else {
                stationarity = stationarity.max(r.abs() / self.diagonal[k]);
            }
        }
        let gap = 0.5 * self.inverse_norm_squared(gradient);
        Candidate { weights, certificate: Certificate { gap, wrong_multiplier, stationarity } }
    }

    /// `rᵀ A⁻¹ r` with the whole Hessian, for an `r` that is zero elsewhere.
    fn inverse_norm_squared(&self, mut residual: Vec<f64>) -> f64 {
        let Some(places) = self.places else { return self.factor.inverse_norm_squared(&mut residual) };
        let mut whole = vec![0.0; self.factor.rows()];
        places.iter().zip(residual).for_each(|(&k, value)| whole[k as usize] = value);
        self.factor.inverse_norm_squared(&mut whole)
    }
}
