//! `armature inspect`

use std::path::Path;

use armature_geometry::{Diagnosis, diagnose, flipped_components};
use armature_rig::{Motion, Skeleton};
use armature_take::Take;
use serde_json::{Value, json};

use crate::cli::args::InspectArgs;
use crate::failure::Failure;
use crate::{files, inputs};

/// Says what a file holds and what is wrong with it. A damaged take is bad input, although what is left of it is told.
pub fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let path = args.file.as_path();
    let mut damage = None;
    let (words, value) = match files::extension_of(path).as_str() {
        "take" => inspect_take(path, &mut damage)?,
        "bvh" => inspect_motion(&inputs::motion(path)?),
        "tgf" => inspect_skeleton(&inputs::skeleton(path)?),
        "armature" => inspect_character(path)?,
        _ => inspect_model(path)?,
    };
    if args.json {
        println!("{value}");
    } else {
        println!("{}", path.display());
        words.iter().for_each(|line| println!("  {line}"));
    }
    damage.map_or(Ok(()), Err)
}

type Findings = (Vec<String>, Value);

fn inspect_model(path: &Path) -> Result<Findings, Failure> {
    let model = inputs::model(path)?;
    let unusable = |e: armature_geometry::MeshError| {
        Failure::input(format!("{}: {e}", path.display()), "repair the mesh and export it again")
    };
    let diagnosis = diagnose(&model.mesh).map_err(unusable)?;
    let mut words = mesh_words(&diagnosis, model.tetrahedra.is_some());
    if let Some(tetrahedra) = &model.tetrahedra {
        let (count, inner) = (tetrahedra.tetrahedra.len(), diagnosis.isolated_vertices);
        words.push(format!("volume mesh: {count} tetrahedra, {inner} vertices inside"));
    }
    let turned = flipped_components(&model.mesh).map_err(unusable)?;
    if !turned.flipped.is_empty() {
        let (flipped, all) = (turned.flipped.len(), diagnosis.components);
        words.push(format!("{flipped} of {all} components are inside out, by their winding number"));
    }
    match &model.rig {
        Some(rig) => words.push(format!(
            "brings a rig: {} bones, {} influences a vertex; bind keeps it unless told --replace-rig",
            rig.skeleton.len(),
            rig.influences.per_vertex()
        )),
        None => {
            words.push("brings no rig: bind needs --skeleton (TGF, BVH or glTF) and computes bone heat weights".into());
        }
    }
    for (name, motion) in &model.motions {
        words.push(format!("clip {name:?}: {} frames, {:.2} s", motion.frames.len(), motion.duration_seconds()));
    }
    words.extend(model.warnings.iter().map(|w| format!("note: {w}")));
    let value = json!({
        "kind": "mesh", "flipped_components": turned.flipped.len(), "diagnosis": diagnosis_json(&diagnosis),
        "tetrahedra": model.tetrahedra.as_ref().map(|t| t.tetrahedra.len()),
        "bones": model.rig.as_ref().map(|r| r.skeleton.len()),
        "clips": model.motions.iter().map(|(name, m)| json!({"name": name, "frames": m.frames.len()})).collect::<Vec<_>>(),
        "warnings": model.warnings,
    });
    Ok((words, value))
}

fn mesh_words(d: &Diagnosis, is_volume: bool) -> Vec<String> {
    let size: Vec<String> = (0..3).map(|k| format!("{:.4}", d.high[k] - d.low[k])).collect();
    let mut words = vec![
        format!(
            "{} vertices, {} triangles, {} component{}",
            d.vertices,
            d.triangles,
            d.components,
            plural(d.components)
        ),
        format!("size {}, area {:.5}", size.join(" × "), d.area),
    ];
    let cutting = if d.self_intersections_complete {
        "pairs of triangles cut each other"
    } else {
        "and more: the search was given up"
    };
    let counts = [
        (d.boundary_edges, "boundary edge", "the surface is open"),
        (d.non_manifold_edges, "non-manifold edge", "more than two triangles meet there"),
        (d.non_manifold_vertices, "non-manifold vertice", "separate fans of triangles touch in a point"),
        (d.inconsistent_edges, "inconsistently oriented edge", "some triangles are inside out"),
        (d.self_intersections, "self-intersection", cutting),
        (d.degenerate_triangles, "degenerate triangle", "without area"),
        (d.duplicate_triangles, "duplicate triangle", ""),
        (d.duplicate_vertices, "duplicate vertice", "seams of textures, or a soup of triangles"),
        (if is_volume { 0 } else { d.isolated_vertices }, "isolated vertice", "in no triangle"),
    ];
    for (count, name, meaning) in counts.into_iter().filter(|(count, ..)| *count > 0) {
        let name = if count == 1 { name.replace("vertice", "vertex") } else { format!("{name}s") };
        let meaning = if meaning.is_empty() { String::new() } else { format!(": {meaning}") };
        words.push(format!("{count} {name}{meaning}"));
    }
    let verdict = if d.closed && d.signed_volume > 0.0 {
        format!("closed and consistently oriented, volume {:.5}", d.signed_volume)
    } else if d.closed {
        "closed, but inside out: turn its normals round".to_string()
    } else {
        "not a closed surface; bone heat weights work on it all the same".to_string()
    };
    words.push(format!("verdict: {verdict}"));
    words
}

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
}

fn diagnosis_json(d: &Diagnosis) -> Value {
    json!({
        "vertices": d.vertices, "triangles": d.triangles, "components": d.components,
        "duplicate_vertices": d.duplicate_vertices, "isolated_vertices": d.isolated_vertices,
        "degenerate_triangles": d.degenerate_triangles, "duplicate_triangles": d.duplicate_triangles,
        "boundary_edges": d.boundary_edges, "non_manifold_edges": d.non_manifold_edges,
        "inconsistent_edges": d.inconsistent_edges, "non_manifold_vertices": d.non_manifold_vertices,
        "self_intersections": d.self_intersections, "self_intersections_complete": d.self_intersections_complete,
        "euler_characteristic": d.euler_characteristic, "area": d.area, "signed_volume": d.signed_volume,
        "closed": d.closed, "low": d.low, "high": d.high,
    })
}

fn inspect_skeleton(skeleton: &Skeleton) -> Findings {
    let roots = skeleton.bones().iter().filter(|b| b.parent.is_none()).count();
    let hubs = skeleton.bones().iter().filter(|b| b.tail.length() <= 0.0).count();
    let words =
        vec![format!("skeleton: {} bones, {roots} root{}, {hubs} without length", skeleton.len(), plural(roots))];
    let names: Vec<&str> = skeleton.bones().iter().map(|b| b.name.as_str()).collect();
    (words, json!({"kind": "skeleton", "bones": names, "roots": roots}))
}

fn inspect_motion(motion: &Motion) -> Findings {
    let (mut words, skeleton) = inspect_skeleton(&motion.skeleton);
    let fps = 1.0 / motion.frame_seconds;
    words.push(format!(
        "motion: {} frames at {fps:.3} a second, {:.2} s",
        motion.frames.len(),
        motion.duration_seconds()
    ));
    (words, json!({"kind": "motion", "frames": motion.frames.len(), "fps": fps, "skeleton": skeleton}))
}

fn inspect_character(path: &Path) -> Result<Findings, Failure> {
    let found = crate::characters::find(&path.display().to_string(), &mut |_| std::ops::ControlFlow::Continue(()))?;
    let (mut words, skeleton) = inspect_skeleton(&found.actor.skeleton);
    let vertices = found.actor.shape.as_ref().map_or(0, |s| s.positions.len());
    words.insert(0, format!("character {:?}: {vertices} vertices", found.actor.name));
    words.extend(found.warnings.iter().map(|w| format!("note: {w}")));
    Ok((words, json!({"kind": "character", "name": found.actor.name, "vertices": vertices, "skeleton": skeleton})))
}

fn inspect_take(path: &Path, damage: &mut Option<Failure>) -> Result<Findings, Failure> {
    let (take, report) = crate::takes::read(path)?;
    let summary = armature_take::summarize(&take);
    let header = take.header();
    let mut words = vec![
        format!("take of {:?}, recorded by armature {}", header.character_name, header.program_version),
        format!(
            "{} samples in {:.3} s ({:.1} a second), {} poses",
            summary.samples,
            summary.duration_seconds,
            summary.samples_per_second.unwrap_or(0.0),
            summary.poses
        ),
        format!(
            "lost: {} samples, {} frames with a wrong checksum, {} bytes of noise; {} restarts",
            summary.lost_samples, summary.crc_errors, summary.discarded_bytes, summary.restarts
        ),
    ];
    words.push(if report.is_whole() {
        "whole: ended cleanly, every checksum holds".into()
    } else {
        "not whole: everything below is missing, all else was read".to_string()
    });
    words.extend(report.problems.iter().map(|p| format!("problem: {p}")));
    if !report.is_whole() {
        let first = report.problems.first().map_or_else(|| "it has no end".to_string(), ToString::to_string);
        let remedy = "replay and export work with what is left; record it again if that is not enough";
        *damage = Some(Failure::input(format!("{} is not whole: {first}", path.display()), remedy));
    }
    let joints = last_tree(&take).map_or(0, |t| t.parts().iter().filter(|p| !p.kind.axes().is_empty()).count());
    words.push(format!("puppet: {joints} joints; skeleton: {} bones", take.skeleton().map_or(0, Skeleton::len)));
    let value = json!({
        "kind": "take", "character": header.character_name, "samples": summary.samples, "poses": summary.poses,
        "seconds": summary.duration_seconds, "lost_samples": summary.lost_samples, "crc_errors": summary.crc_errors,
        "discarded_bytes": summary.discarded_bytes, "restarts": summary.restarts, "whole": report.is_whole(),
        "problems": report.problems.iter().map(ToString::to_string).collect::<Vec<_>>(), "joints": joints,
    });
    Ok((words, value))
}

fn last_tree(take: &Take) -> Option<&armature_rig::JointTree> {
    take.records().iter().rev().find_map(|record| match record {
        armature_take::Record::Topology(topology) => Some(&topology.tree),
        _ => None,
    })
}
