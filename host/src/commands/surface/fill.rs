//! `armature surface fill`

use armature_fairing::holes::{Filled, Holes, fill_holes};
use armature_geometry::TriangleMesh;
use armature_geometry::surface::self_intersections;

use super::listing::{hole_words, holes_json, patch_json, patch_words};
use super::{check_output, chosen, failure, holes_of, write};
use crate::characters::filled::{by_default, with_patches};
use crate::cli::surface_args::FillArgs;
use crate::failure::Failure;
use crate::files::inputs;
use crate::terminal::{Bar, Talk, aside, counted, out};

pub(super) fn fill(args: &FillArgs, talk: Talk) -> Result<(), Failure> {
    if !args.list {
        check_output(&args.output, args.overwrite)?;
    }
    let start = std::time::Instant::now();
    let bar = Bar::new(talk, "reading the mesh").until_interrupted();
    let model = inputs::model(&args.mesh)?;
    let holes = holes_of(&args.mesh, &model)?;
    if args.list {
        bar.finish();
        list(args, &holes);
        return Ok(());
    }
    let mut which = match (args.all, args.only.is_empty()) {
        (true, _) => (0..holes.holes.len()).collect(),
        (false, true) => by_default(&holes),
        (false, false) => chosen(&args.mesh, &holes, &args.only)?,
    };
    which.retain(|&hole| args.up_to.is_none_or(|most| holes.holes[hole].length <= most));
    let filled = fill_holes(&model.mesh, &holes, &which, &args.join.settings(), &mut bar.stages())
        .map_err(|e| failure(&args.mesh, &e))?;
    bar.finish();
    write(&args.output, args.overwrite, &with_patches(&model, &filled))?;
    say(args, &model.mesh, &holes, &filled, talk, start.elapsed().as_secs_f64());
    match filled.patches.iter().filter(|p| !p.outcome.is_filled()).count() {
        0 => Ok(()),
        open => Err(Failure::not_converged(
            format!("{}: {} stayed open", args.mesh.display(), counted(open, "hole", "holes")),
            format!("the report says why; the others are filled in {}", args.output.display()),
        )),
    }
}

fn list(args: &FillArgs, holes: &Holes) {
    if args.json {
        out!("{}", holes_json(holes));
        return;
    }
    out!("{}: {}", args.mesh.display(), counted(holes.holes.len(), "hole", "holes"));
    hole_words(holes).iter().for_each(|line| out!("  {line}"));
}

fn say(args: &FillArgs, before: &TriangleMesh, holes: &Holes, filled: &Filled, talk: Talk, seconds: f64) {
    let asked: Vec<usize> = filled.patches.iter().flat_map(|p| p.holes.iter().copied()).collect();
    if args.json {
        let mut value = holes_json(holes);
        value["file"] = args.output.display().to_string().into();
        value["seconds"] = seconds.into();
        value["patches"] = filled.patches.iter().map(patch_json).collect::<Vec<_>>().into();
        out!("{value}");
        return;
    }
    if talk.quiet {
        return;
    }
    let done = filled.patches.iter().filter(|p| p.outcome.is_filled()).count();
    out!(
        "{}: {} of {} filled; {}, {}; {seconds:.2} s",
        args.output.display(),
        done,
        counted(holes.holes.len(), "hole", "holes"),
        counted(filled.mesh.vertices.len(), "vertex", "vertices"),
        counted(filled.mesh.triangles.len(), "triangle", "triangles"),
    );
    filled.patches.iter().for_each(|patch| out!("  {}", patch_words(patch)));
    for (index, hole) in holes.holes.iter().enumerate().filter(|(index, _)| !asked.contains(index)) {
        let why = hole.meant.map_or("not asked for".to_owned(), |meant| format!("may be meant: {meant}"));
        aside!("note: hole {} stays open ({why}); --only {} fills it", index + 1, index + 1);
    }
    let crossings = |mesh| self_intersections(mesh).map_or(0, |found| found.pairs.len());
    let (before, after) = (crossings(before), crossings(&filled.mesh));
    if after > before {
        aside!(
            "note: the new surface meets the mesh or itself at {}; look there, or fill fewer holes at a time",
            counted(after - before, "pair of triangles", "pairs of triangles")
        );
    }
    if !holes.broken.is_empty() {
        hole_words(&Holes { holes: Vec::new(), broken: holes.broken.clone() })
            .iter()
            .for_each(|line| aside!("note: {line}"));
    }
}
