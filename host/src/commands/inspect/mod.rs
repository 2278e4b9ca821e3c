//! `armature inspect`

mod mesh;
mod recognised;

use std::path::Path;

use armature_character::{Character, SkinKind};
use armature_rig::{GroundMode, Mapping, Motion, PartUid, ShapeDrive, Skeleton, TargetChange};
use armature_take::{ClockFault, Record, Summary, Take};
use serde_json::{Value, json};

use self::mesh::inspect_model;
use self::recognised::recognised;
use super::mapping_words::{dynamics_words, mapping_words};
use crate::cli::args::InspectArgs;
use crate::failure::Failure;
use crate::files::inputs::Figure;
use crate::files::{self, inputs};
use crate::terminal::{counted, out};

/// Reports what a file holds and what is wrong with it. A damaged take is bad input, but the rest of it is reported.
pub fn inspect(args: &InspectArgs) -> Result<(), Failure> {
    let path = args.file.as_path();
    let mut damage = None;
    let (words, value) = match files::extension_of(path).as_str() {
        "take" => inspect_take(path, &mut damage)?,
        "bvh" => {
            let read = inputs::motion(path)?;
            inspect_bones(&read.motion.skeleton, &[(String::new(), read.motion.clone())], &read.warnings)
        }
        "tgf" => inspect_skeleton(&inputs::skeleton(path)?),
        "armature" => inspect_character(path)?,
        _ => match inputs::figure(path)? {
            Figure::Model(model) => inspect_model(path, &model)?,
            Figure::Bones(bones) => inspect_bones(&bones.skeleton, &bones.motions, &bones.warnings),
        },
    };
    if args.json {
        out!("{value}");
    } else {
        out!("{}", path.display());
        words.iter().for_each(|line| out!("  {line}"));
    }
    damage.map_or(Ok(()), Err)
}

/// Lines for a person, and the same for a script.
pub(super) type Findings = (Vec<String>, Value);

fn bones_words(bones: usize) -> String {
    counted(bones, "bone", "bones")
}

fn inspect_skeleton(skeleton: &Skeleton) -> Findings {
    let roots = skeleton.bones().iter().filter(|b| b.parent.is_none()).count();
    let hubs = skeleton.bones().iter().filter(|b| b.tail.length() <= 0.0).count();
    let mut words = vec![format!(
        "skeleton: {}, {}, {hubs} without length",
        bones_words(skeleton.len()),
        counted(roots, "root", "roots")
    )];
    let names: Vec<&str> = skeleton.bones().iter().map(|b| b.name.as_str()).collect();
    words.push(format!("bones: {}", names.join(", ")));
    let (recognised_words, recognised) = recognised(skeleton);
    words.extend(recognised_words);
    (words, json!({"kind": "skeleton", "bones": names, "roots": roots, "recognised": recognised}))
}

/// Bones and their motions; the motion of a BVH file has no name.
fn inspect_bones(skeleton: &Skeleton, motions: &[(String, Motion)], warnings: &[String]) -> Findings {
    let (mut words, bones) = inspect_skeleton(skeleton);
    for (name, motion) in motions {
        let called = if name.is_empty() { "motion".to_owned() } else { format!("clip {name:?}") };
        words.push(format!(
            "{called}: {} frames at {:.3} a second, {:.2} s",
            motion.frames.len(),
            1.0 / motion.frame_seconds,
            motion.duration_seconds()
        ));
    }
    words.extend(warnings.iter().map(|w| format!("note: {w}")));
    let first = motions.first().map(|(_, motion)| motion);
    let value = json!({
        "kind": "motion", "frames": first.map_or(0, |m| m.frames.len()), "fps": first.map(|m| 1.0 / m.frame_seconds),
        "clips": motions.iter().map(|(name, m)| json!({"name": name, "frames": m.frames.len()})).collect::<Vec<_>>(),
        "skeleton": bones, "warnings": warnings,
    });
    (words, value)
}

fn inspect_character(path: &Path) -> Result<Findings, Failure> {
    let found = crate::characters::find(&path.display().to_string(), &mut |_, _| std::ops::ControlFlow::Continue(()))?;
    let (mut words, skeleton) = inspect_skeleton(&found.character.skeleton);
    let vertices = found.character.shape.as_ref().map_or(0, |s| s.positions.len());
    words.insert(0, format!("character {:?}: {}", found.character.name, counted(vertices, "vertex", "vertices")));
    let shapes = found.character.character().map(Character::shape_names).unwrap_or_default();
    if !shapes.is_empty() {
        words.push(format!("{}: {}", counted(shapes.len(), "shape", "shapes"), shapes.join(", ")));
    }
    let skin = found.character.character().map(|bound| bound.skin);
    words.extend(skin.map(|kind| format!("skin {kind}")));
    words.extend(found.warnings.iter().map(|w| format!("note: {w}")));
    let value = json!({
        "kind": "character", "name": found.character.name, "vertices": vertices, "shapes": shapes, "skeleton": skeleton,
        "skin": skin.map(SkinKind::name),
    });
    Ok((words, value))
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
            "lost: {}, {} with a wrong checksum, {}, {} of noise; {}",
            counted(summary.lost_samples as usize, "sample", "samples"),
            counted(summary.crc_errors as usize, "frame", "frames"),
            counted(summary.resyncs as usize, "unreadable piece", "unreadable pieces"),
            counted(summary.discarded_bytes as usize, "byte", "bytes"),
            counted(summary.restarts as usize, "restart", "restarts")
        ),
    ];
    let receipt = armature_take::receipt(&take);
    words.push(format!("receipt: {receipt}"));
    words.extend(stream_faults(&take, &summary));
    if let Some(ik) = take.inverse_kinematics() {
        words.push(format!("bones without a joint were posed by inverse kinematics, pinned: {}", ik.pins.join(", ")));
        if !ik.preferences.is_empty() {
            words.push(format!("with preferences: {}", ik.preferences.join(", ")));
        }
        if !ik.limits.is_empty() {
            words.push(format!("within limits: {}", ik.limits.join(", ")));
        }
    }
    words.extend(dragged(&take));
    if let Some(ground) = take.ground() {
        let skeleton = take.skeleton().map(Skeleton::bones).unwrap_or_default();
        let contacts: Vec<&str> = ground.contacts.iter().map(|&bone| skeleton[bone].name.as_str()).collect();
        words.push(format!("{} on the floor: {}", stands(ground.mode), contacts.join(", ")));
    }
    words.extend(take.dynamics().map(dynamics_words));
    let mapping = last_mapping(&take);
    words.extend(mapping.map(mapping_words).unwrap_or_default());
    let set_by_hand = take.records().iter().filter(|record| matches!(record, Record::Shape(_))).count();
    if set_by_hand > 0 {
        words.push(format!("blend shapes were set by hand {}", counted(set_by_hand, "time", "times")));
    }
    words.push(if report.is_whole() {
        "complete: ended cleanly, every checksum is right".into()
    } else {
        "not whole: what is listed below is missing, the rest was read".to_string()
    });
    words.extend(report.problems.iter().map(|p| format!("problem: {p}")));
    if !report.is_whole() {
        let first = report.problems.first().map_or_else(|| "it has no end".to_string(), ToString::to_string);
        let remedy = "replay and export use what is left; record it again if that is not enough";
        *damage = Some(Failure::input(format!("{} is not whole: {first}", path.display()), remedy));
    }
    let joints = last_tree(&take).map_or(0, |t| t.parts().iter().filter(|p| !p.kind.axes().is_empty()).count());
    words.push(format!(
        "puppet: {}; skeleton: {}",
        counted(joints, "joint", "joints"),
        bones_words(take.skeleton().map_or(0, Skeleton::len))
    ));
    let mut value = json!({
        "kind": "take", "character": header.character_name, "samples": summary.samples, "poses": summary.poses,
        "seconds": summary.duration_seconds, "lost_samples": summary.lost_samples, "crc_errors": summary.crc_errors,
        "discarded_bytes": summary.discarded_bytes, "restarts": summary.restarts,
        "clock_faults": {
            "leapt": summary.clock_faults.leapt, "stood": summary.clock_faults.stood,
            "went_back": summary.clock_faults.went_back, "mended_while_recording": summary.mended_clock.len(),
        },
        "silent_joints": summary.silent_joints.iter().map(|joint| json!({
            "part": joint.part.to_string(), "bone": driven_bone(&take, joint.part),
            "at_seconds": joint.at_seconds, "seconds": joint.seconds,
        })).collect::<Vec<_>>(),
        "resyncs": summary.resyncs, "whole": report.is_whole(),
        "inverse_kinematics_pins": take.inverse_kinematics().map(|ik| &ik.pins),
        "inverse_kinematics_preferences": take.inverse_kinematics().map(|ik| &ik.preferences),
        "ground": take.ground().map(|ground| json!({
            "mode": stands(ground.mode), "floor": ground.floor, "contacts": ground.contacts,
        })),
        "inverse_kinematics_limits": take.inverse_kinematics().map(|ik| &ik.limits),
        "problems": report.problems.iter().map(ToString::to_string).collect::<Vec<_>>(), "joints": joints,
        "receipt": crate::takes::receipt::to_json(&receipt),
    });
    value["shared_joints"] = shared_joints(mapping);
    value["driven_shapes"] = driven_shapes(mapping);
    value["shapes_set_by_hand"] = set_by_hand.into();
    value["swinging_bones"] =
        take.dynamics().map_or(0, |all| all.chains.iter().map(|chain| chain.bones.len()).sum::<usize>()).into();
    Ok((words, value))
}

fn stands(mode: GroundMode) -> &'static str {
    match mode {
        GroundMode::Stand => "stands",
        GroundMode::Walk => "walks",
    }
}

/// What was wrong with the clock and the sensors while the take was recorded.
fn stream_faults(take: &Take, summary: &Summary) -> Vec<String> {
    let mut words = Vec::new();
    if !summary.clock_faults.is_empty() {
        words.push(summary.clock_faults.to_string());
    }
    for (fault, seconds) in &summary.mended_clock {
        words.push(match fault {
            ClockFault::Leapt => {
                format!("the device's clock leapt ahead by {seconds:.3} s: such samples were rejected")
            }
            ClockFault::Stood => {
                format!("the device's clock stood still for {seconds:.1} s and more: times were rebuilt")
            }
            ClockFault::WentBack => format!("the device's clock went back by {seconds:.3} s: times were rebuilt"),
        });
    }
    for joint in &summary.silent_joints {
        let bone = driven_bone(take, joint.part).map_or_else(|| "no bone".into(), |bone| format!("bone {bone:?}"));
        words.push(format!(
            "part {} ({bone}) had no data for {:.1} s from {:.2} s on; its bone kept its last turn",
            joint.part, joint.seconds, joint.at_seconds
        ));
    }
    words
}

/// The bone that a part drives by the latest mapping that knows it.
fn driven_bone(take: &Take, part: PartUid) -> Option<&str> {
    take.records().iter().rev().find_map(|record| match record {
        Record::Mapping(mapping) => {
            mapping.entries.iter().find(|entry| entry.part == part).map(|entry| entry.bone.as_str())
        }
        _ => None,
    })
}

fn shared_joints(mapping: Option<&Mapping>) -> Value {
    let joints = mapping.map_or(&[][..], |mapping| &mapping.shared).iter();
    joints.map(|joint| json!({ "part": joint.part.to_string(), "bones": joint.bones })).collect()
}

fn driven_shapes(mapping: Option<&Mapping>) -> Value {
    let drives = mapping.map_or(&[][..], |mapping| &mapping.shapes).iter();
    let one = |drive: &ShapeDrive| {
        json!({
            "part": drive.part.to_string(), "shape": drive.shape, "axis": drive.axis.to_string(),
            "degrees": drive.degrees, "weights": drive.weights,
        })
    };
    drives.map(one).collect()
}

fn last_mapping(take: &Take) -> Option<&Mapping> {
    take.records().iter().rev().find_map(|record| match record {
        Record::Mapping(mapping) => Some(mapping),
        _ => None,
    })
}

fn last_tree(take: &Take) -> Option<&armature_rig::JointTree> {
    take.records().iter().rev().find_map(|record| match record {
        armature_take::Record::Topology(topology) => Some(&topology.tree),
        _ => None,
    })
}

/// Which points were dragged.
fn dragged(take: &Take) -> Option<String> {
    let skeleton = take.skeleton()?;
    let mut names: Vec<String> = Vec::new();
    for record in take.records() {
        if let Record::Target(change @ TargetChange::Set { .. }) = record {
            let name = change.point().name(skeleton);
            if !names.contains(&name) {
                names.push(name);
            }
        }
    }
    (!names.is_empty()).then(|| format!("dragged besides the puppet: {}", names.join(", ")))
}
