//! Eight joints drive a human of over fifty bones, from the first hello to the finished take and back.

use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::characters::inverse_kinematics::IkArgs;
use armature::takes;
use armature_character::inverse_kinematics::BoneRole;
use armature_rig::{Mapping, Pose, PoseCompletion, StreamSolver};
use armature_sim::serve::Options;
use armature_take::{Record, ReplayError, Take, verify, verify_completed};
use armature_tests::{Run, Setup, character, keep_going, options, perform};
use glam::{Affine3A, Quat};

const FEET: [&str; 2] = ["LeftFoot", "RightFoot"];

fn ik(pins: &[&str]) -> IkArgs {
    IkArgs { pin: pins.iter().map(ToString::to_string).collect(), ..IkArgs::default() }
}

fn eight_joints(character: &Arc<LoadedCharacter>, options: &Options, pins: &[&str]) -> Run {
    eight_joints_by(character, options, ik(pins))
}

fn eight_joints_by(character: &Arc<LoadedCharacter>, options: &Options, ik: IkArgs) -> Run {
    let setup = Setup { ik, ..Setup::samples(80, 100.0) };
    let setup =
        Setup { header: armature_take::Header { character_hash: character.content_hash(), ..setup.header }, ..setup };
    perform(options.puppet().unwrap(), character, &setup)
}

fn assert_replays(run: &Run, character: &LoadedCharacter) {
    let mut completion = takes::completion(&run.take, character).unwrap().unwrap();
    let completion: &mut dyn PoseCompletion = &mut completion;
    let verification = verify_completed(&run.take, Some(completion), &mut keep_going).unwrap();
    assert!(verification.is_exact(), "{verification:?}");
    assert_eq!(verification.identical, run.take.samples().count() as u64);
}

fn model_frames(take: &Take, pose: &Pose) -> Vec<Affine3A> {
    let skeleton = take.skeleton().unwrap();
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames
}

fn turn_of(frame: &Affine3A) -> Quat {
    frame.to_scale_rotation_translation().1
}

/// Every recorded pose, and the pose by forward kinematics alone for its sample.
fn with_joints_alone(take: &Take) -> Vec<(Pose, Pose)> {
    let mut solver = StreamSolver::new(take.skeleton().unwrap().clone());
    let mut plain = Vec::new();
    for record in take.records() {
        match record {
            Record::Topology(t) => solver.set_topology(t.epoch, t.tree.clone()),
            Record::Calibration(c) => solver.set_calibration(c.clone()),
            Record::Mapping(m) => solver.set_mapping(m.clone()),
            Record::Sample(s) => plain.push(solver.solve(&s.raw).unwrap().clone()),
            _ => {}
        }
    }
    take.poses().map(|packed| take.unpack(packed)).zip(plain).collect()
}

#[test]
fn the_same_seed_gives_the_same_take_and_a_replay_the_same_bits() {
    let human = character("human");
    for pins in [&[][..], &FEET] {
        let run = || eight_joints(&human, &options("human8", 4), pins);
        let (first, second) = (run(), run());
        assert!(first.bytes == second.bytes, "two runs with one seed differ");
        let roles = first.summary.roles.unwrap();
        println!("{pins:?}: {roles}, {} bytes", first.bytes.len());
        assert_eq!(roles.driven, 8);
        assert!(roles.solved >= 5);
        assert_replays(&first, &human);
        let header = first.take.header().inverse_kinematics.as_ref().unwrap();
        assert_eq!(
            header.pins,
            if pins.is_empty() { vec!["Hips:fixed"] } else { vec!["LeftFoot:fixed", "RightFoot:fixed"] }
        );
        let alone = verify(&first.take, &mut keep_going);
        assert_eq!(alone, Err(ReplayError::NeedsCharacter));
    }
}

#[test]
fn what_bones_prefer_is_felt_and_goes_into_the_take() {
    let human = character("human");
    let furthest = |run: &Run| {
        let chest = run.take.skeleton().unwrap().find("Chest").unwrap();
        let rest = run.take.skeleton().unwrap().bones()[chest].rest.rotation;
        let turn = |pose: Pose| pose.parent_from_bone[chest].rotation.angle_between(rest);
        run.take.poses().map(|packed| turn(run.take.unpack(packed))).fold(0.0, f32::max)
    };
    let by = |prefer: &[&str]| {
        let prefer = prefer.iter().map(ToString::to_string).collect();
        eight_joints_by(&human, &options("human8", 4), IkArgs { prefer, ..IkArgs::default() })
    };
    let (free, stiff) = (by(&[]), by(&["Chest:stiff=10"]));
    println!("the chest turns by {} at most, a stiff one by {}", furthest(&free), furthest(&stiff));
    assert!(furthest(&free) > 0.02 && furthest(&stiff) < 0.5 * furthest(&free));
    let header = stiff.take.header().inverse_kinematics.as_ref().unwrap();
    assert_eq!(header.preferences, ["Chest:stiff=10"]);
    assert_replays(&stiff, &human);
    for (wrong, said) in [("Chst:stiff=1", "no bone \"Chst\""), ("Chest:stiff=-1", "stiffness"), ("Chest", "stiff=")] {
        let choice = IkArgs { prefer: vec![wrong.into()], ..IkArgs::default() };
        let failure = choice.for_character(&human).unwrap_err().to_string();
        assert!(failure.contains(said), "{failure}");
    }
}

#[test]
fn driven_bones_are_turned_as_their_joints_say_and_the_rest_moves() {
    let human = character("human");
    let run = eight_joints(&human, &options("human8", 4), &[]);
    let mapping = run.mapping().clone();
    let skeleton = run.take.skeleton().unwrap().clone();
    let bone = |name: &str| skeleton.find(name).unwrap();
    let driven: Vec<usize> = mapping.entries.iter().map(|e| bone(&e.bone)).collect();
    let names: Vec<&str> = mapping.entries.iter().map(|e| e.bone.as_str()).collect();
    println!("{names:?}");
    let mut chest = 0.0_f32;
    for (pose, plain) in with_joints_alone(&run.take) {
        let (is, was) = (model_frames(&run.take, &pose), model_frames(&run.take, &plain));
        for &b in &driven {
            let off = turn_of(&is[b]).dot(turn_of(&was[b])).abs();
            assert!(off > 1.0 - 1e-6, "{}: {off}", skeleton.bones()[b].name);
        }
        for name in ["LeftUpperLeg", "RightUpperLeg", "LeftFoot"] {
            assert_eq!(is[bone(name)], was[bone(name)], "nothing lies between {name} and the pinned hips");
        }
        let turn = pose.parent_from_bone[bone("Chest")].rotation;
        chest = chest.max(turn.angle_between(skeleton.bones()[bone("Chest")].rest.rotation));
        for (local, b) in pose.parent_from_bone.iter().zip(skeleton.bones()) {
            assert!(local.is_finite() && local.rotation.is_normalized());
            assert!(b.parent.is_none() || local.translation == b.rest.translation, "a bone changed its length");
        }
    }
    assert!(chest > 0.01, "the spine bends where it has no joint: {chest}");
}

/// Only the head, hands and feet have bones to drive, and yet they turn as if every joint had one.
#[test]
fn joints_without_a_bone_turn_the_next_ones_below_them() {
    let human = character("human");
    let ends = ["LeftFoot", "RightFoot", "LeftHand", "RightHand", "Head"];
    let options = options("human", 4);
    let whole = perform(options.puppet().unwrap(), &human, &Setup::samples(150, 50.0));
    let entries = whole.mapping().entries.iter().filter(|entry| ends.contains(&entry.bone.as_str()));
    let few = Mapping { entries: entries.cloned().collect(), ..Mapping::default() };
    assert!(whole.mapping().carried.is_empty() && few.entries.len() >= ends.len());
    for ik in [Setup::samples(1, 1.0).ik, ik(&[])] {
        let setup = Setup { mapping: Some(few.clone()), ik, ..Setup::samples(150, 50.0) };
        let header = armature_take::Header { character_hash: human.content_hash(), ..armature_take::Header::default() };
        let run = perform(options.puppet().unwrap(), &human, &Setup { header, ..setup });
        let mut furthest = 0.0_f32;
        for (few, all) in run.take.poses().zip(whole.take.poses()) {
            assert_eq!(few.device_micros, all.device_micros);
            let [few, all] =
                [(&run.take, few), (&whole.take, all)].map(|(take, p)| model_frames(take, &take.unpack(p)));
            for bone in ends.map(|name| whole.take.skeleton().unwrap().find(name).unwrap()) {
                furthest = furthest.max(turn_of(&few[bone]).angle_between(turn_of(&all[bone])).to_degrees());
            }
        }
        assert!(furthest < 0.1, "an end is off by {furthest}°");
        if run.take.header().inverse_kinematics.is_some() {
            assert_replays(&run, &human);
        } else {
            assert!(verify(&run.take, &mut keep_going).unwrap().is_exact());
        }
    }
}

#[test]
fn pinned_feet_stay_while_the_pelvis_moves() {
    let human = character("human");
    // Thighs that swing over feet that stay bend one knee the wrong way, which limits do not allow.
    let without_limits = IkArgs { limit: vec!["off".into()], ..ik(&FEET) };
    let run = eight_joints_by(&human, &options("human8", 4), without_limits);
    let skeleton = run.take.skeleton().unwrap().clone();
    let rest = skeleton.rest_model_from_bone();
    let (mut slid, mut sank) = (0.0_f32, 0.0_f32);
    for packed in run.take.poses() {
        let frames = model_frames(&run.take, &run.take.unpack(packed));
        for foot in FEET.map(|name| skeleton.find(name).unwrap()) {
            slid = slid.max(frames[foot].translation.distance(rest[foot].translation));
        }
        sank = sank.max(frames[0].translation.distance(rest[0].translation));
    }
    println!("feet slid by {slid}, the pelvis moved by {sank}");
    assert!(slid < 5e-3 && sank > 5e-3);
}

#[test]
fn sensors_without_sense_do_no_harm() {
    let human = character("human");
    let broken = Options {
        noise: 8.0,
        outlier: 0.1,
        hidden_outlier: 0.02,
        no_data: vec!["2@0.3:0.3".into()],
        pull: vec!["left_elbow@0.4:0.2".into()],
        ..options("human8", 9)
    };
    let run = eight_joints(&human, &broken, &[]);
    for packed in run.take.poses() {
        assert!(run.take.unpack(packed).parent_from_bone.iter().all(|t| t.is_finite() && t.rotation.is_normalized()));
    }
    assert_replays(&run, &human);
}

#[test]
fn a_puppet_with_a_joint_a_bone_is_left_alone() {
    let human = character("human");
    let skeleton = &human.skeleton;
    let mut solver = ik(&[]).for_character(&human).unwrap().unwrap();
    solver.drive(&vec![true; skeleton.len()], &mut keep_going).unwrap();
    assert!(!solver.is_needed() && solver.roles().iter().all(|role| *role == BoneRole::Driven));
    let off = Setup::samples(40, 100.0);
    let auto = Setup { ik: ik(&[]), ..off.clone() };
    // The hand's puppet has a joint for each of the hand's bones except the wrist's stub.
    let hand = character("hand");
    let take = |setup: &Setup| perform(options("hand", 3).puppet().unwrap(), &hand, setup).bytes;
    assert!(take(&off) == take(&auto), "nothing is solved, so the take is the same to the last byte");
}
