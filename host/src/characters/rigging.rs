//! Skeletons for meshes that have none: which template, and what can go wrong.

use std::path::Path;

use armature_character::Progress;
use armature_character::rigging::{Fit, RigError, RigSettings, Template, fit};
use armature_formats::motion::write_bvh;
use armature_geometry::TriangleMesh;
use armature_rig::{Motion, Skeleton};

use crate::failure::Failure;
use crate::files::{self, inputs};

/// The templates that come with the program.
pub const TEMPLATES: [&str; 4] = ["human", "quadruped", "hand", "spider"];

/// Fits a template into a mesh. `file` is the mesh's, for errors.
pub fn fitted(
    file: &Path,
    mesh: &TriangleMesh,
    template: &str,
    settings: &RigSettings,
    progress: Progress,
) -> Result<Fit, Failure> {
    let chosen = find(template)?;
    fit(mesh, &chosen, settings, progress).map_err(|error| rig_failure(file, template, &error))
}

/// A template by its name, that of a simulated puppet, or a file with a skeleton.
fn find(name: &str) -> Result<Template, Failure> {
    let own = name.strip_prefix("sim:").unwrap_or(name);
    let template = match own {
        "human" | "human8" => Template::human(),
        "quadruped" => Template::quadruped(),
        "hand" => Template::hand(),
        "spider" => Template::spider(),
        _ if files::extension_of(Path::new(own)).is_empty() => {
            return Err(Failure::usage(
                format!("there is no template {name:?}"),
                format!("choose {}, or a file with a skeleton such as BONES.bvh", TEMPLATES.join(", ")),
            ));
        }
        _ => Template::new(inputs::skeleton(Path::new(own))?),
    };
    template
        .map_err(|error| Failure::input(format!("{name}: {error}"), "give a skeleton with bones that have a length"))
}

fn rig_failure(file: &Path, template: &str, error: &RigError) -> Failure {
    let what = format!("{}: {error}", file.display());
    match error {
        RigError::Cancelled { .. } => Failure::usage(what, ""),
        RigError::FrontAlongUp => Failure::usage(what, "give --front across --up, such as --up z --front -y"),
        RigError::NoBones | RigError::TooManyLimbs { .. } | RigError::Skeleton(_) => {
            Failure::input(format!("{template}: {error}"), "choose another template")
        }
        RigError::Flat => Failure::input(what, "give a flat figure a skeleton of its own, as a TGF or BVH file"),
        RigError::Mesh(_) | RigError::NoInside { .. } => {
            Failure::input(what, format!("`armature inspect {}` says what is wrong with the mesh", file.display()))
        }
    }
}

/// A fitted skeleton as a BVH file of one frame.
pub fn as_bvh(skeleton: &Skeleton) -> Result<String, Failure> {
    const FRAME_SECONDS: f64 = 1.0 / 30.0;
    let defect = |error: &dyn std::fmt::Display| {
        Failure::not_converged(format!("the skeleton cannot be written: {error}"), "this is a defect; please report it")
    };
    let motion = Motion::new(skeleton.clone(), FRAME_SECONDS, vec![skeleton.rest_pose()]).map_err(|e| defect(&e))?;
    write_bvh(&motion).map_err(|e| defect(&e))
}
