//! Meshes, skeletons and motions from files, with errors that name the file, the place and the remedy.

use std::path::Path;

use armature_formats::fbx::read_fbx_skeleton;
use armature_formats::gltf::read_gltf_skeleton;
use armature_formats::model::Model;
use armature_formats::motion::BvhMotion;
use armature_formats::skeleton::SkeletonWithClips;
use armature_formats::{FormatError, Place};
use armature_rig::Skeleton;

use crate::failure::Failure;
use crate::files;

impl From<FormatError> for Failure {
    fn from(error: FormatError) -> Self {
        let file = if error.file.is_empty() { "the input" } else { error.file.as_str() };
        let place = match error.place {
            Place::Whole => String::new(),
            Place::Line(line) => format!(", line {line}"),
            Place::Byte(byte) => format!(", byte {byte}"),
        };
        Self::input(format!("{file}{place}: {}", error.what), lowered(&error.remedy))
    }
}

/// The crates' remedies are sentences of their own; the program's follow an arrow. Abbreviations stay as they are.
fn lowered(sentence: &str) -> String {
    let mut characters = sentence.chars();
    match (characters.next(), characters.clone().next()) {
        (Some(first), Some(second)) if second.is_lowercase() => first.to_lowercase().chain(characters).collect(),
        _ => sentence.to_string(),
    }
}

/// Reads a mesh with whatever else its file holds.
pub fn model(path: &Path) -> Result<Model, Failure> {
    let bytes = files::read(path)?;
    let mut model = armature_formats::read_model(&path.display().to_string(), &bytes, &files::neighbours(path))?;
    files::grey_maps::join_grey_maps(&mut model);
    Ok(model)
}

/// What a character can be made of.
#[derive(Debug)]
pub enum Figure {
    /// A mesh, with or without bones.
    Model(Box<Model>),
    /// The bones of a glTF or FBX that has no mesh.
    Bones(SkeletonWithClips),
}

/// Reads a mesh, or the skeleton of a glTF or FBX that has none.
pub fn figure(path: &Path) -> Result<Figure, Failure> {
    match model(path) {
        Ok(model) => Ok(Figure::Model(Box::new(model))),
        Err(failure) if may_be_bare(path) => match skeleton_with_clips(path) {
            Ok(bones) if !bones.has_mesh => Ok(Figure::Bones(bones)),
            _ => Err(failure),
        },
        Err(failure) => Err(failure),
    }
}

fn may_be_bare(path: &Path) -> bool {
    matches!(files::extension_of(path).as_str(), "fbx" | "glb" | "gltf" | "vrm")
}

/// Reads the skeleton and the clips of a glTF or FBX, with or without a mesh.
fn skeleton_with_clips(path: &Path) -> Result<SkeletonWithClips, Failure> {
    let (bytes, file) = (files::read(path)?, path.display().to_string());
    if files::extension_of(path) == "fbx" {
        return Ok(read_fbx_skeleton(&file, &bytes)?);
    }
    Ok(read_gltf_skeleton(&file, &bytes, &files::neighbours(path))?)
}

/// Reads a BVH motion.
pub fn motion(path: &Path) -> Result<BvhMotion, Failure> {
    let bytes = files::read(path)?;
    armature_formats::motion::read_bvh(&bytes).map_err(|e| e.in_file(&path.display().to_string()).into())
}

/// Reads a skeleton: TGF, BVH, or that of a glTF or FBX. What is unusual in the file is logged.
pub fn skeleton(path: &Path) -> Result<Skeleton, Failure> {
    match files::extension_of(path).as_str() {
        "tgf" => {
            let file = path.display().to_string();
            let graph = armature_formats::skeleton::read_tgf(&files::read(path)?).map_err(|e| e.in_file(&file))?;
            let made = armature_formats::skeleton::skeleton_from_graph(&graph, None);
            made.map(|made| made.skeleton).map_err(|e| wrong_edges(&file, &e))
        }
        "bvh" => {
            let read = motion(path)?;
            log(path, &read.warnings);
            Ok(read.motion.skeleton)
        }
        "fbx" | "glb" | "gltf" | "vrm" => {
            let read = skeleton_with_clips(path)?;
            log(path, &read.warnings);
            Ok(read.skeleton)
        }
        _ => Err(Failure::usage(
            format!("{} is no skeleton file", path.display()),
            "skeletons are read from .tgf, .bvh, .fbx, .glb and .gltf",
        )),
    }
}

fn wrong_edges(file: &str, error: &armature_formats::skeleton::GraphError) -> Failure {
    Failure::input(format!("{file}: {error}"), "correct the edges below the '#'")
}

/// Reads everything that a mesh can be bound to: a [`skeleton`], of a TGF with its points too; and what else is in the file and
/// not used, in sentences.
pub fn handles(path: &Path) -> Result<(Skeleton, Vec<String>), Failure> {
    if files::extension_of(path) != "tgf" {
        return Ok((skeleton(path)?, Vec::new()));
    }
    let file = path.display().to_string();
    let graph = armature_formats::skeleton::read_tgf(&files::read(path)?).map_err(|e| e.in_file(&file))?;
    let mut unused = Vec::new();
    for (count, what) in [
        (graph.cage_edges.len(), "edges of a cage were not used: its points move on their own"),
        (graph.pseudo_edges.len(), "pseudo-edges were not used: points keep their orientation unless they are turned"),
        (graph.unread_lines, "lines after the second # were not used: faces of cages are not read"),
    ] {
        if count > 0 {
            unused.push(format!("{file}: {count} {what}"));
        }
    }
    let made = armature_formats::skeleton::skeleton_from_graph(&graph, None).and_then(|made| made.with_points(&graph));
    Ok((made.map_err(|e| wrong_edges(&file, &e))?, unused))
}

fn log(path: &Path, warnings: &[String]) {
    for warning in warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
}
