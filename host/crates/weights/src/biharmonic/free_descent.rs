//! The minimum of the energy over one handle's free unknowns, found again and again while the set of free unknowns
//! changes by a few at a time.
//!
//! Factorising the free unknowns' part of the Hessian costs as much as a dozen solves with the factor, so an old factor
//! is reused for as long as possible: conjugate gradients, preconditioned by the old factor and by a small one of the
//! unknowns released since (symmetric block Gauss-Seidel). Unknowns next to the old set change the spectrum only by a
//! bounded factor, so a few iterations are enough.

use super::held::Held;
use crate::sparse::cholesky::{CholeskyError, SparseCholesky};
use crate::sparse::symmetric::Symmetric;

/// A solve that needed this many iterations is the last with its factor.
const TIRED: usize = 7;

/// Maximum iterations per solve; the rest is left to the next solve, with a new factor.
const MAX_ITERATIONS: usize = 20;

/// The squared energy norm of the error is reduced to this fraction: the set is about to change anyway.
const ENOUGH: f64 = 0.01;

/// The place of an unknown that is not in the factor.
const NONE: u32 = u32::MAX;

/// One handle's unknowns during the descent.
#[derive(Debug)]
pub(crate) struct FreeDescent<'a> {
    hessian: &'a Symmetric,
    /// All unknowns; held ones are at their bound, free ones may leave the range.
    pub(crate) weights: Vec<f64>,
    /// `A w - b`.
    pub(crate) gradient: Vec<f64>,
    /// Unknowns in the factor, ascending, and where each is among them.
    factored: Vec<u32>,
    place: Vec<u32>,
    factor: Option<SparseCholesky>,
    /// Factorisations made.
    pub(crate) factorisations: usize,
    /// Conjugate gradient iterations made.
    pub(crate) iterations: usize,
}

/// Unknowns that are free now.
struct Free {
    all: Vec<u32>,
    /// Those missing from the factor, and a factor of their own part of the Hessian.
    late: Vec<u32>,
    late_factor: Option<SparseCholesky>,
}

impl<'a> FreeDescent<'a> {
    /// Starts at `weights`.
    pub(crate) fn new(hessian: &'a Symmetric, right: &[f64], weights: Vec<f64>) -> Self {
        let mut gradient = vec![0.0; weights.len()];
        hessian.multiply_into(&weights, &mut gradient);
        gradient.iter_mut().zip(right).for_each(|(g, b)| *g -= b);
        let place = vec![NONE; weights.len()];
        Self { hessian, weights, gradient, factored: Vec::new(), place, factor: None, factorisations: 0, iterations: 0 }
    }

    /// Restarts from other weights; the counters keep counting.
    pub(crate) fn restart(self, start: Self) -> Self {
        Self { factorisations: self.factorisations, iterations: self.iterations, ..start }
    }

    /// `½ wᵀ A w - bᵀ w`.
    pub(crate) fn energy(&self, right: &[f64]) -> f64 {
        let terms = self.weights.iter().zip(&self.gradient).zip(right);
        0.5 * terms.map(|((weight, slope), right)| (slope - right) * weight).sum::<f64>()
    }

    /// Moves one unknown and updates the gradient.
    pub(crate) fn put(&mut self, k: usize, weight: f64) {
        let change = weight - self.weights[k];
        if change != 0.0 {
            self.weights[k] = weight;
            self.hessian.column(k).for_each(|(row, value)| self.gradient[row] += value * change);
        }
    }

    /// Moves the free unknowns to the minimum, or most of the way; `negligible` is an energy not worth gaining. Returns
    /// the energy there was to gain, as far as an old factor can tell.
    pub(crate) fn minimise(&mut self, held: &[Held], negligible: f64) -> Result<f64, CholeskyError> {
        let fresh = self.factor.is_none();
        if fresh {
            self.factorise(held)?;
        }
        let free = self.free(held)?;
        let n = self.weights.len();
        let mut step = vec![0.0; n];
        self.precondition(held, &free, &mut step)?;
        let mut direction = step.clone();
        let mut image = vec![0.0; n];
        let mut product = -dot(&free.all, &self.gradient, &step);
        let first = product;
        let goal = (ENOUGH * first).max(2.0 * negligible);
        let mut iterations = 0;
        while product > goal && iterations < MAX_ITERATIONS {
            iterations += 1;
            self.hessian.multiply_columns(&free.all, &direction, &mut image);
            let length = product / dot(&free.all, &direction, &image);
            free.all.iter().for_each(|&k| self.weights[k as usize] += length * direction[k as usize]);
            self.gradient.iter_mut().zip(&image).for_each(|(g, i)| *g += length * i);
            if fresh {
                // The factor was exact.
                break;
            }
            self.precondition(held, &free, &mut step)?;
            let next = -dot(&free.all, &self.gradient, &step);
            let kept = next / product;
            free.all.iter().for_each(|&k| {
                let k = k as usize;
                direction[k] = step[k] + kept * direction[k];
            });
            product = next;
        }
        self.iterations += iterations;
        if iterations >= TIRED {
            self.factor = None;
        }
        Ok(0.5 * first)
    }

    fn factorise(&mut self, held: &[Held]) -> Result<(), CholeskyError> {
        self.factored.iter().for_each(|&k| self.place[k as usize] = NONE);
        self.factored = (0..held.len() as u32).filter(|&k| held[k as usize] == Held::Free).collect();
        self.factored.iter().enumerate().for_each(|(at, &k)| self.place[k as usize] = at as u32);
        self.factor = Some(self.hessian.factorise_kept(|k| held[k] == Held::Free)?);
        self.factorisations += 1;
        Ok(())
    }

    fn free(&self, held: &[Held]) -> Result<Free, CholeskyError> {
        let all: Vec<u32> = (0..held.len() as u32).filter(|&k| held[k as usize] == Held::Free).collect();
        let is_late = |k: usize| held[k] == Held::Free && self.place[k] == NONE;
        let late: Vec<u32> = all.iter().copied().filter(|&k| is_late(k as usize)).collect();
        let late_factor = if late.is_empty() { None } else { Some(self.hessian.factorise_kept(is_late)?) };
        Ok(Free { all, late, late_factor })
    }

    /// `step = B (-gradient)` over the free unknowns, with `B` close to the inverse of their part of the Hessian.
    fn precondition(&self, held: &[Held], free: &Free, step: &mut [f64]) -> Result<(), CholeskyError> {
        let Some(factor) = &self.factor else { return Ok(()) };
        let solve_late = |late: &mut [f64]| free.late_factor.as_ref().map_or(Ok(()), |factor| factor.solve_here(late));
        let slope = |k: &u32| -self.gradient[*k as usize];
        let mut late: Vec<f64> = free.late.iter().map(slope).collect();
        solve_late(&mut late)?;
        let is_free = |k: usize| held[k] == Held::Free;
        let mut early: Vec<f64> =
            self.factored.iter().map(|k| if is_free(*k as usize) { slope(k) } else { 0.0 }).collect();
        for (&k, &value) in free.late.iter().zip(&late) {
            for (row, entry) in self.hessian.column(k as usize) {
                if self.place[row] != NONE && is_free(row) {
                    early[self.place[row] as usize] -= entry * value;
                }
            }
        }
        factor.solve_here(&mut early)?;
        step.fill(0.0);
        for (&k, &value) in self.factored.iter().zip(&early) {
            if is_free(k as usize) {
                step[k as usize] = value;
            }
        }
        let pull = |k: &u32| self.hessian.column(*k as usize).map(|(row, entry)| entry * step[row]).sum();
        let mut again: Vec<f64> = free.late.iter().map(pull).collect();
        solve_late(&mut again)?;
        for ((&k, first), second) in free.late.iter().zip(&late).zip(&again) {
            step[k as usize] = first - second;
        }
        Ok(())
    }
}

fn dot(places: &[u32], a: &[f64], b: &[f64]) -> f64 {
    places.iter().map(|&k| a[k as usize] * b[k as usize]).sum()
}
