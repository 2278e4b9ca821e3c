//! A first guess of bounded weights by the alternating direction method of multipliers (Boyd et al. 2011): one
//! factorisation serves every step of every handle. It closes in quickly and converges slowly, so it only has to say
//! which weights probably lie at a bound.

use crate::biharmonic_energy::Symmetric;
use crate::{CholeskyError, SparseCholesky};

/// Over-relaxation; 1.5 to 1.8 is usual, and hand.mesh likes 1.7 best.
const RELAXATION: f64 = 1.7;

/// Guessed weights nearer than this to a bound count as held by it: letting go what is wrongly held is cheaper than
/// exchanging dust.
const DUST: f64 = 1e-6;

/// Which bound holds an unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Held {
    /// None: it lies between.
    #[default]
    Free,
    /// At zero.
    Lower,
    /// At one.
    Upper,
}

impl Held {
    /// The weight of a held unknown.
    pub(crate) fn bound(self) -> Option<f64> {
        match self {
            Self::Free => None,
            Self::Lower => Some(0.0),
            Self::Upper => Some(1.0),
        }
    }
}

/// `A + ρ M`, factorised.
pub(crate) struct AlternatingDirections<'a> {
    hessian: &'a Symmetric,
    penalty: Vec<f64>,
    factor: SparseCholesky,
}

impl<'a> AlternatingDirections<'a> {
    /// `stiffness` is ρ: energy per mass.
    pub(crate) fn new(hessian: &'a Symmetric, mass: &[f64], stiffness: f64) -> Result<Self, CholeskyError> {
        let penalty: Vec<f64> = mass.iter().map(|mass| mass * stiffness).collect();
        let factor = hessian.factorise_shifted(&penalty)?;
        Ok(Self { hessian, penalty, factor })
    }

    /// `ρ M` of every unknown.
    pub(crate) fn penalty(&self) -> &[f64] {
        &self.penalty
    }

    /// `(A + ρ M)⁻¹` times whole columns.
    pub(crate) fn solve(&self, columns: &mut [f64]) -> Result<(), CholeskyError> {
        self.factor.solve_here(columns)
    }

    /// Takes `steps` steps from `weights` (whole columns of unknowns, within the bounds) with the right-hand sides
    /// `right`; leaves the new weights there and says which bound holds each.
    pub(crate) fn run(&self, right: &[f64], weights: &mut [f64], steps: usize) -> Result<Vec<Held>, CholeskyError> {
        let n = self.hessian.len();
        let mut held = vec![Held::Free; weights.len()];
        let mut multipliers = self.multipliers_at(right, weights);
        let mut relaxed = vec![0.0; weights.len()];
        for _ in 0..steps {
            for (k, value) in relaxed.iter_mut().enumerate() {
                *value = right[k] + self.penalty[k % n] * (weights[k] - multipliers[k]);
            }
            self.factor.solve_here(&mut relaxed)?;
            for k in 0..relaxed.len() {
                let value = RELAXATION * relaxed[k] + (1.0 - RELAXATION) * weights[k] + multipliers[k];
                weights[k] = value.clamp(0.0, 1.0);
                multipliers[k] = value - weights[k];
                held[k] = match value {
                    v if v < DUST => Held::Lower,
                    v if v > 1.0 - DUST => Held::Upper,
                    _ => Held::Free,
                };
            }
        }
        Ok(held)
    }

    /// Scaled multipliers that fit weights at a bound: `-(A w - b)/ρm` where it has the right sign.
    fn multipliers_at(&self, right: &[f64], weights: &[f64]) -> Vec<f64> {
        let n = self.hessian.len();
        let mut multipliers = vec![0.0; weights.len()];
        for (column, w) in weights.chunks(n).enumerate() {
            let range = column * n..(column + 1) * n;
            let gradient = &mut multipliers[range.clone()];
            self.hessian.multiply_into(w, gradient);
            for (k, value) in gradient.iter_mut().enumerate() {
                let slope = *value - right[range.start + k];
                let scaled = -slope / self.penalty[k];
                *value = match w[k] {
                    w if w <= 0.0 => scaled.min(0.0),
                    w if w >= 1.0 => scaled.max(0.0),
                    _ => 0.0,
                };
            }
        }
        multipliers
    }
}
