//! `armature surface`

mod blend;
mod conditions;
mod edit;
mod fill;
mod listing;

pub(super) use listing::{hole_words, holes_json};

use std::path::Path;

use armature_fairing::holes::{FillError, Holes, find_holes};
use armature_formats::gltf::{GlbMesh, GlbScene, write_glb};
use armature_formats::mesh::write_obj;
use armature_formats::model::Model;
use armature_rig::Skeleton;

use crate::cli::surface_args::SurfaceCommand;
use crate::failure::Failure;
use crate::files::{self, Overwrite};
use crate::terminal::Talk;

/// Closes, joins or edits surfaces.
pub fn surface(command: &SurfaceCommand, talk: Talk) -> Result<(), Failure> {
    match command {
        SurfaceCommand::Fill(args) => fill::fill(args, talk),
        SurfaceCommand::Blend(args) => blend::blend(args, talk),
        SurfaceCommand::Edit(args) => edit::edit(args, talk),
    }
}

/// The output is checked before the work is done.
fn check_output(path: &Path, overwrite: Overwrite) -> Result<(), Failure> {
    if !["obj", "glb"].contains(&files::extension_of(path).as_str()) {
        return Err(Failure::usage(
            format!("{} is neither an OBJ nor a GLB file", path.display()),
            "surfaces are written as .obj or .glb",
        ));
    }
    overwrite.check(path)
}

/// Writes a surface in the format of its file's name. What moves it, skin and blend shapes, is not written.
fn write(path: &Path, overwrite: Overwrite, model: &Model) -> Result<(), Failure> {
    if files::extension_of(path) == "obj" {
        return overwrite.write(path, write_obj(model).as_bytes());
    }
    let mesh = GlbMesh { influences: None, skins: &[], morph_targets: &[], ..GlbMesh::of_model(model) };
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let scene = GlbScene { name: &name, skeleton: &Skeleton::default(), mesh: Some(mesh), clips: Vec::new() };
    let bytes = write_glb(&scene)
        .map_err(|e| Failure::not_converged(format!("{}: {e}", path.display()), "write an .obj file"))?;
    overwrite.write(path, &bytes)
}

fn holes_of(path: &Path, model: &Model) -> Result<Holes, Failure> {
    find_holes(&model.mesh)
        .map_err(|e| Failure::input(format!("{}: {e}", path.display()), "repair the mesh and export it again"))
}

/// Numbers from the command line as indices.
fn chosen(path: &Path, holes: &Holes, numbers: &[usize]) -> Result<Vec<usize>, Failure> {
    let count = holes.holes.len();
    if let Some(number) = numbers.iter().find(|&&number| number > count) {
        return Err(Failure::usage(
            format!("{} has no hole {number}; there are {count}", path.display()),
            format!("`armature surface fill {} --list` lists them", path.display()),
        ));
    }
    let mut indices: Vec<usize> = numbers.iter().map(|number| number - 1).collect();
    indices.sort_unstable();
    indices.dedup();
    Ok(indices)
}

fn failure(path: &Path, error: &FillError) -> Failure {
    let what = format!("{}: {error}", path.display());
    match error {
        FillError::Mesh(_) => Failure::input(what, "repair the mesh and export it again"),
        FillError::Cancelled { .. } => Failure::usage(what, ""),
        FillError::NoSuchHole { .. } | FillError::TooFewRims { .. } | FillError::RimsTouch { .. } => {
            Failure::usage(what, format!("`armature surface fill {} --list` lists the holes", path.display()))
        }
    }
}
