//! The global step by an inverse that is computed once for a set of constraints.
//!
//! `T_open = Γ Rᵀ + targets_to_open · p − known_to_open · T_known`. Equations are eliminated with an orthonormal basis of
//! what they leave open, rather than with multipliers, so that redundant and contradictory ones do no harm.

use std::borrow::Cow;

use super::given::{Given, Resistance};
use super::reduction::{Reduction, WithZeros};
use crate::dense::{Dense, Elimination, PivotedCholesky, dot, eliminate, pivoted_cholesky};
use crate::lanes::LANES;

/// Fraction of its own stiffness below which a motion counts as undetermined.
const UNDECIDED: f64 = 1e-11;
/// Fraction of the whole shape's stiffness below which a motion's own is rounding.
const ROUNDING: f64 = 1e-13;

/// Matrices for one set of constraints.
#[derive(Clone, Debug, Default)]
pub(super) struct Inverse {
    pub(super) targets_to_open: Dense,
    pub(super) known_to_open: Dense,
    /// open×4m, for shapes that move on their own: what a force on each row of `T` adds.
    pub(super) force_to_open: Option<Dense>,
    /// open×s: what the place of each spring's target adds.
    pub(super) springs_to_open: Dense,
    /// `Γ`, open×3r.
    pub(super) rotations_to_open: Dense,
    /// `K̃ Γ`, block by block: for each of the 3r columns, the three rows of eight clusters.
    pub(super) panels: Vec<[[f32; LANES]; 3]>,
}

impl Inverse {
    /// Adds an equation to those given for each motion that nothing determines.
    pub(super) fn new(
        reduction: &Reduction,
        with_zeros: &WithZeros,
        given: &mut Given,
        resistance: Option<Resistance>,
    ) -> Self {
        let rows = 4 * reduction.handle_count;
        let mut stiffness = Cow::Borrowed(&with_zeros.stiffness);
        if let Some(Resistance(weight)) = resistance {
            let inertia = &with_zeros.closeness.data;
            let viscosity = reduction.viscosity();
            stiffness.to_mut().data.iter_mut().zip(inertia).for_each(|(to, mass)| *to += weight * mass);
            stiffness.to_mut().data.iter_mut().step_by(rows + 1).for_each(|to| *to += viscosity);
        }
        let mut springs = Dense::zeros(given.springs.len(), rows);
        for (number, spring) in given.springs.iter().enumerate() {
            for (handle, values) in &spring.terms {
                springs.row_mut(number)[4 * *handle as usize..][..4].copy_from_slice(values);
            }
        }
        for (number, spring) in given.springs.iter().enumerate() {
            let row = springs.row(number);
            for (i, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
                let to = stiffness.to_mut().row_mut(i);
                to.iter_mut().zip(row).for_each(|(to, c)| *to += spring.strength * factor * c);
            }
        }
        let mut equations = given.equations_with_zeros(reduction.handle_count);
        let mut factored = Factored::new(given, &equations, &stiffness);
        let undecided = factored.factor.null_space().times(&factored.split.open);
        if undecided.rows > 0 {
            given.add_undetermined(undecided.rows);
            hold_at_rest(given, &with_zeros.closeness, &undecided);
            equations = given.equations_with_zeros(reduction.handle_count);
            factored = Factored::new(given, &equations, &stiffness);
        }
        let mut inverse = Self::default();
        inverse.collapse(reduction.cluster_count, &with_zeros.covariance, given, &equations, &stiffness, &factored);
        if resistance.is_some() || !given.springs.is_empty() {
            let answer = answer_to_forces(given, rows, &factored);
            let mut pulls = springs.transpose();
            for row in pulls.data.chunks_exact_mut(given.springs.len().max(1)) {
                row.iter_mut().zip(&given.springs).for_each(|(to, spring)| *to *= spring.strength);
            }
            inverse.springs_to_open = answer.times(&pulls);
            inverse.force_to_open = resistance.map(|_| answer);
        }
        inverse
    }

    fn collapse(
        &mut self,
        cluster_count: usize,
        covariance: &Dense,
        given: &Given,
        equations: &Dense,
        stiffness: &Dense,
        factored: &Factored,
    ) {
        let particular = &factored.split.particular;
        let whitened = &factored.whitened();
        let all_clusters: Vec<usize> = (0..covariance.rows).collect();
        let covariance = covariance.select(&all_clusters, &given.open);
        let half = whitened.times(&covariance.transpose());
        let back = whitened.transpose();
        self.rotations_to_open = back.times(&half);
        let product = half.transpose().times(&half);
        // (1 − Π L) C: the particular solution, relaxed.
        let within = whitened.times(&stiffness.select(&given.open, &given.open));
        let relaxed = back.times(&within.times(particular));
        self.targets_to_open = particular.clone();
        self.targets_to_open.data.iter_mut().zip(&relaxed.data).for_each(|(to, c)| *to -= c);
        let all: Vec<usize> = (0..equations.rows).collect();
        let coupling = whitened.times(&stiffness.select(&given.open, &given.known));
        self.known_to_open = back.times(&coupling);
        let through_equations = self.targets_to_open.times(&equations.select(&all, &given.known));
        self.known_to_open.data.iter_mut().zip(&through_equations.data).for_each(|(to, c)| *to += c);
        self.panels = pack(&product, cluster_count);
    }
}

/// One more equation for each motion that nothing determines: it stays where it is closest to rest.
fn hold_at_rest(given: &mut Given, closeness: &Dense, undecided: &Dense) {
    let all: Vec<usize> = (0..closeness.columns).collect();
    let rows = undecided.times(&closeness.select(&given.open, &all));
    for i in 0..rows.rows {
        let row = rows.row(i);
        let length = dot(row, row).sqrt();
        if length <= 0.0 {
            continue;
        }
        let row: Vec<f64> = row.iter().map(|c| c / length).collect();
        given.leave_at_rest(&row);
    }
}

fn answer_to_forces(given: &Given, rows: usize, factored: &Factored) -> Dense {
    let whitened = factored.whitened();
    let inverse = whitened.transpose().times(&whitened);
    let mut out = Dense::zeros(given.open.len(), rows);
    for (i, to) in out.data.chunks_exact_mut(rows).enumerate() {
        given.open.iter().zip(inverse.row(i)).for_each(|(&row, value)| to[row] = *value);
    }
    out
}

/// One decomposition for a set of constraints.
struct Factored {
    split: Elimination,
    /// Of the stiffness `H` within what the equations leave open.
    factor: PivotedCholesky,
}

impl Factored {
    fn new(given: &Given, equations: &Dense, stiffness: &Dense) -> Self {
        let split = eliminate(&equations.select(&(0..equations.rows).collect::<Vec<_>>(), &given.open));
        let largest = (0..stiffness.rows).fold(0.0_f64, |largest, i| largest.max(stiffness.at(i, i)));
        let within = split.open.times(&stiffness.select(&given.open, &given.open)).times(&split.open.transpose());
        let factor = pivoted_cholesky(&within, UNDECIDED, ROUNDING * largest);
        Self { split, factor }
    }

    /// `H^-½ Z`: its transpose times itself is the inverse `Π` of what the equations leave open.
    fn whitened(&self) -> Dense {
        let columns: Vec<usize> = (0..self.split.open.columns).collect();
        self.factor.solve_lower(&self.split.open.select(&self.factor.order, &columns))
    }
}

fn pack(product: &Dense, cluster_count: usize) -> Vec<[[f32; LANES]; 3]> {
    let mut panels = Vec::with_capacity(cluster_count.div_ceil(LANES) * product.columns);
    for first in (0..cluster_count).step_by(LANES) {
        for column in 0..product.columns {
            panels.push(std::array::from_fn(|axis| {
                std::array::from_fn(|lane| {
                    let cluster = first + lane;
                    if cluster < cluster_count { product.at(3 * cluster + axis, column) as f32 } else { 0.0 }
                })
            }));
        }
    }
    panels
}
