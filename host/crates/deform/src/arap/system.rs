//! Which transformations are known, which equations hold between the others, and the inverse that solves for the rest
//! (thesis eqs. 7.3 and 7.19).

use std::borrow::Cow;

use super::constraint::{Anchor, AnchorPoint, HandleConstraint};
use super::error::ArapError;
use super::reduction::{Reduction, homogeneous};
use super::shape::LARGEST;
use super::soft_joints::STRONGEST;
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
    /// Soft anchors.
    pub(super) springs: Springs,
    /// `Γ`, open×3r.
    pub(super) rotations_to_open: Dense,
    /// `K̃ Γ`, block by block: for each of the 3r columns, the three rows of eight clusters.
    pub(super) panels: Vec<[[f32; LANES]; 3]>,
    /// Motions that nothing determines, in each coordinate.
    pub(super) undetermined: usize,
}

/// Points that are pulled to their targets, s of them.
#[derive(Clone, Debug, Default)]
pub(super) struct Springs {
    /// Their numbers among the anchors.
    pub(super) anchors: Vec<usize>,
    /// In the normalised energy.
    pub(super) strengths: Vec<f64>,
    /// s×4m: the rows of `M` by which they move.
    pub(super) rows: Dense,
    /// open×s: what the place of each target adds.
    pub(super) to_open: Dense,
}

impl Springs {
    fn new(reduction: &Reduction, anchors: &[Anchor]) -> Self {
        let mut springs = Self { rows: Dense::zeros(0, 4 * reduction.handle_count), ..Self::default() };
        for (number, anchor) in anchors.iter().enumerate() {
            let Some(strength) = anchor.strength else { continue };
            springs.anchors.push(number);
            springs.strengths.push(strength * reduction.constant.max(f64::MIN_POSITIVE));
            springs.rows.push_row(&reduction.anchor_row(anchor));
        }
        springs
    }

    fn stiffen(&self, stiffness: &mut Dense) {
        for (spring, strength) in self.strengths.iter().enumerate() {
            let row = self.rows.row(spring);
            for (i, factor) in row.iter().enumerate().filter(|(_, factor)| **factor != 0.0) {
                let to = stiffness.row_mut(i);
                to.iter_mut().zip(row).for_each(|(to, c)| *to += strength * factor * c);
            }
        }
    }
}

impl System {
    pub(super) fn new(
        reduction: &Reduction,
        constraints: &[HandleConstraint],
        anchors: &[Anchor],
        resistance: Option<Resistance>,
    ) -> Result<Self, ArapError> {
        check_anchors(anchors, reduction)?;
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
        system.springs = Springs::new(reduction, anchors);
        if !system.springs.anchors.is_empty() {
            system.springs.stiffen(stiffness.to_mut());
        }
        let mut factored = system.factor(&stiffness);
        let undecided = factored.factor.null_space().times(&factored.split.open);
        if undecided.rows > 0 {
            system.undetermined = undecided.rows;
            system.hold_at_rest(reduction, &undecided);
            factored = system.factor(&stiffness);
        }
        system.collapse(reduction, &stiffness, &factored);
        if resistance.is_some() || !system.springs.anchors.is_empty() {
            let answer = system.answer_to_forces(rows, &factored);
            let mut pulls = system.springs.rows.transpose();
            for row in pulls.data.chunks_exact_mut(system.springs.anchors.len().max(1)) {
                row.iter_mut().zip(&system.springs.strengths).for_each(|(to, strength)| *to *= strength);
            }
            system.springs.to_open = answer.times(&pulls);
            system.force_to_open = resistance.map(|_| answer);
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
        for (number, anchor) in anchors.iter().enumerate().filter(|(_, anchor)| anchor.strength.is_none()) {
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

fn check_anchors(anchors: &[Anchor], reduction: &Reduction) -> Result<(), ArapError> {
    let (vertex_count, handle_count) = (reduction.rows.vertex_count(), reduction.handle_count);
    for (index, anchor) in anchors.iter().enumerate() {
        let sound = match &anchor.point {
            AnchorPoint::OnShape { vertices, barycentric } => {
                if let Some(&vertex) = vertices.iter().find(|v| **v as usize >= vertex_count) {
                    return Err(ArapError::VertexOutOfRange { element: index, vertex, vertex_count });
                }
                barycentric.iter().all(|b| b.abs() <= 1e6)
            }
            AnchorPoint::OnHandles(parts) => {
                if let Some(&(handle, ..)) = parts.iter().find(|(handle, ..)| *handle >= handle_count) {
                    return Err(ArapError::HandleOutOfRange { joint: index, handle, handle_count });
                }
                parts.iter().all(|(_, weight, at)| weight.abs() <= 1e6 && at.iter().all(|c| c.abs() <= LARGEST))
            }
        };
        let strength = anchor.strength.is_none_or(|strength| (0.0..=STRONGEST).contains(&strength));
        if !sound || !strength {
            return Err(ArapError::NotFinite { what: "anchor", index });
        }
    }
    Ok(())
}
