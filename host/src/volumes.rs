//! Volumes for meshes from files: tetrahedra of a solid, triangles of a flat figure.

use std::ops::ControlFlow;
use std::path::Path;

use armature_character::Misfit;
use armature_formats::Model;
use armature_geometry::{
    MeshPlane, PlanarDomain, PlanarError, PlanarInput, PlanarSettings, PlanarShape, Resolution, TriangleMesh, Volume,
    VolumeError, VolumeInput, VolumeSettings, VolumeStage, planar_domain, plane_of, volume,
};
use armature_rig::Skeleton;

use crate::failure::Failure;
use crate::{files, inputs};

/// What a volume gets vertices for.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Handles {
    /// Head and tail of every bone with a length, mesh unit.
    pub segments: Vec<[[f64; 3]; 2]>,
    /// The bones' names.
    pub names: Vec<String>,
    /// Point handles, mesh unit.
    pub points: Vec<[f64; 3]>,
}

impl Handles {
    /// The bones of a file, or those that the model brings, and the points of another file (a TGF).
    pub fn read(model: &Model, skeleton: Option<&Path>, points: Option<&Path>) -> Result<Self, Failure> {
        let given = skeleton.map(inputs::skeleton).transpose()?;
        let own = model.rig.as_ref().map(|rig| rig.skeleton.clone());
        let mut handles = given.or(own).map(|s| Self::of_skeleton(&s)).unwrap_or_default();
        if let Some(path) = skeleton.filter(|_| handles.segments.is_empty()) {
            let what = format!("{}: none of its bones has a length", path.display());
            return Err(Failure::input(what, "give bones with a head and a tail"));
        }
        if let (Some(bounds), false) = (model.mesh.bounds(), handles.segments.is_empty()) {
            let ends: Vec<_> = handles
                .segments
                .iter()
                .map(|s| s.map(|p| glam::DVec3::from(p).as_vec3()))
                .map(|[a, b]| (a, b))
                .collect();
            Misfit::check(bounds, &ends).map_err(|misfit| {
                let file = skeleton.map_or("the model's skeleton".into(), |path| path.display().to_string());
                Failure::input(format!("{file} does not fit the mesh: {misfit}"), "give the skeleton of this mesh")
            })?;
        }
        if let Some(path) = points {
            handles.points = read_points(path)?;
        }
        Ok(handles)
    }

    /// The bones with a length.
    pub fn of_skeleton(skeleton: &Skeleton) -> Self {
        let bones = skeleton.bones().iter().zip(skeleton.rest_segments());
        let long = bones.filter(|(_, (head, tail))| head != tail);
        let (names, segments) =
            long.map(|(bone, (head, tail))| (bone.name.clone(), [head, tail].map(|p| p.as_dvec3().to_array()))).unzip();
        Self { segments, names, points: Vec::new() }
    }
}

fn read_points(path: &Path) -> Result<Vec<[f64; 3]>, Failure> {
    if files::extension_of(path) != "tgf" {
        return Err(Failure::usage(format!("{} is no TGF file", path.display()), "point handles are read from .tgf"));
    }
    let graph = armature_formats::read_tgf(&files::read(path)?).map_err(|e| e.in_file(&path.display().to_string()))?;
    Ok(graph.points)
}

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

/// Makes the volume of a mesh; of a flat one, its domain, for which only the resolution counts. `progress` hears what is being done and the part of the
/// whole that is done, and may stop it.
pub fn make(
    mesh: &TriangleMesh,
    handles: &Handles,
    settings: &VolumeSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Made, MakeError> {
    if let Some(plane) = plane_of(mesh).map_err(VolumeError::Mesh)? {
        return Ok(Made::Flat(Box::new(fill(mesh, &plane, handles, settings.resolution, progress)?)));
    }
    let input = VolumeInput { surface: mesh, segments: &handles.segments, points: &handles.points };
    let mut told = |stage: VolumeStage, done: f64| {
        let (label, from, to) = stage_words(stage);
        progress(label, from + done.clamp(0.0, 1.0) * (to - from))
    };
    Ok(Made::Solid(Box::new(volume(&input, settings, &mut told)?)))
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

impl MakeError {
    /// With the file it happened to and what to do about it.
    pub fn in_file(&self, path: &Path) -> Failure {
        let what = format!("{}: {self}", path.display());
        let look = format!("`armature inspect {}` says what is wrong with the mesh", path.display());
        match self {
            Self::Solid(VolumeError::Cancelled) | Self::Flat(PlanarError::Cancelled) => Failure::usage(what, ""),
            Self::Solid(VolumeError::Segmentation(_) | VolumeError::Improvement(_) | VolumeError::Embedding(_))
            | Self::Flat(PlanarError::Segmentation(_)) => Failure::not_converged(what, look),
            _ => Failure::input(what, look),
        }
    }
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
    mesh: &TriangleMesh,
    plane: &MeshPlane,
    handles: &Handles,
    resolution: Resolution,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<FlatDomain, PlanarError> {
    let flat = plane.flatten(mesh);
    let bones: Vec<_> = handles.segments.iter().map(|ends| ends.map(|p| plane.in_plane(p))).collect();
    let points: Vec<_> = handles.points.iter().map(|&p| plane.in_plane(p)).collect();
    let largest_edge = match resolution {
        Resolution::Embedded { vertices } => Some(edge_for(&flat.vertices, &flat.triangles, vertices)),
        Resolution::Conforming => None,
    };
    let input = PlanarInput {
        shape: PlanarShape::Mesh { vertices: &flat.vertices, triangles: &flat.triangles },
        bones: &bones,
        points: &points,
    };
    let settings = PlanarSettings { largest_edge: largest_edge.filter(|e| *e > 0.0), ..PlanarSettings::default() };
    let domain = planar_domain(&input, &settings, &mut |done| progress("filling the flat figure", done))?;
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
