//! Which transformations are known, which equations hold between the others, and the inverse that solves for the rest
//! (thesis eqs. 7.3 and 7.19).

use std::borrow::Cow;

use super::constraint::{Anchor, HandleConstraint};
use super::error::ArapError;
use super::reduction::{Reduction, homogeneous};
use crate::dense::{Dense, Elimination, PivotedCholesky, dot, eliminate, pivoted_cholesky};
use crate::lanes::LANES;

/// Fraction of its own stiffness below which a motion counts as undetermined.
const UNDECIDED: f64 = 1e-11;
/// Fraction of the whole shape's stiffness below which a motion's own is rounding.
const ROUNDING: f64 = 1e-13;

/// Where the right-hand side of an equation comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Source {
    /// The position of a handle's point.
    Handle(usize),
    /// The target of an anchor.
    Anchor(usize),
    /// Zero: two handles agree.
    Joint,
    /// Its value in the rest pose: a motion that nothing determines.
    Rest([f64; 3]),
}

/// How much inertia resists every motion, as a multiple of the mass matrix (one over stiffness times the square of the
/// time step, thesis eq. 7.36).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Resistance(pub(super) f64);

/// The global step for one set of constraints: `T_open = Γ Rᵀ + targets_to_open · p − known_to_open · T_known`.
///
/// Equations are eliminated with an orthonormal basis of what they leave open, rather than with multipliers, so that
/// redundant and contradictory ones do no harm.
#[derive(Clone, Debug, Default)]
pub(super) struct System {
    pub(super) constraints: Vec<HandleConstraint>,
    /// Rows of `T` that are given, and those that are sought.
    pub(super) known: Vec<usize>,
    pub(super) open: Vec<usize>,
    /// c×4m.
    pub(super) equations: Dense,
    pub(super) sources: Vec<Source>,
    pub(super) targets_to_open: Dense,
    pub(super) known_to_open: Dense,
    /// open×4m, for shapes that move on their own: what a force on each row of `T` adds.
    pub(super) force_to_open: Option<Dense>,
    /// `Γ`, open×3r.
    pub(super) rotations_to_open: Dense,
    /// `K̃ Γ`, block by block: for each of the 3r columns, the three rows of eight clusters.
    pub(super) panels: Vec<[[f32; LANES]; 3]>,
    /// Motions that nothing determines, in each coordinate.
    pub(super) undetermined: usize,
}

impl System {
    pub(super) fn new(
        reduction: &Reduction,
        constraints: &[HandleConstraint],
        anchors: &[Anchor],
        resistance: Option<Resistance>,
    ) -> Result<Self, ArapError> {
        check_anchors(anchors, reduction.rows.vertex_count())?;
        let rows = 4 * reduction.handle_count;
        let is_known = |row: usize| match constraints[row / 4] {
            HandleConstraint::Full => true,
            HandleConstraint::Orientation => row % 4 < 3,
            // A flat shape never moves along z.
            HandleConstraint::Position | HandleConstraint::Free => reduction.planar && row % 4 == 2,
        };
        let (known, open): (Vec<usize>, Vec<usize>) = (0..rows).partition(|&row| is_known(row));
        let mut system = Self { constraints: constraints.to_vec(), known, open, ..Self::default() };
        system.gather_equations(reduction, anchors);
        let mut stiffness = Cow::Borrowed(&reduction.stiffness);
        if let Some(Resistance(weight)) = resistance {
            let inertia = &reduction.closeness.data;
            let viscosity = reduction.viscosity();
            stiffness.to_mut().data.iter_mut().zip(inertia).for_each(|(to, mass)| *to += weight * mass);
            stiffness.to_mut().data.iter_mut().step_by(rows + 1).for_each(|to| *to += viscosity);
        }
        let mut factored = system.factor(&stiffness);
        let undecided = factored.factor.null_space().times(&factored.split.open);
        if undecided.rows > 0 {
            system.undetermined = undecided.rows;
            system.hold_at_rest(reduction, &undecided);
            factored = system.factor(&stiffness);
        }
        system.collapse(reduction, &stiffness, &factored);
        if resistance.is_some() {
            system.force_to_open = Some(system.answer_to_forces(rows, &factored));
        }
        Ok(system)
    }

    pub(super) fn equation_count(&self) -> usize {
        self.equations.rows
    }

    fn gather_equations(&mut self, reduction: &Reduction, anchors: &[Anchor]) {
        let rows = 4 * reduction.handle_count;
        self.equations = Dense::zeros(0, rows);
        for (handle, constraint) in self.constraints.iter().enumerate() {
            if *constraint == HandleConstraint::Position {
                let mut row = vec![0.0; rows];
                let point = homogeneous(reduction.normalised(reduction.handle_points[handle]));
                row[4 * handle..4 * handle + 4].copy_from_slice(&point);
                self.equations.push_row(&row);
                self.sources.push(Source::Handle(handle));
            }
        }
        for (number, anchor) in anchors.iter().enumerate() {
            self.equations.push_row(&reduction.anchor_row(anchor));
            self.sources.push(Source::Anchor(number));
        }
        for joint in &reduction.joints {
            let mut row = vec![0.0; rows];
            let point = homogeneous(reduction.normalised(joint.point));
            for (handle, sign) in joint.handles.into_iter().zip([1.0, -1.0]) {
                row[4 * handle..4 * handle + 4].iter_mut().zip(point).for_each(|(to, c)| *to += sign * c);
            }
            self.equations.push_row(&row);
            self.sources.push(Source::Joint);
        }
    }

    fn factor(&self, stiffness: &Dense) -> Factored {
        let split = eliminate(&self.equations.select(&(0..self.equations.rows).collect::<Vec<_>>(), &self.open));
        let largest = (0..stiffness.rows).fold(0.0_f64, |largest, i| largest.max(stiffness.at(i, i)));
        let within = split.open.times(&stiffness.select(&self.open, &self.open)).times(&split.open.transpose());
        let factor = pivoted_cholesky(&within, UNDECIDED, ROUNDING * largest);
        Factored { split, factor }
    }

    /// One more equation for each motion that nothing determines: it stays where it is closest to rest.
    fn hold_at_rest(&mut self, reduction: &Reduction, undecided: &Dense) {
        let all: Vec<usize> = (0..4 * reduction.handle_count).collect();
        let rows = undecided.times(&reduction.closeness.select(&self.open, &all));
        for i in 0..rows.rows {
            let row = rows.row(i);
            let length = dot(row, row).sqrt();
            if length <= 0.0 {
                continue;
            }
            let row: Vec<f64> = row.iter().map(|c| c / length).collect();
            // At rest every handle has the identity.
            let rest = std::array::from_fn(|axis| row.iter().skip(axis).step_by(4).sum());
            self.equations.push_row(&row);
            self.sources.push(Source::Rest(rest));
        }
    }

    fn answer_to_forces(&self, rows: usize, factored: &Factored) -> Dense {
        let whitened = factored.whitened();
        let inverse = whitened.transpose().times(&whitened);
        let mut out = Dense::zeros(self.open.len(), rows);
        for (i, to) in out.data.chunks_exact_mut(rows).enumerate() {
            self.open.iter().zip(inverse.row(i)).for_each(|(&row, value)| to[row] = *value);
        }
        out
    }

    fn collapse(&mut self, reduction: &Reduction, stiffness: &Dense, factored: &Factored) {
        let particular = &factored.split.particular;
        let whitened = &factored.whitened();
        let all_clusters: Vec<usize> = (0..reduction.covariance.rows).collect();
        let covariance = reduction.covariance.select(&all_clusters, &self.open);
        let half = whitened.times(&covariance.transpose());
        let back = whitened.transpose();
        self.rotations_to_open = back.times(&half);
        let product = half.transpose().times(&half);
        // (1 − Π L) C: the particular solution, relaxed.
        let within = whitened.times(&stiffness.select(&self.open, &self.open));
        let relaxed = back.times(&within.times(particular));
        self.targets_to_open = particular.clone();
        self.targets_to_open.data.iter_mut().zip(&relaxed.data).for_each(|(to, c)| *to -= c);
        let all: Vec<usize> = (0..self.equations.rows).collect();
        let coupling = whitened.times(&stiffness.select(&self.open, &self.known));
        self.known_to_open = back.times(&coupling);
        let through_equations = self.targets_to_open.times(&self.equations.select(&all, &self.known));
        self.known_to_open.data.iter_mut().zip(&through_equations.data).for_each(|(to, c)| *to += c);
        self.panels = pack(&product, reduction.cluster_count);
    }
}

/// One decomposition for a set of constraints.
struct Factored {
    split: Elimination,
    /// Of the stiffness `H` within what the equations leave open.
    factor: PivotedCholesky,
}

impl Factored {
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

fn check_anchors(anchors: &[Anchor], vertex_count: usize) -> Result<(), ArapError> {
    for (index, anchor) in anchors.iter().enumerate() {
        if let Some(&vertex) = anchor.vertices.iter().find(|v| **v as usize >= vertex_count) {
            return Err(ArapError::VertexOutOfRange { element: index, vertex, vertex_count });
        }
        if !anchor.barycentric.iter().all(|b| b.abs() <= 1e6) {
            return Err(ArapError::NotFinite { what: "anchor", index });
        }
    }
    Ok(())
}
