//! Which transformations are known, and which equations hold between the others (thesis eq. 7.3).

use super::constraint::{Anchor, AnchorPoint, HandleConstraint};
use super::error::ArapError;
use super::reduction::{Reduction, homogeneous};
use super::shape::LARGEST;
use super::soft_joints::STRONGEST;
use crate::dense::Dense;

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

/// An equation between handles: four numbers for each that it concerns, ascending, and where its right-hand side comes
/// from.
#[derive(Clone, Debug)]
pub(super) struct Equation {
    pub(super) terms: Vec<(u32, [f64; 4])>,
    pub(super) source: Source,
}

/// A point that is pulled to its target: a soft anchor.
#[derive(Clone, Debug)]
pub(super) struct Spring {
    /// Its number among the anchors.
    pub(super) anchor: usize,
    /// In the normalised energy.
    pub(super) strength: f64,
    /// The row of `M` by which it moves, as in an [`Equation`].
    pub(super) terms: Vec<(u32, [f64; 4])>,
}

/// What is given of a pose, and what is not.
#[derive(Clone, Debug, Default)]
pub(super) struct Given {
    pub(super) constraints: Vec<HandleConstraint>,
    /// Rows of `T` that are given, and those that are sought.
    pub(super) known: Vec<usize>,
    pub(super) open: Vec<usize>,
    pub(super) equations: Vec<Equation>,
    pub(super) springs: Vec<Spring>,
    /// Motions that nothing determines, in each coordinate.
    pub(super) undetermined: usize,
}

impl Given {
    pub(super) fn new(
        reduction: &Reduction,
        constraints: &[HandleConstraint],
        anchors: &[Anchor],
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
        let mut given = Self { constraints: constraints.to_vec(), known, open, ..Self::default() };
        given.gather_equations(reduction, anchors);
        Ok(given)
    }

    /// Takes note of motions that nothing determines, in each coordinate.
    pub(super) fn add_undetermined(&mut self, motions: usize) {
        self.undetermined += motions;
    }

    /// One more equation, numbers for every handle: what it says keeps its value in the rest pose.
    pub(super) fn leave_at_rest(&mut self, row: &[f64]) {
        // At rest every handle has the identity.
        let rest = std::array::from_fn(|axis| row.iter().skip(axis).step_by(4).sum());
        let terms = (0_u32..).zip(row.as_chunks::<4>().0.iter().copied()).collect();
        self.equations.push(Equation { terms, source: Source::Rest(rest) });
    }

    /// c×4m.
    pub(super) fn equations_with_zeros(&self, handles: usize) -> Dense {
        let mut out = Dense::zeros(self.equations.len(), 4 * handles);
        for (row, equation) in self.equations.iter().enumerate() {
            for (handle, values) in &equation.terms {
                out.row_mut(row)[4 * *handle as usize..][..4].copy_from_slice(values);
            }
        }
        out
    }

    fn gather_equations(&mut self, reduction: &Reduction, anchors: &[Anchor]) {
        for (handle, constraint) in self.constraints.iter().enumerate() {
            if *constraint == HandleConstraint::Position {
                let point = homogeneous(reduction.normalised(reduction.handle_points[handle]));
                let terms = vec![(handle as u32, point)];
                self.equations.push(Equation { terms, source: Source::Handle(handle) });
            }
        }
        for (number, anchor) in anchors.iter().enumerate() {
            let terms = reduction.anchor_row(anchor);
            match anchor.strength {
                None => self.equations.push(Equation { terms, source: Source::Anchor(number) }),
                Some(strength) => {
                    let strength = strength * reduction.constant.max(f64::MIN_POSITIVE);
                    self.springs.push(Spring { anchor: number, strength, terms });
                }
            }
        }
        for joint in &reduction.joints {
            let point = homogeneous(reduction.normalised(joint.point));
            let mut terms = vec![(joint.handles[0] as u32, point), (joint.handles[1] as u32, point.map(|c| 0.0 - c))];
            terms.sort_by_key(|(handle, _)| *handle);
            if joint.handles[0] == joint.handles[1] {
                terms = vec![(joint.handles[0] as u32, [0.0; 4])];
            }
            self.equations.push(Equation { terms, source: Source::Joint });
        }
    }
}

impl Given {
    /// What springs add to the energy of stacked transformations.
    pub(super) fn energy_of_springs(&self, transposed: &[Vec<f64>; 3], pulled: &[Vec<f64>; 3]) -> f64 {
        let of = |(number, spring): (usize, &Spring)| {
            let at = value_of(&spring.terms, transposed);
            let miss: f64 = (0..3).map(|axis| (at[axis] - pulled[axis][number]).powi(2)).sum();
            0.5 * spring.strength * miss
        };
        self.springs.iter().enumerate().map(of).sum()
    }
}

/// A row's product with stacked transformations, by axis.
pub(super) fn value_of(terms: &[(u32, [f64; 4])], transposed: &[Vec<f64>; 3]) -> [f64; 3] {
    let mut sums = [0.0; 3];
    for (handle, values) in terms {
        for (sum, column) in sums.iter_mut().zip(transposed) {
            let four = &column[4 * *handle as usize..][..4];
            *sum += values.iter().zip(four).map(|(a, b)| a * b).sum::<f64>();
        }
    }
    sums
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
