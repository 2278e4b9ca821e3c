//! The input of a volume, and its settings.

use super::error::VolumeError;
use crate::TriangleMesh;
use crate::improve::ImproveSettings;
use crate::segmentation::SegmentationSettings;

/// The input of a volume.
#[derive(Clone, Copy, Debug)]
pub struct VolumeInput<'a> {
    /// The surface as it comes: open, self-intersecting, in several pieces.
    pub surface: &'a TriangleMesh,
    /// Bones, head and tail in the mesh's unit: vertices are placed along each, both ends included.
    pub segments: &'a [[[f64; 3]; 2]],
    /// Point handles in the mesh's unit: each becomes a vertex.
    pub points: &'a [[f64; 3]],
}

/// How fine a volume is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resolution {
    /// Every vertex of the surface is a vertex of the volume.
    Conforming,
    /// A coarser volume around a simplified surface, in which each vertex of the surface has its place.
    Embedded {
        /// Approximate number of vertices of the volume.
        vertices: usize,
    },
}

/// Hard constraints on the inside (thesis 8.5.2). Those that cannot be satisfied are counted in the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VolumeConstraints {
    /// Every recovered facet of the shell has an element inside: thin accessories stay.
    pub facets: bool,
    /// The boundary is manifold: no two parts meet only in an edge or a vertex.
    pub manifold: bool,
}

/// How to make a volume.
#[derive(Clone, Debug, PartialEq)]
pub struct VolumeSettings {
    /// How fine it is.
    pub resolution: Resolution,
    /// The spacing just inside, in multiples of the surface's edge lengths; further in, it doubles repeatedly.
    pub grading: f64,
    /// The balance of winding number and coherence.
    pub segmentation: SegmentationSettings,
    /// Additional constraints on the inside.
    pub constraints: VolumeConstraints,
    /// How slivers are removed; `None` to leave them.
    pub improve: Option<ImproveSettings>,
}

impl Default for VolumeSettings {
    /// An embedded volume of 10,000 vertices. A grading of 2 leaves a layer of well-shaped elements under the surface;
    /// half of that gives three times as many interior vertices without better angles.
    fn default() -> Self {
        Self {
            resolution: Resolution::Embedded { vertices: 10_000 },
            grading: 2.0,
            segmentation: SegmentationSettings::default(),
            constraints: VolumeConstraints::default(),
            improve: Some(ImproveSettings::default()),
        }
    }
}

impl VolumeInput<'_> {
    pub(super) fn validate(&self) -> Result<(), VolumeError> {
        self.surface.validate()?;
        let bad = |p: &[f64; 3]| !p.iter().all(|c| c.is_finite());
        if let Some(index) = self.segments.iter().position(|s| s.iter().any(bad)) {
            return Err(VolumeError::NotFinite { what: "bone", index });
        }
        match self.points.iter().position(bad) {
            Some(index) => Err(VolumeError::NotFinite { what: "point", index }),
            None => Ok(()),
        }
    }
}
