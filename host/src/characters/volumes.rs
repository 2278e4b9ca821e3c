//! Volumes for meshes from files: tetrahedra of a solid, triangles of a flat figure.

use std::ops::ControlFlow;
use std::path::Path;

use armature_character::bind::Misfit;
use armature_character::volume::make_volume;
pub use armature_character::volume::{FlatDomain, Made, MakeError};
use armature_formats::model::Model;
use armature_geometry::TriangleMesh;
use armature_geometry::planar::PlanarError;
use armature_geometry::volume::{VolumeError, VolumeInput, VolumeSettings};
use armature_rig::Skeleton;

use crate::failure::Failure;
use crate::files::{self, inputs};

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
    /// The bones of a file, or the model's own, and the points of another file (a TGF).
    pub fn read(model: &Model, skeleton: Option<&Path>, points: Option<&Path>) -> Result<Self, Failure> {
        let given = skeleton.map(inputs::skeleton).transpose()?;
        let own = model.rig.as_ref().map(|rig| rig.skeleton.clone());
        let mut handles = given.or(own).map(|s| Self::of_skeleton(&s)).unwrap_or_default();
        if let Some(path) = skeleton.filter(|_| handles.segments.is_empty()) {
            let what = format!("{}: none of its bones has a length", path.display());
            return Err(Failure::input(what, "give bones with a head and a tail"));
        }
        let file = skeleton.map_or("the model's skeleton".into(), |path| path.display().to_string());
        check_fit(&file, &handles.segments, &model.mesh)?;
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

/// Whether bones can belong to a mesh: both in one unit, and most of them within it. `file`: where the bones are from.
pub fn check_fit(file: &str, bones: &[[[f64; 3]; 2]], mesh: &TriangleMesh) -> Result<(), Failure> {
    let Some(bounds) = mesh.bounds().filter(|_| !bones.is_empty()) else { return Ok(()) };
    let ends: Vec<_> = bones
        .iter()
        .map(|bone| bone.map(|p| glam::DVec3::from(p).as_vec3()))
        .map(|[head, tail]| (head, tail))
        .collect();
    Misfit::check(bounds, &ends).map(drop).map_err(|misfit| {
        Failure::input(format!("{file} does not fit the mesh: {misfit}"), "give the skeleton of this mesh")
    })
}

fn read_points(path: &Path) -> Result<Vec<[f64; 3]>, Failure> {
    if files::extension_of(path) != "tgf" {
        return Err(Failure::usage(
            format!("{} is not a TGF file", path.display()),
            "point handles are read from .tgf",
        ));
    }
    let graph = armature_formats::skeleton::read_tgf(&files::read(path)?)
        .map_err(|e| e.in_file(&path.display().to_string()))?;
    Ok(graph.points)
}

/// Makes the volume of a mesh; for a flat one its planar domain, for which only the resolution is used. `progress`
/// receives the current stage and the fraction of the whole that is done, and may stop it.
pub fn make(
    mesh: &TriangleMesh,
    handles: &Handles,
    settings: &VolumeSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Made, MakeError> {
    let input = VolumeInput { surface: mesh, segments: &handles.segments, points: &handles.points };
    make_volume(&input, settings, progress)
}

/// A failure with the file concerned and what to do about it.
pub fn make_failure(error: &MakeError, path: &Path) -> Failure {
    let what = format!("{}: {error}", path.display());
    let look = format!("`armature inspect {}` says what is wrong with the mesh", path.display());
    match error {
        MakeError::Solid(VolumeError::Cancelled) | MakeError::Flat(PlanarError::Cancelled) => Failure::usage(what, ""),
        MakeError::Solid(VolumeError::Segmentation(_) | VolumeError::Improvement(_) | VolumeError::Embedding(_))
        | MakeError::Flat(PlanarError::Segmentation(_)) => Failure::not_converged(what, look),
        _ => Failure::input(what, look),
    }
}
