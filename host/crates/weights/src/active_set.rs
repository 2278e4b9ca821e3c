//! The primal-dual active set method (Hintermüller, Ito & Kunisch 2003; thesis 2.2.3) for one handle, with a
//! certificate of optimality after every step.

use crate::CholeskyError;
use crate::alternating_directions::Held;
use crate::biharmonic_energy::BiharmonicEnergy;

/// What is known about how far weights are from the optimum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Certificate {
    /// Energy of the weights minus that of a feasible dual point: no weights have less energy by more than this.
    pub(crate) gap: f64,
    /// Largest wrong-signed multiplier at a bound over the Hessian's diagonal.
    pub(crate) wrong_multiplier: f64,
    /// Largest gradient between the bounds over the Hessian's diagonal.
    pub(crate) stationarity: f64,
}

impl Certificate {
    /// Before the first look.
    pub(crate) const NOTHING_KNOWN: Self =
        Self { gap: f64::INFINITY, wrong_multiplier: f64::INFINITY, stationarity: f64::INFINITY };
}

/// Weights within the bounds, and how good they are.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    pub(crate) weights: Vec<f64>,
    pub(crate) certificate: Certificate,
}

/// What all handles share.
pub(crate) struct ActiveSet<'a> {
    energy: &'a BiharmonicEnergy,
    diagonal: Vec<f64>,
}

impl<'a> ActiveSet<'a> {
    pub(crate) fn new(energy: &'a BiharmonicEnergy) -> Self {
        Self { energy, diagonal: energy.hessian.diagonal() }
    }

    /// Minimises with the held weights at their bounds, exchanges those that violate a bound for those whose
    /// multiplier has the wrong sign, and returns the minimum brought within the bounds.
    pub(crate) fn step(&self, right: &[f64], held: &mut [Held]) -> Result<Candidate, CholeskyError> {
        let mut weights = self.minimise_free(right, held)?;
        let gradient = self.gradient(right, &weights);
        for k in 0..held.len() {
            held[k] = match held[k] {
                Held::Free if weights[k] < 0.0 => Held::Lower,
                Held::Free if weights[k] > 1.0 => Held::Upper,
                Held::Lower if gradient[k] < 0.0 => Held::Free,
                Held::Upper if gradient[k] > 0.0 => Held::Free,
                same => same,
            };
        }
        weights.iter_mut().for_each(|w| *w = w.clamp(0.0, 1.0));
        let certificate = self.certify(right, &weights)?;
        Ok(Candidate { weights, certificate })
    }

    /// How far weights within the bounds are from the optimum.
    ///
    /// Let `g = A w - b`. Multipliers `λ = g` where `w` rests at a bound and `g` points out of the range, zero
    /// elsewhere, leave a residual `r = g - λ`, and the dual energy at `λ` falls short of that of `w` by
    /// `½ rᵀ A⁻¹ r`.
    pub(crate) fn certify(&self, right: &[f64], weights: &[f64]) -> Result<Certificate, CholeskyError> {
        let mut residual = self.gradient(right, weights);
        let (mut wrong_multiplier, mut stationarity) = (0.0_f64, 0.0_f64);
        for (k, r) in residual.iter_mut().enumerate() {
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
        let mut correction = residual.clone();
        self.energy.factor.solve_here(&mut correction)?;
        let gap = 0.5 * residual.iter().zip(&correction).map(|(r, c)| r * c).sum::<f64>();
        Ok(Certificate { gap: gap.max(0.0), wrong_multiplier, stationarity })
    }

    /// `½ wᵀ A w - bᵀ w`.
    pub(crate) fn energy(&self, right: &[f64], weights: &[f64]) -> f64 {
        let gradient = self.gradient(right, weights);
        0.5 * (0..weights.len()).map(|k| (gradient[k] - right[k]) * weights[k]).sum::<f64>()
    }

    fn minimise_free(&self, right: &[f64], held: &[Held]) -> Result<Vec<f64>, CholeskyError> {
        let mut weights: Vec<f64> = held.iter().map(|h| if *h == Held::Upper { 1.0 } else { 0.0 }).collect();
        let gradient = self.gradient(right, &weights);
        let free = |k: &usize| held[*k] == Held::Free;
        let mut solution: Vec<f64> = (0..held.len()).filter(free).map(|k| -gradient[k]).collect();
        self.energy.hessian.factorise_kept(|k| held[k] == Held::Free)?.solve_here(&mut solution)?;
        (0..held.len()).filter(free).zip(solution).for_each(|(k, value)| weights[k] = value);
        Ok(weights)
    }

    fn gradient(&self, right: &[f64], weights: &[f64]) -> Vec<f64> {
        let mut gradient = vec![0.0; weights.len()];
        self.energy.hessian.multiply_into(weights, &mut gradient);
        gradient.iter_mut().zip(right).for_each(|(g, b)| *g -= b);
        gradient
    }
}
