//! The steps of the interior point method: unknowns, slacks and multipliers, and the system that moves them.

use armature_geometry::operators::SparseMatrix;

use super::problem::{QuadraticError, QuadraticProblem};
use super::solution::{QuadraticOutcome, QuadraticSolution};
use crate::sparse::cholesky::CholeskyError;
use crate::sparse::quasi_definite::QuasiDefinite;

/// How far a step goes towards the boundary.
const SHORT_OF: f64 = 0.995;

/// A corrected step that is shorter than this is blocked: products of slacks and multipliers are too unequal.
const BLOCKED: f64 = 0.2;

/// Added to the diagonal of Q, whose largest entry is one, and taken from that of the equalities, so that factors exist.
/// The smaller the second is, the faster refinement corrects it, and the more digits are lost where it is a pivot.
const REGULARISATION: [f64; 2] = [1e-15, 1e-3];

/// Most corrections of a solution by what is left of its equation.
const REFINEMENTS: usize = 12;

/// An inequality of this weight plays no part.
const ABSENT: f64 = 1e30;

#[derive(Clone, Debug)]
struct Point {
    x: Vec<f64>,
    y: Vec<f64>,
    slacks: Vec<f64>,
    multipliers: Vec<f64>,
}

/// What is missed: the gradient, equalities, and `A_ie x + s = b_ie`.
struct Missed {
    gradient: Vec<f64>,
    equalities: Vec<f64>,
    inequalities: Vec<f64>,
}

pub(super) struct InteriorSteps<'a> {
    problem: &'a QuadraticProblem,
    /// Lower triangle of `(Q, A_eqᵀ, A_ieᵀ; A_eq, 0, 0; A_ie, 0, -s/λ)`, regularised.
    lower: SparseMatrix,
    signs: Vec<i8>,
    factor: QuasiDefinite,
    point: Point,
    pub(super) taken: usize,
}

impl<'a> InteriorSteps<'a> {
    /// At the least energy under the equalities alone, for a problem whose Q has a largest entry of one.
    pub(super) fn new(problem: &'a QuadraticProblem) -> Result<Self, QuadraticError> {
        let (n, p, q) = (problem.linear.len(), problem.equalities.count(), problem.inequalities.count());
        let mut entries = Vec::with_capacity(problem.quadratic.stored() + n + p + q);
        for column in 0..n {
            let lower = problem.quadratic.column(column).filter(|&(row, _)| row >= column);
            entries.extend(lower.map(|(row, value)| (row as u32, column as u32, value)));
            entries.push((column as u32, column as u32, REGULARISATION[0]));
            let equalities = problem.equalities.matrix.column(column);
            entries.extend(equalities.map(|(row, value)| ((n + row) as u32, column as u32, value)));
            let inequalities = problem.inequalities.matrix.column(column);
            entries.extend(inequalities.map(|(row, value)| ((n + p + row) as u32, column as u32, value)));
        }
        entries.extend((n..n + p).map(|k| (k as u32, k as u32, -REGULARISATION[1])));
        entries.extend((n + p..n + p + q).map(|k| (k as u32, k as u32, -ABSENT)));
        let size = n + p + q;
        let lower = SparseMatrix::from_triplets(size, size, &entries)
            .map_err(|_| QuadraticError::Factorisation(CholeskyError::OutOfMemory { rows: size }))?;
        let signs: Vec<i8> = (0..size).map(|k| if k < n { 1 } else { -1 }).collect();
        let mut factor = QuasiDefinite::analyse(&lower)?;
        factor.factorise(&lower, &signs)?;
        let point = Point { x: vec![0.0; n], y: vec![0.0; p], slacks: vec![ABSENT; q], multipliers: vec![1.0; q] };
        let mut steps = Self { problem, lower, signs, factor, point, taken: 0 };
        let start = Missed {
            gradient: problem.linear.clone(),
            equalities: problem.equalities.bounds.iter().map(|bound| -bound).collect(),
            inequalities: vec![0.0; q],
        };
        let [x, y, _] = steps.solve(&start, &vec![0.0; q])?;
        steps.point = Point { x, y, slacks: vec![0.0; q], multipliers: vec![0.0; q] };
        Ok(steps)
    }

    /// Gives slacks and multipliers that are positive: slacks as large as the inequalities are missed or met on average,
    /// and multipliers that share out the energy.
    pub(super) fn enter_interior(&mut self) {
        let excess = self.problem.inequalities.excess(&self.point.x);
        let count = excess.len().max(1) as f64;
        let mean = (excess.iter().map(|e| e.abs()).sum::<f64>() / count).max(f64::MIN_POSITIVE);
        self.point.slacks = excess.iter().map(|excess| (-excess).max(mean)).collect();
        let energy = self.problem.energy(&self.point.x).abs();
        let share = if energy > 0.0 { energy } else { 1.0 } / count;
        self.point.multipliers = self.point.slacks.iter().map(|slack| share / slack).collect();
    }

    /// One step.
    pub(super) fn take(&mut self) -> Result<(), QuadraticError> {
        let values = self.lower.values_mut();
        // The columns of the inequalities are the last, and hold their diagonal entries only.
        let diagonal = values.len() - self.point.slacks.len();
        let ratios =
            self.point.slacks.iter().zip(&self.point.multipliers).map(|(slack, multiplier)| slack / multiplier);
        for (value, ratio) in values[diagonal..].iter_mut().zip(ratios) {
            *value = -ratio.clamp(1.0 / ABSENT, ABSENT);
        }
        self.factor.factorise(&self.lower, &self.signs)?;
        self.taken += 1;
        let missed = self.missed();
        let products: Vec<f64> = self.point.slacks.iter().zip(&self.point.multipliers).map(|(s, z)| s * z).collect();
        let mean = mean(&products);
        let predicted = self.step(&missed, &products)?;
        let after = advanced(&self.point, &predicted, self.room(&predicted));
        let after: Vec<f64> = after.slacks.iter().zip(&after.multipliers).map(|(s, z)| s * z).collect();
        let target = (self::mean(&after) / mean).powi(3) * mean;
        let second = predicted.slacks.iter().zip(&predicted.multipliers).map(|(s, z)| s * z - target);
        let corrected = self.step(&missed, &products.iter().zip(second).map(|(a, b)| a + b).collect::<Vec<_>>())?;
        let mut length = (SHORT_OF * self.room(&corrected)).min(1.0);
        let mut taken = corrected;
        if length < BLOCKED {
            // Towards equal products first, then on.
            let centred = self.step(&missed, &products.iter().map(|product| product - mean).collect::<Vec<_>>())?;
            let longer = (SHORT_OF * self.room(&centred)).min(1.0);
            if longer > length {
                (length, taken) = (longer, centred);
            }
        }
        self.point = advanced(&self.point, &taken, length);
        Ok(())
    }

    fn missed(&self) -> Missed {
        let Point { x, y, slacks, multipliers } = &self.point;
        let mut gradient = self.problem.quadratic.multiply(x);
        gradient.iter_mut().zip(&self.problem.linear).for_each(|(g, l)| *g += l);
        self.problem.equalities.add_transposed(y, &mut gradient);
        self.problem.inequalities.add_transposed(multipliers, &mut gradient);
        let mut inequalities = self.problem.inequalities.excess(x);
        inequalities.iter_mut().zip(slacks).for_each(|(excess, slack)| *excess += slack);
        Missed { gradient, equalities: self.problem.equalities.excess(x), inequalities }
    }

    /// The Newton step that takes away `loss` of each product of slack and multiplier, and what is missed.
    fn step(&self, missed: &Missed, loss: &[f64]) -> Result<Point, QuadraticError> {
        let [x, y, multipliers] = self.solve(missed, loss)?;
        let change = self.problem.inequalities.matrix.multiply(&x);
        // From `A_ie x + s`, which is exact where the complementarity would divide by a tiny multiplier.
        let slacks = change.iter().zip(&missed.inequalities).map(|(change, missed)| -missed - change).collect();
        Ok(Point { x, y, slacks, multipliers })
    }

    fn solve(&self, missed: &Missed, loss: &[f64]) -> Result<[Vec<f64>; 3], QuadraticError> {
        let (n, p) = (self.point.x.len(), self.point.y.len());
        let of_inequality = missed.inequalities.iter().zip(loss).zip(&self.point.multipliers);
        let right: Vec<f64> = (missed.gradient.iter().chain(&missed.equalities).map(|value| -value))
            .chain(of_inequality.map(|((missed, loss), multiplier)| loss / multiplier - missed))
            .collect();
        let mut solution = vec![0.0; right.len()];
        let mut left = right.clone();
        let mut size = f64::INFINITY;
        for _ in 0..=REFINEMENTS {
            let mut change = left.clone();
            self.factor.solve(&mut change)?;
            let better: Vec<f64> = solution.iter().zip(&change).map(|(a, b)| a + b).collect();
            let product = self.multiply(&better);
            let rest: Vec<f64> = right.iter().zip(product).map(|(right, product)| right - product).collect();
            let now = rest.iter().map(|rest| rest * rest).sum::<f64>();
            // No better than before: rounding is all that is left.
            if !now.is_finite() || now >= size {
                break;
            }
            (solution, left, size) = (better, rest, now);
        }
        let multipliers = solution.split_off(n + p);
        let y = solution.split_off(n);
        Ok([solution, y, multipliers])
    }

    /// The whole matrix, without regularisation, times a vector.
    fn multiply(&self, vector: &[f64]) -> Vec<f64> {
        let (n, p) = (self.point.x.len(), self.point.y.len());
        let (x, rest) = vector.split_at(n);
        let (y, z) = rest.split_at(p);
        let mut product = self.problem.quadratic.multiply(x);
        self.problem.equalities.add_transposed(y, &mut product);
        self.problem.inequalities.add_transposed(z, &mut product);
        product.extend(self.problem.equalities.matrix.multiply(x));
        let inequalities = self.problem.inequalities.matrix.multiply(x);
        let ratios = self.point.slacks.iter().zip(&self.point.multipliers).map(|(s, m)| s / m);
        product.extend(inequalities.iter().zip(ratios).zip(z).map(|((row, ratio), z)| row - ratio * z));
        product
    }

    /// The longest step, at most one, with which no slack or multiplier becomes negative.
    fn room(&self, step: &Point) -> f64 {
        let one = |at: &[f64], by: &[f64]| {
            at.iter().zip(by).filter(|(_, by)| **by < 0.0).map(|(at, by)| -at / by).fold(1.0, f64::min)
        };
        one(&self.point.slacks, &step.slacks).min(one(&self.point.multipliers, &step.multipliers))
    }

    /// The present point and its residuals.
    pub(super) fn solution(&self) -> QuadraticSolution {
        let Point { x, y, multipliers, .. } = &self.point;
        let missed = self.missed();
        let excess = self.problem.inequalities.excess(x);
        let most = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        QuadraticSolution {
            energy: self.problem.energy(x),
            stationarity: most(&missed.gradient),
            equality_residual: most(&missed.equalities),
            violation: excess.iter().copied().fold(0.0, f64::max),
            gap: excess.iter().zip(multipliers).map(|(excess, multiplier)| -excess.min(0.0) * multiplier).sum(),
            steps: self.taken,
            outcome: QuadraticOutcome::LimitReached,
            values: x.clone(),
            equality_multipliers: y.clone(),
            inequality_multipliers: multipliers.clone(),
        }
    }
}

fn advanced(point: &Point, step: &Point, length: f64) -> Point {
    let moved = |at: &[f64], by: &[f64]| at.iter().zip(by).map(|(at, by)| at + length * by).collect();
    Point {
        x: moved(&point.x, &step.x),
        y: moved(&point.y, &step.y),
        slacks: moved(&point.slacks, &step.slacks),
        multipliers: moved(&point.multipliers, &step.multipliers),
    }
}

fn mean(products: &[f64]) -> f64 {
    products.iter().sum::<f64>() / products.len().max(1) as f64
}
