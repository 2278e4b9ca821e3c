//! The shape that is posed: its rest positions, elements, weights and handles.

use super::energy::ArapEnergy;
use super::error::ArapError;
use super::weights::ArapWeights;

/// A shape with its handles at rest.
#[derive(Clone, Copy, Debug)]
pub struct ArapShape<'a> {
    /// n×3 rest positions (mesh units); for a volume all its vertices, not only those of its surface.
    pub positions: &'a [[f64; 3]],
    /// Its elements, and which of their edges share a rotation.
    pub energy: ArapEnergy<'a>,
    /// The weights of n vertices on m handles. In each row, those of a character's own handles sum to one; additional ones need not.
    pub weights: ArapWeights<'a>,
    /// m×3: where a handle with a given position is held, a point or a bone's end (mesh units, at rest).
    pub handle_points: &'a [[f64; 3]],
    /// Where two handles stay together, such as bones that meet in a joint.
    pub joints: &'a [SharedJoint],
}

/// A point on which two handles must agree.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedJoint {
    /// The two zero-based handles.
    pub handles: [usize; 2],
    /// Where they meet at rest (mesh units).
    pub point: [f64; 3],
}

/// Beyond this, squares of differences leave the range that `f32` output can tell from infinity.
pub(super) const LARGEST: f64 = 1e30;

impl ArapShape<'_> {
    /// What every later step relies on: lengths, indices, and numbers that can be computed with.
    pub(super) fn validate(&self) -> Result<(), ArapError> {
        let (vertex_count, handle_count) = (self.positions.len(), self.handle_points.len());
        let empty = [
            ("vertices", vertex_count == 0),
            ("elements", self.energy.element_count() == 0),
            ("handles", handle_count == 0),
        ];
        if let Some((what, _)) = empty.into_iter().find(|(_, empty)| *empty) {
            return Err(ArapError::Empty { what });
        }
        self.weights.expect_size(vertex_count, handle_count)?;
        if let Some((element, vertex)) = self.energy.out_of_range(vertex_count) {
            return Err(ArapError::VertexOutOfRange { element, vertex, vertex_count });
        }
        let joint_points: Vec<[f64; 3]> = self.joints.iter().map(|j| j.point).collect();
        for (what, points) in
            [("position", self.positions), ("handle point", self.handle_points), ("joint", &joint_points)]
        {
            if let Some(index) = points.iter().position(|p| !p.iter().all(|c| c.abs() <= LARGEST)) {
                return Err(ArapError::NotFinite { what, index });
            }
        }
        let weights = self.weights.rows(handle_count);
        for vertex in 0..vertex_count {
            let row = weights.of(vertex);
            if !row.iter().all(|(_, w)| w.abs() <= LARGEST) {
                return Err(ArapError::NotFinite { what: "weights of vertex", index: vertex });
            }
            if let Some((handle, _)) = row.last().filter(|(handle, _)| *handle as usize >= handle_count) {
                let handle = *handle as usize;
                return Err(ArapError::WeightOutOfRange { vertex, handle, handle_count });
            }
            if row.is_empty() {
                return Err(ArapError::Unweighted { vertex });
            }
        }
        for (joint, shared) in self.joints.iter().enumerate() {
            if let Some(&handle) = shared.handles.iter().find(|h| **h >= handle_count) {
                return Err(ArapError::HandleOutOfRange { joint, handle, handle_count });
            }
        }
        Ok(())
    }
}
