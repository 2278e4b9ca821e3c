//! The table of motions: what a puppet's motions make of feet, knees, pins and the floor, with and without the floor and the
//! limits of joints, from the puppet's bytes to the take and back.

use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::characters::ground::{GroundArgs, GroundChoice};
use armature::characters::inverse_kinematics::{IkArgs, IkMode};
use armature::takes;
use armature_rig::{GroundContact, Mapping, Pose, PoseCompletion, Skeleton};
use armature_sim::serve::Options;
use armature_take::{Header, Record, Take, replay, verify_completed};
use armature_tests::{Run, Setup, character, keep_going, perform};
use glam::{Affine3A, Quat, Vec3, Vec3A};

use crate::joint_limits::{bent, frames};

const RATE: f64 = 100.0;
/// Distances are those of a person of this height, millimetres.
const PERSON: f32 = 1900.0;

/// A row of the table.
struct Row {
    name: &'static str,
    puppet: &'static str,
    motion: &'static str,
    seconds: f64,
    ground: GroundChoice,
    contacts: &'static [&'static str],
    pins: &'static [&'static str],
    /// The bones that joints turn; empty: as is proposed.
    driven: &'static [&'static str],
    /// The greatest second difference of solved bones may be so many times that of driven ones: a knee turns by twice what
    /// its thigh does, and by much more while the leg is nearly straight.
    jerk: f32,
}

const FEET: &[&str] = &["LeftFoot", "RightFoot"];
const ALL_FOURS: &[&str] = &["LeftFoot", "RightFoot", "LeftHand", "RightHand"];

const fn row(
    name: &'static str,
    puppet: &'static str,
    motion: &'static str,
    seconds: f64,
    ground: GroundChoice,
) -> Row {
    Row { name, puppet, motion, seconds, ground, contacts: &[], pins: &[], driven: &[], jerk: 1.0 }
}

const TABLE: [Row; 13] = [
    row("walk", "human", "walk", 4.0, GroundChoice::Walk),
    row("walk and wave", "human", "walk+wave", 4.0, GroundChoice::Walk),
    row("walk, 8 joints", "human8", "walk", 4.0, GroundChoice::Walk),
    row("squat", "human", "squat", 3.7, GroundChoice::Stand),
    row("sit", "human", "sit", 4.7, GroundChoice::Stand),
    row("kick", "human", "kick", 2.7, GroundChoice::Walk),
    Row {
        pins: &["Hips", "RightHand:turning"],
        jerk: 1.3,
        ..row("reach beyond", "human8", "reach", 3.7, GroundChoice::Off)
    },
    Row { pins: FEET, jerk: 13.0, ..row("feet pinned", "human8", "walk+wave", 3.0, GroundChoice::Off) },
    Row { pins: FEET, jerk: 4.0, ..row("feet pinned, squat", "human8", "squat", 3.7, GroundChoice::Stand) },
    Row { pins: &["LeftHand:turning"], ..row("hand on a bar", "human8", "walk+wave", 3.0, GroundChoice::Stand) },
    Row { contacts: ALL_FOURS, ..row("cartwheel", "human", "cartwheel", 4.7, GroundChoice::Walk) },
    Row { driven: &["Hips"], jerk: 4.0, ..row("hips only", "human", "walk", 4.0, GroundChoice::Stand) },
    row("five joints", "joints:5", "wiggle", 15.0, GroundChoice::Walk),
];

/// The motion, as it is to be or (`before`) without floor and limits.
fn performed(human: &Arc<LoadedCharacter>, row: &Row, mapping: Option<Mapping>, before: bool) -> Run {
    let words = |words: &[&str]| words.iter().map(ToString::to_string).collect::<Vec<_>>();
    let options = Options {
        puppet: row.puppet.into(),
        motion: Some(row.motion.into()),
        seed: 4,
        rest: 0.1,
        ..Options::default()
    };
    let ik = if row.puppet == "human" && row.driven.is_empty() { IkMode::Off } else { IkMode::Auto };
    let limit = if before && ik != IkMode::Off { words(&["off"]) } else { Vec::new() };
    let ground = if before { GroundChoice::Off } else { row.ground };
    let setup = Setup {
        ik: IkArgs { ik, pin: words(row.pins), limit, ..IkArgs::default() },
        ground: GroundArgs { ground: Some(ground), contacts: words(row.contacts) },
        header: Header { character_hash: human.content_hash(), ..Header::default() },
        mapping,
        ..Setup::samples((row.seconds * RATE) as u32, RATE)
    };
    perform(options.puppet().unwrap(), human, &setup)
}

/// What a take does; distances in millimetres of a person, angles in degrees.
#[derive(Clone, Copy, Debug, Default)]
struct Measured {
    /// Of the points that stay, while they do.
    slide: f32,
    /// Below the floor.
    sunk: f32,
    /// Knees and elbows that no joint turns, beyond straight.
    wrong: f32,
    /// The greatest second difference of the turns of solved bones, and of driven ones.
    solved: f32,
    driven: f32,
    /// Bones' lengths.
    length: f32,
    /// Of pins.
    drift: f32,
    /// The furthest that the hips come in a sample.
    hips: f32,
}

/// All poses of a take, and which points stay in place in each.
fn poses(take: &Take, human: &LoadedCharacter) -> Vec<(Pose, Vec<usize>)> {
    let [mut again, mut completion] = [(); 2].map(|()| takes::completion(take, human).unwrap());
    let again = again.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    let verification = verify_completed(take, again, &mut keep_going).unwrap();
    assert!(verification.is_exact(), "{verification:?}");
    let mut contact = take.ground().map(|ground| GroundContact::new(take.skeleton().unwrap(), ground.clone()).unwrap());
    let mut bare = take.clone();
    if contact.is_some() {
        bare = armature_take::with_ground(take, None);
    }
    let mapping = take.records().iter().find_map(|r| if let Record::Mapping(m) = r { Some(m.clone()) } else { None });
    let driven = driven(take.skeleton().unwrap(), &mapping.unwrap());
    let mut all = Vec::new();
    let completion = completion.as_mut().map(|ik| ik as &mut dyn PoseCompletion);
    replay(&bare, completion, &mut |_, replayed| {
        if let armature_take::Replayed::Sample { sample, pose: Ok(pose) } = replayed {
            let mut pose = pose.clone();
            let mut stay = Vec::new();
            if let Some(contact) = &mut contact {
                contact.follow(sample.raw.device_micros, take.skeleton().unwrap(), &driven, &mut pose);
                stay.extend(contact.standing());
            }
            all.push((pose, stay));
        }
        std::ops::ControlFlow::Continue(())
    })
    .unwrap();
    all
}

fn driven(skeleton: &Skeleton, mapping: &Mapping) -> Vec<bool> {
    let mut driven = vec![false; skeleton.len()];
    mapping.entries.iter().for_each(|entry| driven[skeleton.find(&entry.bone).unwrap()] = true);
    driven
}

fn rotation_vector(turn: Quat) -> Vec3 {
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let sin = turn.xyz().length();
    if sin < 1e-9 { 2.0 * turn.xyz() } else { turn.xyz() * (2.0 * sin.atan2(turn.w) / sin) }
}

/// Measures poses; `stay`: which points are to stay in each, and where the floor and all points are.
fn measured(
    poses: &[(Pose, Vec<usize>)],
    stay: &[(Pose, Vec<usize>)],
    ground: Option<&armature_rig::Ground>,
    human: &LoadedCharacter,
    mapping: &Mapping,
    pins: &[&str],
) -> Measured {
    let skeleton = &human.skeleton;
    let (rest, driven) = (skeleton.rest_model_from_bone(), driven(skeleton, mapping));
    let shape = human.shape.as_ref().unwrap();
    let (low, high) =
        shape.positions.iter().fold((f32::MAX, f32::MIN), |(low, high), place| (low.min(place[1]), high.max(place[1])));
    let scale = PERSON / (high - low);
    let mut skin = human.precompute_skin().unwrap().unwrap();
    let (mut positions, mut normals) = (shape.positions.clone(), shape.normals().to_vec());
    let mut found = Measured::default();
    let mut held: Vec<(usize, Vec3)> = Vec::new();
    let mut last: Option<(Vec<Vec3>, Pose, Vec3A)> = None;
    for (number, ((pose, _), (_, stay))) in poses.iter().zip(stay).enumerate() {
        let frames: Vec<Affine3A> = frames(skeleton, pose);
        if let Some(ground) = ground {
            let place = |point: usize| frames[ground.points[point].bone].transform_point3(ground.points[point].at);
            held.retain(|(point, _)| stay.contains(point));
            for &point in stay {
                match held.iter().find(|(same, _)| *same == point) {
                    Some((_, there)) => {
                        found.slide = found.slide.max((place(point) - *there).with_y(0.0).length() * scale);
                    }
                    None => held.push((point, place(point))),
                }
            }
            if number % 5 == 0 {
                skin.solve(&frames, &mut positions, &mut normals).unwrap();
                let low = positions.iter().fold(f32::INFINITY, |low, position| low.min(position[1]));
                found.sunk = found.sunk.max((ground.floor - low) * scale);
            }
        }
        for side in ["Left", "Right"] {
            for (bone, forward) in [("LowerLeg", 1.0), ("LowerArm", -1.0)] {
                let name = format!("{side}{bone}");
                if !driven[skeleton.find(&name).unwrap()] {
                    found.wrong = found.wrong.max(-bent(skeleton, &frames, &name, forward));
                }
            }
        }
        for pin in pins {
            let bone = skeleton.find(pin.split(':').next().unwrap()).unwrap();
            found.drift = found.drift.max(frames[bone].translation.distance(rest[bone].translation) * scale);
        }
        for (bone, local) in skeleton.bones().iter().zip(&pose.parent_from_bone) {
            assert!(local.is_finite());
            if bone.parent.is_some() {
                found.length = found.length.max(local.translation.distance(bone.rest.translation) * scale);
            }
        }
        let hips = frames[0].translation;
        if let Some((speeds, before, hips_before)) = &mut last {
            found.hips = found.hips.max(hips.distance(*hips_before) * scale);
            for bone in 0..skeleton.len() {
                let turn = before.parent_from_bone[bone].rotation.inverse() * pose.parent_from_bone[bone].rotation;
                let speed = rotation_vector(turn);
                let change = (speed - speeds[bone]).length().to_degrees();
                let most = if driven[bone] { &mut found.driven } else { &mut found.solved };
                *most = if number > 1 { most.max(change) } else { *most };
                speeds[bone] = speed;
            }
            (*before, *hips_before) = (pose.clone(), hips);
        } else {
            last = Some((vec![Vec3::ZERO; skeleton.len()], pose.clone(), hips));
        }
    }
    found
}

/// Only the entries of these bones.
fn few(mapping: &Mapping, bones: &[&str]) -> Mapping {
    let entries = mapping.entries.iter().filter(|entry| bones.contains(&entry.bone.as_str()));
    Mapping { entries: entries.cloned().collect(), ..Mapping::default() }
}

#[test]
fn the_table_of_motions() {
    let human = character("human");
    println!(
        "| motion | slide | below the floor | wrong way | second difference, solved / driven | pins | hips a sample |"
    );
    println!("|---|---|---|---|---|---|---|");
    let mut failures = Vec::new();
    for row in &TABLE {
        let whole = performed(&human, row, None, true);
        let mapping = (!row.driven.is_empty()).then(|| few(whole.mapping(), row.driven));
        let plain = if mapping.is_some() { performed(&human, row, mapping.clone(), true) } else { whole };
        let run = performed(&human, row, mapping, false);
        let (before, after) = (poses(&plain.take, &human), poses(&run.take, &human));
        assert_eq!(before.len(), after.len());
        let ground = run.take.ground();
        let of = |poses: &[(Pose, Vec<usize>)]| measured(poses, &after, ground, &human, run.mapping(), row.pins);
        let (was, is) = (of(&before), of(&after));
        println!(
            "| {} | {:.1} → {:.2} | {:.1} → {:.2} | {:.1} → {:.1} | {:.2} → {:.2} / {:.2} | {:.1} → {:.2} | {:.1} → {:.1} |",
            row.name,
            was.slide,
            is.slide,
            was.sunk,
            is.sunk,
            was.wrong,
            is.wrong,
            was.solved,
            is.solved,
            is.driven,
            was.drift,
            is.drift,
            was.hips,
            is.hips
        );
        let mut check = |what: &str, good: bool| {
            if !good {
                failures.push(format!("{}: {what}: {is:?}", row.name));
            }
        };
        check("a standing foot slides", is.slide <= 1.0);
        check("the skin is below the floor", is.sunk <= 5.0);
        check("bends the wrong way", is.wrong <= 2.0);
        check("bones change their length", is.length <= 1e-3);
        let named = |pin: &&str| run.summary.missed_pins.iter().any(|(bone, _)| pin.starts_with(bone.as_str()));
        check("pins drift and are not named", is.drift <= 0.5 || row.pins.iter().any(named));
        check("solved bones jerk", is.solved <= row.jerk * is.driven.max(0.01));
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
