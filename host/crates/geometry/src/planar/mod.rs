//! Triangles that fill outlines or flat meshes: the volume of a character in two dimensions (thesis 8.5).

mod assemble;
mod conform;
mod inside;
mod outline;
mod places;
mod plane;
mod samples;
mod triangulate;

use std::ops::ControlFlow;

pub use plane::{FlatMesh, MeshPlane, plane_of};

use crate::MeshError;
use crate::segmentation::{SegmentationError, SegmentationSettings};
use assemble::assemble;
use conform::conform;
use inside::inside;
use outline::outline_of;
use places::Places;
use triangulate::triangulate;

/// What a domain is wanted of. All positions are in one plane and one unit.
#[derive(Clone, Copy, Debug)]
pub struct PlanarInput<'a> {
    /// What is to be filled.
    pub shape: PlanarShape<'a>,
    /// Start and end of every bone; vertices are put along them.
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
    /// Triangles, whichever way they run; edges with one triangle are the outline. They may overlap.
    Mesh {
        /// n×2 positions; all of them become vertices.
        vertices: &'a [[f64; 2]],
        /// m×3 corners.
        triangles: &'a [[u32; 3]],
    },
}

/// Edges of the default size along the diagonal of the box around the outline.
const EDGES_ALONG_DIAGONAL: f64 = 30.0;
/// Larger angles make refinement go on for ever.
const LARGEST_ANGLE: f64 = 33.0;

/// How fine, how well shaped, how coherent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarSettings {
    /// The smallest angle wanted, in radians, except where the outline itself has a smaller one. From 0 to 33°; the
    /// default is 25°, up to which refinement ends well in practice (proven are 20.7°).
    pub smallest_angle: f64,
    /// Triangles are no larger than an equilateral one with this edge, in the input's unit. Without it a thirtieth of
    /// the diagonal of the box around the outline: about ten triangles across a limb, as smooth weights want.
    pub largest_edge: Option<f64>,
    /// Refinement stops at this many vertices, counting those outside.
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

/// Triangles that fill an outline.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarDomain {
    /// n×2 positions, in the input's unit. Those of the input come first.
    pub vertices: Vec<[f64; 2]>,
    /// m×3 corners, counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// The vertices along each bone, from its start to its end; what lies outside the domain is left out.
    pub segment_vertices: Vec<Vec<u32>>,
    /// The vertex of each point handle.
    pub point_vertices: Vec<u32>,
    /// The vertex of each of the input's vertices, which lies where that does; vertices less than
    /// 1e-15 of the size apart may be one. In no triangle if it lies outside.
    pub input_vertices: Vec<u32>,
    /// The mean winding number of each triangle.
    pub winding: Vec<f64>,
    /// How it went.
    pub report: PlanarReport,
}

/// How the filling of an outline went.
#[derive(Clone, Debug, PartialEq)]
pub struct PlanarReport {
    /// Whether all triangles are as small and as well shaped as was asked for.
    pub refinement: Refinement,
    /// The smallest angle of a triangle, in radians.
    pub smallest_angle: f64,
    /// How many triangles have an angle below the one wanted: next to corners of the input that are sharp themselves.
    pub sharp_triangles: usize,
    /// How often segments crossed and were split.
    pub crossings: usize,
    /// Whether the outline ran clockwise altogether and was turned over.
    pub turned_over: bool,
    /// The area of all triangles, in the input's unit squared.
    pub area: f64,
    /// `∫ |w - x|` over the domain and all around it, over `area`, where `x` is 1 inside and 0 outside: 0 for a
    /// sound outline, more for one with gaps and overlaps.
    pub winding_error: f64,
    /// Pieces connected through edges.
    pub pieces: usize,
    /// Pieces that bones run through; more than one if not even bridging could connect them.
    pub pieces_with_bones: usize,
    /// Triangles that were made inside to connect pieces along bones.
    pub bridging_triangles: usize,
    /// Samples along bones that lie outside and were left out.
    pub bone_vertices_outside: usize,
    /// Point handles that lie outside, ascending; their vertices are in no triangle.
    pub points_outside: Vec<u32>,
}

/// How refinement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refinement {
    /// There was nothing left to refine.
    Complete,
    /// The number of vertices reached its limit first; ask for larger triangles or smaller angles.
    LimitReached,
}

/// Why an outline cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanarError {
    /// The outline or mesh itself is unsound.
    #[error("the outline cannot be used: {0}")]
    Shape(MeshError),
    /// A bone's end is NaN, infinite or beyond 1e60.
    #[error("bone {bone} has an end that is not a finite number below 1e60")]
    BoneNotFinite {
        /// Zero-based bone.
        bone: usize,
    },
    /// A point handle is NaN, infinite or beyond 1e60.
    #[error("point handle {point} has a coordinate that is not a finite number below 1e60")]
    PointNotFinite {
        /// Zero-based point handle.
        point: usize,
    },
    /// All vertices at one place.
    #[error("all vertices of the outline lie at one place, or within 1e-60; an area needs three places")]
    NoArea,
    /// A setting out of range.
    #[error("{what} cannot be {value}; see the settings for what it can be")]
    BadSetting {
        /// Which one.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Segments cross so often that splitting them would need too many vertices.
    #[error("segments cross more than {most} times; clean the outline, or allow more vertices")]
    TooManyCrossings {
        /// How often they may.
        most: usize,
    },
    /// Numbers do not tell places apart.
    #[error("the outline has details too fine for its distance from the origin; move it nearer to the origin")]
    Precision,
    /// No triangle has enough winding number.
    #[error("the outline has no inside: it is a line, its pieces cancel, or its gaps are too wide; close it")]
    NothingInside,
    /// The segmentation refused.
    #[error("the triangles cannot be told inside from outside: {0}")]
    Segmentation(SegmentationError),
    /// The progress callback asked to stop.
    #[error("the filling of the outline was cancelled")]
    Cancelled,
}

impl From<SegmentationError> for PlanarError {
    fn from(error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled => Self::Cancelled,
            other => Self::Segmentation(other),
        }
    }
}

/// Fills an outline or flat mesh with triangles: constrained Delaunay triangles of the outline, the input's vertices,
/// samples along bones and point handles; refined to the wanted angle (Ruppert 1995); then those whose winding number,
/// balanced with coherence, says inside (thesis 8.5.1).
///
/// Triangles are fine where the outline is and grow away from it. Segments that cross are split there. If bones run
/// through several pieces, the triangles that they cross between are made inside as well. The same input gives the
/// same domain on any number of threads. `progress` is told the part done, and cancels by [`ControlFlow::Break`].
pub fn planar_domain(
    input: &PlanarInput,
    settings: &PlanarSettings,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<PlanarDomain, PlanarError> {
    check(settings)?;
    let mut report = |done: f64| if progress(done).is_break() { Err(PlanarError::Cancelled) } else { Ok(()) };
    report(0.0)?;
    let outline = outline_of(input)?;
    let largest = match settings.largest_edge {
        Some(edge) => edge * outline.frame.scale(),
        None => diagonal(&outline.vertices) / EDGES_ALONG_DIAGONAL,
    };
    let places = Places::new(input, &outline, largest);
    let segments: Vec<[u32; 2]> = outline.segments.iter().map(|s| s.map(|v| places.of_vertex[v as usize])).collect();
    let segments = conform(&places.unit, &segments);
    report(0.1)?;
    let mesh = triangulate(&places.unit, &segments, largest, settings)?;
    report(0.4)?;
    let inside = inside(&outline, &mesh, &places.of_bone, settings, &mut |done| progress(0.4 + 0.6 * done))?;
    if inside.pieces == 0 {
        return Err(PlanarError::NothingInside);
    }
    assemble(input, settings, &outline, &places, &mesh, &inside)
}

fn check(settings: &PlanarSettings) -> Result<(), PlanarError> {
    if !(0.0..=LARGEST_ANGLE.to_radians()).contains(&settings.smallest_angle) {
        return Err(PlanarError::BadSetting { what: "smallest_angle", value: settings.smallest_angle });
    }
    match settings.largest_edge {
        Some(value) if !(value > 0.0 && value.is_finite()) => {
            Err(PlanarError::BadSetting { what: "largest_edge", value })
        }
        _ => Ok(()),
    }
}

fn diagonal(vertices: &[[f64; 2]]) -> f64 {
    let side = |k: usize| {
        let (low, high) =
            vertices.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (p[k].min(low), p[k].max(high)));
        high - low
    };
    side(0).hypot(side(1))
}
