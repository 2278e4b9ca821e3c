//! `armature surface blend`

use armature_fairing::holes::{blend_on_domain, blend_rims};
use armature_formats::model::Model;
use armature_geometry::TriangleMesh;

use super::listing::{hole_words, holes_json, patch_json, patch_words};
use super::{check_output, chosen, failure, holes_of, write};
use crate::cli::surface_args::BlendArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::{Bar, Talk, aside, counted, out};

pub(super) fn blend(args: &BlendArgs, talk: Talk) -> Result<(), Failure> {
    if !args.holes.is_empty() {
        check_output(&args.output, args.overwrite)?;
    }
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the meshes").until_interrupted();
    let mut mesh = TriangleMesh::default();
    let mut dropped = false;
    for path in &args.meshes {
        let model = inputs::model(path)?;
        let count = mesh.vertices.len() as u32;
        mesh.vertices.extend_from_slice(&model.mesh.vertices);
        mesh.triangles.extend(model.mesh.triangles.iter().map(|t| t.map(|v| v + count)));
        dropped |= model.texture_coordinates.is_some();
    }
    let model = Model { mesh, ..Model::default() };
    let first = &args.meshes[0];
    let holes = holes_of(first, &model)?;
    if args.holes.is_empty() {
        bar.finish();
        if args.json {
            out!("{}", holes_json(&holes));
        } else {
            out!("{}; name those to be joined with --holes", counted(holes.holes.len(), "hole", "holes"));
            hole_words(&holes).iter().for_each(|line| out!("  {line}"));
        }
        return Ok(());
    }
    let which = chosen(first, &holes, &args.holes)?;
    let joined = match args.domain.settings(&args.join) {
        Some(settings) => {
            let pair: [usize; 2] = which.as_slice().try_into().map_err(|_| {
                Failure::usage(
                    format!("--domain joins two rims, not {}", which.len()),
                    "name two holes with --holes, or leave --domain out",
                )
            })?;
            blend_on_domain(&model.mesh, &holes, pair, &settings, &mut bar.stages())
        }
        None => blend_rims(&model.mesh, &holes, &which, &args.join.settings(), &mut bar.stages()),
    };
    let joined = joined.map_err(|e| failure(first, &e))?;
    bar.finish();
    let patch = &joined.patches[0];
    if !patch.outcome.is_filled() {
        return Err(Failure::not_converged(
            format!("{}: {}", first.display(), patch_words(patch)),
            "choose other rims, or leave more room between them",
        ));
    }
    write(&args.output, args.overwrite, &Model { mesh: joined.mesh.clone(), ..Model::default() })?;
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        let mut value = patch_json(patch);
        value["file"] = args.output.display().to_string().into();
        value["seconds"] = seconds.into();
        out!("{value}");
    } else if !talk.quiet {
        out!("{}: {}; {seconds:.2} s", args.output.display(), patch_words(patch));
        if dropped {
            aside!("note: texture coordinates are left out");
        }
    }
    Ok(())
}
