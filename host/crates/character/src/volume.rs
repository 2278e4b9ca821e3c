//! The volume that weights are computed on: tetrahedra of a solid, triangles of a flat figure.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_character::volume::{Made, make_volume};
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::volume::{VolumeInput, VolumeSettings};
//!
//! let vertices = (0..8).map(|i| [f64::from(i & 1), f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
//! let sides = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]];
//! let more = [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
//! let cube = TriangleMesh { vertices, triangles: [sides, more].concat() };
//! let input = VolumeInput { surface: &cube, segments: &[], points: &[] };
//! let made = make_volume(&input, &VolumeSettings::default(), &mut |_stage, _done| ControlFlow::Continue(()))?;
//! assert!(matches!(made, Made::Solid(volume) if !volume.mesh.tetrahedra.is_empty()));
//! # Ok::<(), armature_character::volume::MakeError>(())
//! ```

use armature_geometry::planar::{
    MeshPlane, PlanarDomain, PlanarError, PlanarInput, PlanarSettings, PlanarShape, planar_domain, plane_of,
};
use armature_geometry::volume::{Resolution, STAGES, Volume, VolumeError, VolumeInput, VolumeSettings, volume};
use armature_geometry::{MeshError, TriangleMesh};

use crate::progress::Progress;

/// What was made.
#[derive(Clone, Debug)]
pub enum Made {
    /// Of a mesh in space.
    Solid(Box<Volume>),
    /// Of a flat mesh.
    Flat(Box<FlatDomain>),
}

/// Triangles that fill a flat figure.
#[derive(Clone, Debug)]
pub struct FlatDomain {
    /// The triangles in space.
    pub mesh: TriangleMesh,
    /// The same in their plane, and how it went.
    pub domain: PlanarDomain,
}

/// Why no volume could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MakeError {
    /// Of a solid.
    #[error(transparent)]
    Solid(#[from] VolumeError),
    /// Of a flat figure.
    #[error(transparent)]
    Flat(#[from] PlanarError),
}

impl From<MeshError> for MakeError {
    fn from(error: MeshError) -> Self {
        Self::Solid(VolumeError::Mesh(error))
    }
}

/// Makes the volume of `input`; for a flat mesh its planar domain, for which only the resolution setting is used.
/// `progress` receives the current stage and the fraction of the whole that is done, and may stop the work.
pub fn make_volume(
    input: &VolumeInput<'_>,
    settings: &VolumeSettings,
    progress: Progress<'_>,
) -> Result<Made, MakeError> {
    if let Some(plane) = plane_of(input.surface).map_err(VolumeError::Mesh)? {
        return Ok(Made::Flat(Box::new(fill(input, &plane, settings.resolution, progress)?)));
    }
    let mut told = |stage, done: f64| progress(stage, share_done(stage, done));
    Ok(Made::Solid(Box::new(volume(input, settings, &mut told)?)))
}

/// Converts a stage's `done` to the fraction of the whole.
fn share_done(stage: &str, done: f64) -> f64 {
    let index = STAGES.iter().position(|(name, _)| *name == stage).unwrap_or(0);
    let from = index.checked_sub(1).map_or(0.0, |before| STAGES[before].1);
    from + done * (STAGES[index].1 - from)
}

fn fill(
    input: &VolumeInput<'_>,
    plane: &MeshPlane,
    resolution: Resolution,
    progress: Progress<'_>,
) -> Result<FlatDomain, PlanarError> {
    let flat = plane.flatten(input.surface);
    let bones: Vec<_> = input.segments.iter().map(|ends| ends.map(|p| plane.in_plane(p))).collect();
    let points: Vec<_> = input.points.iter().map(|&p| plane.in_plane(p)).collect();
    let largest_edge = match resolution {
        Resolution::Embedded { vertices } => Some(edge_for(&flat.vertices, &flat.triangles, vertices)),
        Resolution::Conforming => None,
    };
    let planar = PlanarInput {
        shape: PlanarShape::Mesh { vertices: &flat.vertices, triangles: &flat.triangles },
        bones: &bones,
        points: &points,
    };
    let settings = PlanarSettings {
        largest_edge: largest_edge.filter(|e| *e > 0.0),
        most_vertices: most_vertices(flat.vertices.len(), resolution),
        ..PlanarSettings::default()
    };
    let domain = planar_domain(&planar, &settings, progress)?;
    let world_from_plane = plane.plane_from_world.inverse();
    let in_space = |&[x, y]: &[f64; 2]| world_from_plane.transform_point3(glam::DVec3::new(x, y, 0.0)).to_array();
    let vertices = domain.vertices.iter().map(in_space).collect();
    Ok(FlatDomain { mesh: TriangleMesh { vertices, triangles: domain.triangles.clone() }, domain })
}

/// Where refining a flat figure of `given` vertices stops. Real outlines need about the number requested; coordinates that
/// differ by orders of magnitude would need all that memory holds.
fn most_vertices(given: usize, resolution: Resolution) -> usize {
    const TIMES_REQUESTED: usize = 8;
    const TIMES_GIVEN: usize = 100;
    const FEWEST: usize = 20_000;
    let most = match resolution {
        Resolution::Embedded { vertices } => TIMES_REQUESTED * vertices.max(given),
        Resolution::Conforming => (TIMES_GIVEN * given).max(FEWEST),
    };
    most.min(PlanarSettings::default().most_vertices.max(2 * given))
}

/// The edge of equilateral triangles with this many corners in total that fill the area.
fn edge_for(vertices: &[[f64; 2]], triangles: &[[u32; 3]], count: usize) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    };
    let total: f64 = triangles.iter().map(area).sum();
    // Each corner has two triangles of √3/4 squares of the edge.
    (2.0 * total / (3.0_f64.sqrt() * count.max(1) as f64)).sqrt()
}
