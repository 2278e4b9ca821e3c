//! Bounded weights by the alternating direction method of multipliers (Boyd et al. 2011): one factorisation serves every
//! step of every handle. The plain method gets close quickly and then converges slowly; with Anderson acceleration it
//! often reaches the certificate, and otherwise tells nearly all weights that are at a bound.

use super::held::Held;
use crate::anderson::Anderson;
use crate::sparse::cholesky::{CholeskyError, SparseCholesky};
use crate::sparse::symmetric::Symmetric;

/// Over-relaxation; 1.5 to 1.8 is usual, and 1.7 works best on hand.mesh.
const RELAXATION: f64 = 1.7;

/// Guessed weights nearer than this to a bound count as held by it: releasing a wrongly held weight is cheaper than
/// exchanging dust.
const DUST: f64 = 1e-6;

/// `A + ρ M`, factorised.
pub(crate) struct AlternatingDirections<'a> {
    hessian: &'a Symmetric,
    penalty: Vec<f64>,
    factor: SparseCholesky,
}

impl<'a> AlternatingDirections<'a> {
    /// `stiffness` is ρ, in energy per mass.
    pub(crate) fn new(hessian: &'a Symmetric, mass: &[f64], stiffness: f64) -> Result<Self, CholeskyError> {
        let penalty: Vec<f64> = mass.iter().map(|mass| mass * stiffness).collect();
        let factor = hessian.factorise_shifted(&penalty)?;
        Ok(Self { hessian, penalty, factor })
    }

    /// `ρ M` for every unknown.
    pub(crate) fn penalty(&self) -> &[f64] {
        &self.penalty
    }

    /// `(A + ρ M)⁻¹` times whole columns.
    pub(crate) fn solve(&self, columns: &mut [f64]) -> Result<(), CholeskyError> {
        self.factor.solve_here(columns)
    }

    /// Takes `steps` steps from `weights` (whole columns of unknowns, within the bounds) with the right-hand sides
    /// `right`. Leaves the new weights there and returns which bound holds each.
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

    /// Accelerated steps from `weights` with the right-hand sides `right`, as for [`Self::run`].
    pub(crate) fn start<'b>(&'b self, right: &'b [f64], weights: &[f64]) -> Steps<'b> {
        let n = self.hessian.len();
        let mut points = self.multipliers_at(right, weights);
        points.iter_mut().zip(weights).for_each(|(point, weight)| *point += weight);
        let memories = weights.chunks(n).map(|_| Anderson::new()).collect();
        let scale = self.penalty.iter().map(|penalty| penalty.sqrt()).collect();
        Steps { directions: self, right, points, memories, scale }
    }

    /// Scaled multipliers that match weights at a bound: `-(A w - b)/ρm` where that has the right sign.
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

/// Steps being taken for a few handles at once.
pub(crate) struct Steps<'a> {
    directions: &'a AlternatingDirections<'a>,
    right: &'a [f64],
    /// Weights plus scaled multipliers; clamped, they give the weights.
    points: Vec<f64>,
    memories: Vec<Anderson>,
    /// Square roots of the penalty.
    scale: Vec<f64>,
}

impl Steps<'_> {
    /// Takes accelerated steps.
    pub(crate) fn advance(&mut self, steps: usize) -> Result<(), CholeskyError> {
        let AlternatingDirections { hessian, penalty, factor } = self.directions;
        let n = hessian.len();
        let mut solved = vec![0.0; self.points.len()];
        for _ in 0..steps {
            for (k, value) in solved.iter_mut().enumerate() {
                *value = self.right[k] + penalty[k % n] * (2.0 * self.points[k].clamp(0.0, 1.0) - self.points[k]);
            }
            factor.solve_here(&mut solved)?;
            for (memory, (points, solved)) in
                self.memories.iter_mut().zip(self.points.chunks_mut(n).zip(solved.chunks(n)))
            {
                let image = |(point, solved): (&f64, &f64)| point + RELAXATION * (solved - point.clamp(0.0, 1.0));
                let image = points.iter().zip(solved).map(image).collect();
                memory.advance(points, image, &self.scale);
            }
        }
        Ok(())
    }

    /// The weights, column by column.
    pub(crate) fn weights(&self) -> Vec<f64> {
        self.points.iter().map(|point| point.clamp(0.0, 1.0)).collect()
    }

    /// Which bound holds each.
    pub(crate) fn held(&self) -> Vec<Held> {
        let held = |&point: &f64| match point {
            point if point < DUST => Held::Lower,
            point if point > 1.0 - DUST => Held::Upper,
            _ => Held::Free,
        };
        self.points.iter().map(held).collect()
    }
}
