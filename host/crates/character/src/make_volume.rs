//! The volume that weights are computed on: tetrahedra of a solid, triangles of a flat figure.

use std::ops::ControlFlow;

use armature_geometry::{
    MeshPlane, PlanarDomain, PlanarError, PlanarInput, PlanarSettings, PlanarShape, Resolution, TriangleMesh, Volume,
    VolumeError, VolumeInput, VolumeSettings, VolumeStage, planar_domain, plane_of, volume,
};

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
    /// The triangles, where the figure is in space.
    pub mesh: TriangleMesh,
    /// The same in their plane, and how it went.
    pub domain: PlanarDomain,
}

/// Why there is no volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MakeError {
    /// Of a solid.
    #[error(transparent)]
    Solid(#[from] VolumeError),
    /// Of a flat figure.
    #[error(transparent)]
    Flat(#[from] PlanarError),
}

/// Makes the volume of `input`; of a flat mesh its domain, for which only the resolution counts. `progress` hears what
/// is being done and the part of the whole that is done, and may stop it.
pub fn make_volume(
    input: &VolumeInput<'_>,
    settings: &VolumeSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Made, MakeError> {
    if let Some(plane) = plane_of(input.surface).map_err(VolumeError::Mesh)? {
        return Ok(Made::Flat(Box::new(fill(input, &plane, settings.resolution, progress)?)));
    }
    let mut told = |stage: VolumeStage, done: f64| {
        let (label, from, to) = stage_words(stage);
        progress(label, from + done.clamp(0.0, 1.0) * (to - from))
    };
    Ok(Made::Solid(Box::new(volume(input, settings, &mut told)?)))
}

/// What a stage is called, and which part of the whole it takes, as measured on the armadillo.
fn stage_words(stage: VolumeStage) -> (&'static str, f64, f64) {
    match stage {
        VolumeStage::Shell => ("simplifying the surface", 0.0, 0.15),
        VolumeStage::Sites => ("placing vertices", 0.15, 0.2),
        VolumeStage::Tetrahedra => ("connecting vertices", 0.2, 0.3),
        VolumeStage::Recovery => ("keeping the surface's facets", 0.3, 0.55),
        VolumeStage::Segmentation => ("telling inside from outside", 0.55, 0.75),
        VolumeStage::Improvement => ("removing slivers", 0.75, 0.95),
        VolumeStage::Embedding => ("placing the surface in the volume", 0.95, 1.0),
    }
}

fn fill(
    input: &VolumeInput<'_>,
    plane: &MeshPlane,
    resolution: Resolution,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
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
    let settings = PlanarSettings { largest_edge: largest_edge.filter(|e| *e > 0.0), ..PlanarSettings::default() };
    let domain = planar_domain(&planar, &settings, &mut |done| progress("filling the flat figure", done))?;
    let world_from_plane = plane.plane_from_world.inverse();
    let in_space = |&[x, y]: &[f64; 2]| world_from_plane.transform_point3(glam::DVec3::new(x, y, 0.0)).to_array();
    let vertices = domain.vertices.iter().map(in_space).collect();
    Ok(FlatDomain { mesh: TriangleMesh { vertices, triangles: domain.triangles.clone() }, domain })
}

/// The edge of equilateral triangles with so many corners in all that fill the area.
fn edge_for(vertices: &[[f64; 2]], triangles: &[[u32; 3]], count: usize) -> f64 {
    let area = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])).abs()
    };
    let total: f64 = triangles.iter().map(area).sum();
    // Each corner has two triangles of √3/4 squares of the edge.
    (2.0 * total / (3.0_f64.sqrt() * count.max(1) as f64)).sqrt()
}
