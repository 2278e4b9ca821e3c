//! The least energy of a function that rises along given edges, by a primal-dual interior point method with predictor and
//! corrector (Mehrotra 1992). The conic form of the paper (thesis 5.7) has an unknown for every row of the energy's root and
//! a factorisation of all of them in every step; here the rises are eliminated, and since their edges have entries in the
//! energy's matrix already, each step factorises a matrix no larger and no denser than that.

use super::error::MonotoneError;
use super::rising_edges::{Ended, Found, RisingEdges, Wanted};
use crate::sparse::cholesky::SparseCholesky;

/// Steps before giving up; fifteen to thirty are usual.
const MOST_STEPS: usize = 80;

/// How far a step goes towards the boundary.
const SHORT_OF: f64 = 0.995;

/// After this many steps in a row that made nothing better, the best is all there is.
const PATIENCE: usize = 12;

/// A corrected step that is shorter than this is blocked: products of slacks and multipliers are too unequal.
const BLOCKED: f64 = 0.2;

/// Most corrections of a solution by what is left of its equation: near the end the matrices are badly conditioned.
const REFINEMENTS: usize = 2;

/// What is left needs no correction if it is this small a fraction of the right-hand side.
const EXACT: f64 = 1e-11;

/// Unknowns, slacks of the rises over the margin, and their multipliers.
struct Point {
    unknowns: Vec<f64>,
    slacks: Vec<f64>,
    multipliers: Vec<f64>,
}

/// A change of each.
struct Step {
    unknowns: Vec<f64>,
    slacks: Vec<f64>,
    multipliers: Vec<f64>,
}

/// What is missed: stationarity, and rises that are margin plus slack.
struct Missed {
    dual: Vec<f64>,
    primal: Vec<f64>,
}

impl RisingEdges<'_> {
    /// Steps from `start` (n) until the certificate is as wanted, the limit is reached, or nothing is gained any more.
    /// `None` if `go_on` said so.
    pub(crate) fn solve_primal_dual(
        &self,
        start: &[f64],
        wanted: &Wanted,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Option<Ended>, MonotoneError> {
        let decided = self.decided();
        let mut point = self.first_point(start, &decided);
        let mut best = self.certify(&point.unknowns, &vec![0.0; decided.len()]);
        let ended = |found: Found, steps: usize, converged| Ended { found, steps, factorisations: steps, converged };
        if !decided.iter().any(|decided| *decided) {
            return Ok(Some(ended(best, 0, true)));
        }
        let (mut steps, mut unpaid, mut least) = (0, 0, f64::INFINITY);
        while steps < MOST_STEPS.min(wanted.most_steps) && unpaid < PATIENCE {
            if !go_on() {
                return Ok(None);
            }
            let missed = self.missed(&point, &decided);
            // Rounding of a barely definite matrix ends the steps, not the computation.
            let Ok(factor) = self.barrier_factor(&point, &decided) else { break };
            let complementarity = mean_product(&point, &decided);
            let predicted = self.newton_step(&factor, &point, &missed, &decided, |_, product| product)?;
            let (primal, dual) =
                (room(&point.slacks, &predicted.slacks), room(&point.multipliers, &predicted.multipliers));
            let after = mean_product(&advanced(&point, &predicted, primal, dual), &decided);
            let target = (after / complementarity).powi(3) * complementarity;
            let corrected = self.newton_step(&factor, &point, &missed, &decided, |k, product| {
                product + predicted.slacks[k] * predicted.multipliers[k] - target
            })?;
            // A quadratic energy couples both: steps of one length keep what stationarity has gained.
            let mut length = length_of(&point, &corrected);
            let mut taken = corrected;
            if length < BLOCKED {
                // Towards equal products first, then on.
                let centred =
                    self.newton_step(&factor, &point, &missed, &decided, |_, product| product - complementarity)?;
                let longer = length_of(&point, &centred);
                if longer > length {
                    (length, taken) = (longer, centred);
                }
            }
            point = advanced(&point, &taken, length, length);
            steps += 1;
            if !point.unknowns.iter().chain(&point.multipliers).all(|value| value.is_finite()) {
                break;
            }
            let found = self.certify(&point.unknowns, &point.multipliers);
            let measure = mean_product(&point, &decided) + found.gap;
            unpaid = if measure < 0.9 * least { 0 } else { unpaid + 1 };
            least = least.min(measure);
            if found.gap < best.gap {
                best = found;
            }
            if best.gap <= self.allowed(best.energy, wanted) {
                return Ok(Some(ended(best, steps, true)));
            }
        }
        Ok(Some(ended(best, steps, false)))
    }

    /// Edges with an unknown end; between fixed ones there is nothing to decide.
    fn decided(&self) -> Vec<bool> {
        let is_fixed = |vertex: u32| self.energy.place[vertex as usize] == super::energy::NONE;
        self.edges.edges.iter().map(|&[low, high]| !is_fixed(low) || !is_fixed(high)).collect()
    }

    /// The start, with slacks no smaller than the rises are on average, and multipliers that share out the energy.
    fn first_point(&self, start: &[f64], decided: &[bool]) -> Point {
        let unknowns = self.energy.at_unknowns(start);
        let rises = self.rises(&unknowns);
        let count = decided.iter().filter(|decided| **decided).count().max(1) as f64;
        let mean = rises.iter().zip(decided).filter(|(_, d)| **d).map(|(rise, _)| rise.abs()).sum::<f64>() / count;
        let least = mean.max(self.edges.margin).max(f64::MIN_POSITIVE);
        let slacks: Vec<f64> = rises.iter().map(|rise| (rise - self.edges.margin).max(least)).collect();
        let share = self.energy.of(start).abs().max(f64::MIN_POSITIVE) / count;
        let of_edge = |(slack, decided): (&f64, &bool)| if *decided { share / slack } else { 0.0 };
        let multipliers = slacks.iter().zip(decided).map(of_edge).collect();
        Point { unknowns, slacks, multipliers }
    }

    fn missed(&self, point: &Point, decided: &[bool]) -> Missed {
        let mut dual = vec![0.0; point.unknowns.len()];
        self.energy.hessian.multiply_into(&point.unknowns, &mut dual);
        dual.iter_mut().zip(self.right).for_each(|(r, b)| *r -= b);
        self.add_transposed(&mut dual, |k| -point.multipliers[k]);
        let rises = self.rises(&point.unknowns);
        let of_edge = |k: usize| if decided[k] { rises[k] - self.edges.margin - point.slacks[k] } else { 0.0 };
        Missed { dual, primal: (0..rises.len()).map(of_edge).collect() }
    }

    /// `A + Dᵀ diag(multiplier / slack) D`, factorised.
    fn barrier_factor(&self, point: &Point, decided: &[bool]) -> Result<SparseCholesky, MonotoneError> {
        self.factor(|k| if decided[k] { point.multipliers[k] / point.slacks[k] } else { 0.0 })
    }

    /// The Newton step for `slack · multiplier` less what `towards` says it should lose, given its place and value.
    fn newton_step(
        &self,
        factor: &SparseCholesky,
        point: &Point,
        missed: &Missed,
        decided: &[bool],
        towards: impl Fn(usize, f64) -> f64,
    ) -> Result<Step, MonotoneError> {
        let failed = |reason| MonotoneError::Factorisation { order: self.order, reason };
        let loss: Vec<f64> = (0..decided.len())
            .map(|k| if decided[k] { towards(k, point.slacks[k] * point.multipliers[k]) } else { 0.0 })
            .collect();
        let weight = |k: usize| if decided[k] { point.multipliers[k] / point.slacks[k] } else { 0.0 };
        let mut right: Vec<f64> = missed.dual.iter().map(|r| -r).collect();
        self.add_transposed(&mut right, |k| {
            if decided[k] { -(loss[k] + point.multipliers[k] * missed.primal[k]) / point.slacks[k] } else { 0.0 }
        });
        let mut unknowns = right.clone();
        factor.solve_here(&mut unknowns).map_err(failed)?;
        for _ in 0..REFINEMENTS {
            let mut left = vec![0.0; right.len()];
            self.energy.hessian.multiply_into(&unknowns, &mut left);
            let rises = self.changes(&unknowns);
            self.add_transposed(&mut left, |k| weight(k) * rises[k]);
            left.iter_mut().zip(&right).for_each(|(left, right)| *left = right - *left);
            let largest = |values: &[f64]| values.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            if largest(&left) <= EXACT * largest(&right) {
                break;
            }
            factor.solve_here(&mut left).map_err(failed)?;
            unknowns.iter_mut().zip(left).for_each(|(x, change)| *x += change);
        }
        let rises = self.changes(&unknowns);
        let of_edge = |k: usize| if decided[k] { rises[k] + missed.primal[k] } else { 0.0 };
        let slacks: Vec<f64> = (0..decided.len()).map(of_edge).collect();
        let of_edge = |k: usize| {
            if decided[k] { -(loss[k] + point.multipliers[k] * slacks[k]) / point.slacks[k] } else { 0.0 }
        };
        let multipliers = (0..decided.len()).map(of_edge).collect();
        Ok(Step { unknowns, slacks, multipliers })
    }
}

fn advanced(point: &Point, step: &Step, primal: f64, dual: f64) -> Point {
    let moved = |at: &[f64], by: &[f64], length: f64| at.iter().zip(by).map(|(at, by)| at + length * by).collect();
    Point {
        unknowns: moved(&point.unknowns, &step.unknowns, primal),
        slacks: moved(&point.slacks, &step.slacks, primal),
        multipliers: moved(&point.multipliers, &step.multipliers, dual),
    }
}

/// How far a step goes, at most one: short of where a slack or a multiplier becomes zero.
fn length_of(point: &Point, step: &Step) -> f64 {
    (SHORT_OF * room(&point.slacks, &step.slacks).min(room(&point.multipliers, &step.multipliers))).min(1.0)
}

/// The longest step, at most one, with which nothing becomes negative.
fn room(at: &[f64], by: &[f64]) -> f64 {
    at.iter().zip(by).filter(|(_, by)| **by < 0.0).map(|(at, by)| -at / by).fold(1.0, f64::min)
}

fn mean_product(point: &Point, decided: &[bool]) -> f64 {
    let count = decided.iter().filter(|decided| **decided).count().max(1);
    let products = point.slacks.iter().zip(&point.multipliers).zip(decided).filter(|(_, decided)| **decided);
    products.map(|((slack, multiplier), _)| slack * multiplier).sum::<f64>() / count as f64
}
