//! The least energy of a function that rises along given edges, by the alternating direction method of multipliers (Boyd
//! et al. 2011) on the rises, with Anderson acceleration: one factorisation, then one solve a step, and a certificate as
//! for bounded weights. The paper's own way (thesis 5.7) solves a new system in every iteration of an interior point
//! method instead.

use super::directed_edges::DirectedEdges;
use super::energy::{MonotoneEnergy, NONE};
use super::error::MonotoneError;
use crate::anderson::Anderson;
use crate::sparse::cholesky::{CholeskyError, SparseCholesky};

/// Over-relaxation.
const RELAXATION: f64 = 1.7;

/// Stiffness of the rises in units of `2 E(f) / Σ rise²` for energies of order two, three and four. Tuned on a bar with
/// a rod across: a third or three times as much cost up to twice the steps.
const STIFFNESS: [f64; 3] = [150.0, 400.0, 1000.0];

/// The stiffness follows the energy found so far if it is off by more than this factor.
const OFF: f64 = 3.0;

/// Steps between certificates.
const ROUND: usize = 20;

/// A certificate that is not below this fraction of the best one has not gained enough ...
const PAYS: f64 = 0.5;

/// ... and after this many of those in a row the best is all there is.
const PATIENCE: usize = 12;

/// Cheap steps hardly ever reach a relative gap below this: a few of them find a start.
const TIGHT: f64 = 1e-6;

/// Steps that the primal-dual method usually takes.
const PRIMAL_DUAL_STEPS: f64 = 15.0;

/// Solving with a factor waits for memory where factorising computes: an operation of the former takes this much longer.
const MEMORY_BOUND: f64 = 8.0;

/// What counts as done: no value farther than `error_bound` from the optimal one, and no energy lower by more than
/// `relative_gap`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wanted {
    pub(crate) error_bound: f64,
    pub(crate) relative_gap: f64,
    pub(crate) most_steps: usize,
}

/// A function that rises along all edges by the margin, and how good it is.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    pub(crate) values: Vec<f64>,
    pub(crate) energy: f64,
    /// No function that rises along these edges has an energy lower by more.
    pub(crate) gap: f64,
    /// Energy that mending the last rounding and inexactness cost.
    pub(crate) repair: f64,
    /// Largest fall along an edge before that.
    pub(crate) violation: f64,
}

/// How the steps ended.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) found: Found,
    pub(crate) steps: usize,
    pub(crate) factorisations: usize,
    pub(crate) converged: bool,
}

/// One function's problem.
pub(crate) struct RisingEdges<'a> {
    pub(crate) energy: &'a MonotoneEnergy,
    pub(crate) edges: &'a DirectedEdges,
    pub(crate) order: usize,
    /// `b`.
    pub(crate) right: &'a [f64],
    /// Fixed values, zero at unknowns.
    pub(crate) fixed: &'a [f64],
}

impl RisingEdges<'_> {
    /// Cheap steps first; where they do not get as far as wanted, those of the primal-dual method, from the best found.
    /// `None` if `go_on` said so.
    pub(crate) fn solve(
        &self,
        start: &[f64],
        wanted: &Wanted,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Option<Ended>, MonotoneError> {
        let worthwhile = if wanted.relative_gap < TIGHT { 2 * ROUND } else { self.worthwhile_steps() };
        let most_steps = wanted.most_steps.min(worthwhile);
        let Some(first) = self.solve_alternating(start, &Wanted { most_steps, ..*wanted }, go_on)? else {
            return Ok(None);
        };
        if first.converged {
            return Ok(Some(first));
        }
        let Some(second) = self.solve_primal_dual(&first.found.values, wanted, go_on)? else { return Ok(None) };
        let steps = first.steps + second.steps;
        let factorisations = first.factorisations + second.factorisations;
        let found = if second.found.gap < first.found.gap { second.found } else { first.found };
        Ok(Some(Ended { found, steps, factorisations, converged: second.converged }))
    }

    /// As many steps with one factor as take about the time of the primal-dual method's factorisations: on surfaces, whose
    /// factors are sparse, a few, and in volumes hundreds.
    fn worthwhile_steps(&self) -> usize {
        let (mut work, mut stored) = (0.0, 0.0);
        for block in self.energy.factor.blocks() {
            for column in 0..block.width {
                let height = (block.width - column + block.pattern.len()) as f64;
                work += height * height;
                stored += height;
            }
        }
        let steps = PRIMAL_DUAL_STEPS * work / (MEMORY_BOUND * 4.0 * f64::max(stored, 1.0));
        (steps as usize).max(2 * ROUND)
    }

    /// Steps from `start` (n) until the certificate is as wanted, the limit is reached, or nothing is gained any more.
    /// `None` if `go_on` said so.
    fn solve_alternating(
        &self,
        start: &[f64],
        wanted: &Wanted,
        go_on: &dyn Fn() -> bool,
    ) -> Result<Option<Ended>, MonotoneError> {
        let failed = |reason| MonotoneError::Factorisation { order: self.order, reason };
        let mut unknowns = self.energy.at_unknowns(start);
        let mut best = self.certify(&unknowns, &vec![0.0; self.edges.edges.len()]);
        let ended = |found: Found, steps, factorisations, converged| Ended { found, steps, factorisations, converged };
        if self.edges.edges.is_empty() {
            return Ok(Some(ended(best, 0, 0, true)));
        }
        let mut free = self.right.to_vec();
        self.energy.factor.solve_here(&mut free).map_err(failed)?;
        let mut stiffness = self.stiffness(&free).max(f64::MIN_POSITIVE);
        let mut factor = self.factor(|_| stiffness)?;
        let mut points = self.rises(&unknowns);
        let mut memory = Anderson::new();
        let (mut steps, mut factorisations, mut unpaid) = (0, 1, 0);
        while steps < wanted.most_steps && unpaid < PATIENCE {
            for _ in 0..ROUND {
                unknowns = self.step(&factor, stiffness, &mut points, &mut memory).map_err(failed)?;
            }
            steps += ROUND;
            if !go_on() {
                return Ok(None);
            }
            let multipliers: Vec<f64> =
                points.iter().map(|point| stiffness * (self.edges.margin - point).max(0.0)).collect();
            let found = self.certify(&unknowns, &multipliers);
            unpaid = if found.gap < PAYS * best.gap { 0 } else { unpaid + 1 };
            if found.gap < best.gap {
                best = found;
            }
            if best.gap <= self.allowed(best.energy, wanted) {
                return Ok(Some(ended(best, steps, factorisations, true)));
            }
            let better = self.stiffness(&unknowns);
            if better.is_normal() && !(stiffness / OFF..stiffness * OFF).contains(&better) {
                // Multipliers stay what they are.
                let margin = self.edges.margin;
                let scaled = stiffness / better;
                points.iter_mut().filter(|point| **point < margin).for_each(|p| *p = margin + scaled * (*p - margin));
                stiffness = better;
                factor = self.factor(|_| stiffness)?;
                factorisations += 1;
                memory = Anderson::new();
            }
        }
        Ok(Some(ended(best, steps, factorisations, false)))
    }

    /// The gap that is small enough.
    pub(crate) fn allowed(&self, energy: f64, wanted: &Wanted) -> f64 {
        let Wanted { error_bound, relative_gap, .. } = wanted;
        (0.5 * error_bound * error_bound / self.energy.largest_inverse).min(relative_gap * energy.abs())
    }

    /// One step: `points` are rises less scaled multipliers. Returns the unknowns of this step.
    fn step(
        &self,
        factor: &SparseCholesky,
        stiffness: f64,
        points: &mut [f64],
        memory: &mut Anderson,
    ) -> Result<Vec<f64>, CholeskyError> {
        let margin = self.edges.margin;
        let mut unknowns = self.right.to_vec();
        self.add_transposed(&mut unknowns, |k| {
            let [low, high] = self.edges.edges[k].map(|vertex| vertex as usize);
            stiffness * (2.0 * points[k].max(margin) - points[k] - (self.fixed[high] - self.fixed[low]))
        });
        factor.solve_here(&mut unknowns)?;
        let rises = self.rises(&unknowns);
        let image = points.iter().zip(rises).map(|(p, rise)| p + RELAXATION * (rise - p.max(margin))).collect();
        memory.advance(points, image, &[]);
        Ok(unknowns)
    }

    /// The rise along each edge.
    pub(crate) fn rises(&self, unknowns: &[f64]) -> Vec<f64> {
        let value = |vertex: u32| match self.energy.place[vertex as usize] {
            NONE => self.fixed[vertex as usize],
            place => unknowns[place as usize],
        };
        self.edges.edges.iter().map(|&[low, high]| value(high) - value(low)).collect()
    }

    /// How much each rise changes with the unknowns.
    pub(crate) fn changes(&self, unknowns: &[f64]) -> Vec<f64> {
        let change = |vertex: u32| match self.energy.place[vertex as usize] {
            NONE => 0.0,
            place => unknowns[place as usize],
        };
        self.edges.edges.iter().map(|&[low, high]| change(high) - change(low)).collect()
    }

    /// Adds the unknowns' part of `Dᵀ` times one number for each edge.
    pub(crate) fn add_transposed(&self, sums: &mut [f64], of_edge: impl Fn(usize) -> f64) {
        for (k, &[low, high]) in self.edges.edges.iter().enumerate() {
            let (low_at, high_at) = (self.energy.place[low as usize], self.energy.place[high as usize]);
            let value = of_edge(k);
            if low_at != NONE {
                sums[low_at as usize] -= value;
            }
            if high_at != NONE {
                sums[high_at as usize] += value;
            }
        }
    }

    /// `A + Σ stiffness (rise)²`, factorised.
    pub(crate) fn factor(&self, stiffness: impl Fn(usize) -> f64) -> Result<SparseCholesky, MonotoneError> {
        let upper = &self.energy.upper;
        let mut values = upper.values.clone();
        for (k, &[low, high]) in self.edges.edges.iter().enumerate() {
            let stiffness = stiffness(k);
            let ends = [low, high].map(|vertex| self.energy.place[vertex as usize]);
            // The diagonal comes last in each column.
            let unknowns = ends.into_iter().filter(|place| *place != NONE);
            unknowns.for_each(|place| values[upper.starts[place as usize + 1] - 1] += stiffness);
            if ends.contains(&NONE) {
                continue;
            }
            let [row, column] = [ends[0].min(ends[1]), ends[0].max(ends[1])].map(|place| place as usize);
            let other_mesh = MonotoneError::OtherMesh { a: low as usize, b: high as usize };
            values[upper.place(row, column).ok_or(other_mesh)?] -= stiffness;
        }
        let factor = self.energy.factor.of_same_pattern(&upper.starts, &upper.rows, &values);
        factor.map_err(|reason| MonotoneError::Factorisation { order: self.order, reason })
    }

    /// The stiffness that suits unknowns with this energy.
    fn stiffness(&self, unknowns: &[f64]) -> f64 {
        let mut values = self.fixed.to_vec();
        self.energy.put(unknowns, &mut values);
        let squares: f64 = self.rises(unknowns).iter().map(|rise| rise * rise).sum();
        STIFFNESS[self.order - 2] * 2.0 * self.energy.of(&values) / squares
    }

    /// Mends unknowns and bounds how far the result is from the optimum: for multipliers `λ ≥ 0` of the rises `D f`, no
    /// function has an energy lower than this one's by more than `½ rᵀ A⁻¹ r + λᵀ (D f - margin)`, where
    /// `r = A f - b - Dᵀ λ`.
    pub(crate) fn certify(&self, unknowns: &[f64], multipliers: &[f64]) -> Found {
        let mut before = self.fixed.to_vec();
        self.energy.put(unknowns, &mut before);
        let values = self.edges.repair(&before);
        let mended = self.energy.at_unknowns(&values);
        let mut residual = vec![0.0; mended.len()];
        self.energy.hessian.multiply_into(&mended, &mut residual);
        residual.iter_mut().zip(self.right).for_each(|(r, b)| *r -= b);
        self.add_transposed(&mut residual, |k| -multipliers[k]);
        let mut slack = 0.0;
        for (&[low, high], &multiplier) in self.edges.edges.iter().zip(multipliers) {
            let [low_at, high_at] = [low, high].map(|vertex| self.energy.place[vertex as usize]);
            // Between two fixed vertices there is nothing to decide.
            if low_at != NONE || high_at != NONE {
                let rise = values[high as usize] - values[low as usize];
                slack += multiplier * (rise - self.edges.margin).max(0.0);
            }
        }
        let gap = 0.5 * self.energy.factor.inverse_norm_squared(&mut residual) + slack;
        let energy = self.energy.of(&values);
        let violation = self.rises(unknowns).iter().map(|rise| -rise).fold(0.0, f64::max);
        Found { repair: energy - self.energy.of(&before), values, energy, gap, violation }
    }
}
