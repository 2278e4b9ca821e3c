//! What all functions with the same fixed vertices share: the energy of the free vertices and its factor.

use super::error::MonotoneError;
use super::polyharmonic::polyharmonic;
use super::problem::MonotoneProblem;
use crate::sparse::cholesky::{CholeskyError, SparseCholesky};
use crate::sparse::inverse_diagonal::inverse_diagonal;
use crate::sparse::symmetric::{Symmetric, Upper};

/// The place of a vertex that is not an unknown.
pub(crate) const NONE: u32 = u32::MAX;

/// `½ fᵀ A f - bᵀ f + c` over the unknowns, in an elimination order that keeps factors sparse.
#[derive(Debug)]
pub(crate) struct MonotoneEnergy {
    /// n×n: smoothness and data.
    whole: Symmetric,
    /// The data term's part of `b`, n long.
    pull: Vec<f64>,
    /// The data term at zero.
    constant: f64,
    /// Vertex of every unknown, and the unknown of every vertex or [`NONE`].
    pub(crate) unknowns: Vec<u32>,
    pub(crate) place: Vec<u32>,
    /// `A`.
    pub(crate) hessian: Symmetric,
    /// Its upper triangle.
    pub(crate) upper: Upper,
    pub(crate) factor: SparseCholesky,
    /// Largest entry of the diagonal of `A⁻¹`.
    pub(crate) largest_inverse: f64,
}

impl MonotoneEnergy {
    /// `is_unknown` is false for fixed vertices and for pieces without any.
    pub(crate) fn new(problem: &MonotoneProblem<'_>, is_unknown: &[bool]) -> Result<Self, MonotoneError> {
        let order = problem.order;
        let failed = |reason: CholeskyError| MonotoneError::Factorisation { order, reason };
        let n = problem.mass.len();
        let mut whole = polyharmonic(problem.laplacian, problem.mass, order, problem.blend);
        let (mut pull, mut constant) = (vec![0.0; n], 0.0);
        if let Some(data) = problem.data {
            let strength = |vertex: usize| data.fidelity * problem.mass[vertex];
            let with_entries = (0..n).filter(|&v| problem.mass[v] > 0.0);
            whole.add(with_entries.map(|v| (v as u32, v as u32, strength(v))));
            for (vertex, &value) in data.values.iter().enumerate() {
                pull[vertex] = strength(vertex) * value;
                constant += 0.5 * strength(vertex) * value * value;
            }
        }
        let free: Vec<u32> = (0..n as u32).filter(|&vertex| is_unknown[vertex as usize]).collect();
        let (natural, _) = whole.at(&free);
        let elimination = natural.elimination_order().map_err(failed)?;
        let unknowns: Vec<u32> = elimination.iter().map(|&k| free[k]).collect();
        let mut place = vec![NONE; n];
        unknowns.iter().enumerate().for_each(|(k, &vertex)| place[vertex as usize] = k as u32);
        let hessian = natural.permuted(&elimination);
        let factor = hessian.factorise_shifted(&[]).map_err(failed)?;
        let largest_inverse = inverse_diagonal(&factor).into_iter().fold(0.0, f64::max);
        let upper = hessian.upper();
        Ok(Self { whole, pull, constant, unknowns, place, hessian, upper, factor, largest_inverse })
    }

    /// `b` for values (n) that are zero at all unknowns.
    pub(crate) fn right_hand_side(&self, fixed: &[f64]) -> Vec<f64> {
        let mut product = vec![0.0; fixed.len()];
        self.whole.multiply_into(fixed, &mut product);
        self.unknowns.iter().map(|&vertex| self.pull[vertex as usize] - product[vertex as usize]).collect()
    }

    /// The energy of a whole function (n).
    pub(crate) fn of(&self, values: &[f64]) -> f64 {
        let mut product = vec![0.0; values.len()];
        self.whole.multiply_into(values, &mut product);
        let terms = values.iter().zip(&product).zip(&self.pull);
        terms.map(|((value, product), pull)| value * (0.5 * product - pull)).sum::<f64>() + self.constant
    }

    /// A function (n) at the unknowns.
    pub(crate) fn at_unknowns(&self, values: &[f64]) -> Vec<f64> {
        self.unknowns.iter().map(|&vertex| values[vertex as usize]).collect()
    }

    /// Puts unknowns into a function (n).
    pub(crate) fn put(&self, unknowns: &[f64], values: &mut [f64]) {
        self.unknowns.iter().zip(unknowns).for_each(|(&vertex, value)| values[vertex as usize] = *value);
    }
}
