//! What is to be filled, and how.

use crate::segmentation::SegmentationSettings;

/// The input of a domain. All positions are in one plane and one unit.
#[derive(Clone, Copy, Debug)]
pub struct PlanarInput<'a> {
    /// The shape to fill.
    pub shape: PlanarShape<'a>,
    /// Start and end of every bone; vertices are placed along them.
    pub bones: &'a [[[f64; 2]; 2]],
    /// Point handles; each becomes a vertex.
    pub points: &'a [[f64; 2]],
}

/// An outline or a flat mesh.
#[derive(Clone, Copy, Debug)]
pub enum PlanarShape<'a> {
    /// Directed segments; closed curves that run counter-clockwise have their inside on the left. They may be open,
    /// cross each other and themselves, and lie on top of each other.
    Outline {
        /// n×2 positions.
        vertices: &'a [[f64; 2]],
        /// m×2 start and end of each segment.
        segments: &'a [[u32; 2]],
    },
    /// Triangles in either orientation; edges with one triangle are the outline. They may overlap.
    Mesh {
        /// n×2 positions; all of them become vertices.
        vertices: &'a [[f64; 2]],
        /// m×3 corners.
        triangles: &'a [[u32; 3]],
    },
}

/// How fine, how well shaped, how coherent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarSettings {
    /// The smallest angle allowed, in radians, except where the outline itself has a smaller one. From 0 to 33°; the
    /// default is 25°, up to which refinement terminates well in practice (20.7° is proven).
    pub smallest_angle: f64,
    /// Triangles are no larger than an equilateral one with this edge, in the input's unit. The default is a thirtieth
    /// of the diagonal of the outline's bounding box: about ten triangles across a limb, enough for smooth weights.
    pub largest_edge: Option<f64>,
    /// Refinement stops at this many vertices, including those outside.
    pub most_vertices: usize,
    /// The balance of winding number and coherence.
    pub cut: SegmentationSettings,
}

impl Default for PlanarSettings {
    fn default() -> Self {
        Self {
            smallest_angle: 25.0_f64.to_radians(),
            largest_edge: None,
            most_vertices: 500_000,
            cut: SegmentationSettings::default(),
        }
    }
}
