//! Meshes, skeletons and motions from files, with errors that name the file, the place and the remedy.

use std::path::Path;

use armature_formats::{FormatError, Model, Place};
use armature_rig::{Motion, Skeleton};

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
        Self::input(format!("{file}{place}: {}", error.what), error.remedy)
    }
}

/// Reads a mesh with whatever else its file holds.
pub fn model(path: &Path) -> Result<Model, Failure> {
    let bytes = files::read(path)?;
    Ok(armature_formats::read_model(&path.display().to_string(), &bytes, &files::neighbours(path))?)
}

/// Reads a motion: a BVH file, or the first clip of a glTF.
pub fn motion(path: &Path) -> Result<Motion, Failure> {
    match files::extension_of(path).as_str() {
        "bvh" => {
            let bytes = files::read(path)?;
            armature_formats::read_bvh(&bytes).map_err(|e| e.in_file(&path.display().to_string()).into())
        }
        "glb" | "gltf" => model(path)?.motions.into_iter().next().map(|(_, motion)| motion).ok_or_else(|| {
            Failure::input(format!("{} holds no animation", path.display()), "choose a file with a clip, or a BVH file")
        }),
        _ => Err(Failure::usage(
            format!("{} is no motion file", path.display()),
            "motions are read from .bvh, .glb and .gltf",
        )),
    }
}

/// Reads a skeleton: TGF, BVH, or the skin of a glTF.
pub fn skeleton(path: &Path) -> Result<Skeleton, Failure> {
    match files::extension_of(path).as_str() {
        "tgf" => {
            let file = path.display().to_string();
            let graph = armature_formats::read_tgf(&files::read(path)?).map_err(|e| e.in_file(&file))?;
            let made = armature_formats::skeleton_from_graph(&graph, None);
            made.map(|s| s.skeleton)
                .map_err(|e| Failure::input(format!("{file}: {e}"), "correct the edges below the '#'"))
        }
        "bvh" => Ok(motion(path)?.skeleton),
        "glb" | "gltf" => model(path)?.rig.map(|rig| rig.skeleton).ok_or_else(|| {
            Failure::input(
                format!("{} holds no skin", path.display()),
                "export it with its armature, or give a TGF or BVH skeleton",
            )
        }),
        _ => Err(Failure::usage(
            format!("{} is no skeleton file", path.display()),
            "skeletons are read from .tgf, .bvh, .glb and .gltf",
        )),
    }
}
