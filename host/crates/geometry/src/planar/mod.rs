//! Triangles that fill outlines or flat meshes: the two-dimensional volume of a character (thesis 8.5).
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::planar::{PlanarInput, PlanarSettings, PlanarShape, planar_domain};
//!
//! let (vertices, segments) = ([[0., 0.], [2., 0.], [2., 1.], [0., 1.]], [[0, 1], [1, 2], [2, 3], [3, 0]]);
//! let shape = PlanarShape::Outline { vertices: &vertices, segments: &segments };
//! let input = PlanarInput { shape, bones: &[[[0.5, 0.5], [1.5, 0.5]]], points: &[] };
//! let domain = planar_domain(&input, &PlanarSettings::default(), &mut |_stage, _fraction| ControlFlow::Continue(()))?;
//! assert!((domain.report.area - 2.0).abs() < 1e-9 && domain.segment_vertices[0].len() >= 2);
//! # Ok::<(), armature_geometry::planar::PlanarError>(())
//! ```

mod assemble;
mod conform;
mod domain;
mod error;
mod input;
mod inside;
mod outline;
mod places;
mod plane;
mod samples;
mod triangulate;

pub use domain::{PlanarDomain, PlanarReport, Refinement};
pub use error::PlanarError;
pub use input::{PlanarInput, PlanarSettings, PlanarShape};
pub use plane::{FlatMesh, MeshPlane, plane_of};

use crate::progress::{Progress, stage};
use assemble::assemble;
use conform::conform;
use inside::inside;
use outline::outline_of;
use places::Places;
use triangulate::triangulate;

/// With larger angles, refinement may never end.
const LARGEST_ANGLE: f64 = 33.0;
/// Edges of the default size along the diagonal of the outline's bounding box.
const EDGES_ALONG_DIAGONAL: f64 = 30.0;
/// Fills an outline or flat mesh with triangles: constrained Delaunay triangles of the outline, the input's vertices,
/// samples along bones and point handles; refined to the requested angle (Ruppert 1995); of these, the triangles that
/// are inside according to their winding number balanced with coherence (thesis 8.5.1).
///
/// Triangles are fine at the outline and grow away from it. Segments that cross are split there. If bones pass through
/// several pieces, the triangles that they cross in between are made inside as well. The same input gives the same
/// domain on any number of threads. `progress` receives the fraction done; see [`Progress`].
pub fn planar_domain(
    input: &PlanarInput,
    settings: &PlanarSettings,
    progress: Progress<'_>,
) -> Result<PlanarDomain, PlanarError> {
    check(settings)?;
    let mut told = stage(progress, "filling the outline");
    let mut report = |done: f64| if told(done).is_break() { Err(PlanarError::Cancelled) } else { Ok(()) };
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
    let inside = inside(&outline, &mesh, &places.of_bone, settings, &mut |done| told(0.4 + 0.6 * done))?;
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
