//! `armature surface edit`

use armature_fairing::edit::{EditError, RegionEditor};
use armature_fairing::mixed::FairingError;
use armature_formats::model::Model;
use serde_json::json;

use super::conditions::read_conditions;
use super::{check_output, write};
use crate::cli::surface_args::EditArgs;
use crate::failure::Failure;
use crate::files::{self, inputs};
use crate::terminal::{Bar, Talk, counted, out};

pub(super) fn edit(args: &EditArgs, talk: Talk) -> Result<(), Failure> {
    check_output(&args.output, args.overwrite)?;
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let bytes = files::read(&args.conditions)?;
    let text = std::str::from_utf8(&bytes).map_err(|_| {
        Failure::input(
            format!("{} is not a text file", args.conditions.display()),
            "`armature surface edit --help` lists the conditions",
        )
    })?;
    let asked = read_conditions(&args.conditions, text, &model.mesh)?;
    let failed = |e: EditError| {
        let what = format!("{}: {e}", args.mesh.display());
        match e {
            EditError::Fairing(FairingError::Breakdown { .. } | FairingError::OutOfMemory { .. }) => {
                Failure::not_converged(what, "repair thin triangles, or choose a smaller region")
            }
            EditError::Fairing(FairingError::Adrift { .. }) => {
                Failure::input(what, "make the region smaller, or hold a vertex of that part")
            }
            EditError::NotACurve { .. } | EditError::ShortCurve { .. } => {
                Failure::input(what, "name the vertices of the curve in order, each with an edge to the next")
            }
            EditError::Contradiction { .. } => Failure::input(what, "drag it in one way"),
            _ => Failure::input(what, "`armature inspect` says more about the mesh"),
        }
    };
    let editor = RegionEditor::precompute(&model.mesh, &asked.region, &asked.handles, &asked.sharp, &asked.settings)
        .map_err(failed)?;
    let (mesh, residual) = editor.edited(&model.mesh, &asked.dragged).map_err(failed)?;
    bar.finish();
    // Normals of the file are those of the old shape.
    write(&args.output, args.overwrite, &Model { mesh, normals: None, ..model })?;
    let seconds = start.elapsed().as_secs_f64();
    let free = editor.free_count();
    if args.json {
        let value = json!({
            "file": args.output.display().to_string(), "free": free, "handles": asked.handles.len(),
            "residual": residual, "seconds": seconds,
        });
        out!("{value}");
    } else if !talk.quiet {
        out!(
            "{}: {} followed {}, residual {residual:.1e}; {seconds:.2} s",
            args.output.display(),
            counted(free, "vertex", "vertices"),
            counted(asked.handles.len(), "dragged vertex", "dragged vertices"),
        );
    }
    Ok(())
}
