//! `armature inspect`

use std::path::Path;

use armature_rig::{Motion, Skeleton};
use armature_take::Take;
use serde_json::{Value, json};

use super::inspect_mesh::inspect_model;
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

/// Lines for a person, and the same for a script.
pub(super) type Findings = (Vec<String>, Value);

fn plural(count: usize) -> &'static str {
    if count == 1 { "" } else { "s" }
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
            "lost: {} samples, {} frames with a wrong checksum, {} pieces that were no frame, {} bytes of noise; {} \
             restarts",
            summary.lost_samples, summary.crc_errors, summary.resyncs, summary.discarded_bytes, summary.restarts
        ),
    ];
    if let Some(ik) = &header.inverse_kinematics {
        words.push(format!("bones without a joint were turned by inverse kinematics, held: {}", ik.pins.join(", ")));
        if !ik.preferences.is_empty() {
            words.push(format!("they preferred: {}", ik.preferences.join(", ")));
        }
    }
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
        "discarded_bytes": summary.discarded_bytes, "restarts": summary.restarts,
        "resyncs": summary.resyncs, "whole": report.is_whole(),
        "inverse_kinematics_pins": header.inverse_kinematics.as_ref().map(|ik| &ik.pins),
        "inverse_kinematics_preferences": header.inverse_kinematics.as_ref().map(|ik| &ik.preferences),
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
