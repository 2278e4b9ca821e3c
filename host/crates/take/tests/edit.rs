//! Edit lists: what each edit does, that takes stay as they are, and that the same list gives the same bits for ever.

#![allow(clippy::unwrap_used, reason = "a failing test names its line")]
#![allow(clippy::float_cmp, reason = "what is copied keeps its bits")]

mod support;

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use armature_rig::{
    BoneQuality, BoneStatus, Pose, PoseCompletion, PoseMoment, RawSample, SensorState, Skeleton, TargetChange,
    TargetError,
};
use armature_take::{
    Edit, EditError, EditList, Edited, Header, InverseKinematicsHeader, Take, TakeWriter, apply_edits,
};
use glam::{Affine3A, Quat, Vec3};
use proptest::prelude::*;
use support::{arm, begun, bits, header, read};

/// Samples of the arm: the bend of the wrist and the twist of the shoulder as these counts say at each time.
fn record(header: &Header, micros: impl Iterator<Item = u64>, counts: impl Fn(f64) -> [f64; 4]) -> Take {
    let (mut writer, mut solver) = begun(header);
    for (n, micros) in micros.enumerate() {
        let counts =
            counts(micros as f64 * 1e-6).map(|count| (2048.0 + count).round().rem_euclid(4096.0) as u16).to_vec();
        let device_micros = 40_000_000 + micros;
        let states = vec![SensorState::Ok; 4];
        let sample = RawSample { device_micros, sequence: n as u32, epoch: 1, counts, states };
        writer.sample(&sample, None).unwrap();
        writer.pose(n as u32, device_micros, solver.solve(&sample).unwrap()).unwrap();
    }
    read(&writer.finish().unwrap())
}

fn body() -> Take {
    record(&header(), (0..300).map(|n| n * 10_000), |t| [200.0 * t, 150.0 * (2.0 * t).sin(), 0.0, 300.0 * t])
}

/// The same puppet, another performance, on a clock of its own.
fn arms() -> Take {
    record(&header(), (0..250).map(|n| n * 8_000), |t| [-900.0, 100.0, 50.0, 400.0 - 800.0 * t])
}

fn apply_with(list: &EditList, take: &Take, others: &BTreeMap<&str, Arc<Take>>) -> Result<Edited, EditError> {
    let other = |name: &str| others.get(name).cloned().ok_or_else(|| format!("there is no {name}"));
    apply_edits(list, take, &other, None, &mut |_, _| ControlFlow::Continue(()))
}

fn apply(edits: impl IntoIterator<Item = Edit>) -> Result<Edited, EditError> {
    let mut list = EditList::new("body.take");
    list.add(edits);
    apply_with(&list, &body(), &BTreeMap::from([("arms.take", Arc::new(arms()))]))
}

fn poses(edited: &Edited) -> Vec<(f64, Pose)> {
    let timeline = edited.timeline();
    let mut pose = Pose::default();
    (0..timeline.len())
        .map(|index| {
            let (seconds, packed) = timeline.get(index).unwrap();
            packed.unpack(edited.skeleton(), &mut pose);
            (seconds, pose.clone())
        })
        .collect()
}

fn recorded(take: &Take) -> Vec<Pose> {
    take.poses().map(|packed| take.unpack(packed)).collect()
}

fn overdub(bones: &[&str], at: f64, blend: f64) -> Edit {
    let bones = bones.iter().map(ToString::to_string).collect();
    Edit::Overdub { take: "arms.take".into(), bones, at, from: None, to: None, blend }
}

fn angle(a: Quat, b: Quat) -> f64 {
    let difference = a.as_dquat().normalize() * b.as_dquat().normalize().conjugate();
    2.0 * difference.xyz().length().atan2(difference.w.abs())
}

#[test]
fn without_edits_a_take_is_what_was_recorded_to_the_bit() {
    let edited = poses(&apply([]).unwrap());
    for ((seconds, pose), (n, own)) in edited.iter().zip(recorded(&body()).iter().enumerate()) {
        assert_eq!((bits(pose), seconds.to_bits()), (bits(own), (n as f64 * 1e4 * 1e-6).to_bits()), "pose {n}");
    }
    assert_eq!(edited.len(), 300);
}

/// Where both have a sample, the bone of the other take has its bits; between, it is on the line between two samples.
#[test]
fn an_overdub_takes_its_bones_from_the_other_take_at_its_own_time() {
    let edited = poses(&apply([overdub(&["hand"], 0.5, 0.0)]).unwrap());
    let (own, other) = (recorded(&body()), recorded(&arms()));
    let mut aligned = 0;
    for (n, (seconds, pose)) in edited.iter().enumerate() {
        let micros = (seconds * 1e6).round() as i64 - 500_000;
        let here = |bone: usize| pose.parent_from_bone[bone].rotation;
        assert_eq!(here(0).to_array(), own[n].parent_from_bone[0].rotation.to_array(), "the body is its own");
        if !(0..=249 * 8_000).contains(&micros) {
            assert_eq!(bits(pose), bits(&own[n]));
            continue;
        }
        let (before, part) = ((micros / 8_000) as usize, (micros % 8_000) as f32 / 8_000.0);
        let (a, b) = (&other[before], &other[(before + 1).min(249)]);
        let [a, b] = [a, b].map(|pose| pose.parent_from_bone[2].rotation);
        assert!(angle(here(2), a.slerp(b, part)) < 1e-5, "at {seconds} s");
        if part == 0.0 {
            aligned += 1;
            assert_eq!(here(2).to_array(), a.to_array());
        }
    }
    assert!(aligned > 40);
}

#[test]
fn an_overdub_comes_and_goes_without_a_jump() {
    let sudden = poses(&apply([overdub(&["hand"], 0.5, 0.0)]).unwrap());
    let smooth = poses(&apply([overdub(&["hand"], 0.5, 0.4)]).unwrap());
    let largest = |poses: &[(f64, Pose)]| {
        let turn = |pose: &Pose| pose.parent_from_bone[2].rotation;
        poses.windows(2).map(|pair| angle(turn(&pair[0].1), turn(&pair[1].1))).fold(0.0, f64::max)
    };
    assert!(largest(&sudden) > 0.3, "{}", largest(&sudden));
    assert!(largest(&smooth) < 0.12, "{}", largest(&smooth));
    let inside = |poses: &[(f64, Pose)]| {
        poses.iter().filter(|(t, _)| (1.0..2.0).contains(t)).map(|(_, p)| bits(p)).collect::<Vec<_>>()
    };
    assert_eq!(inside(&sudden), inside(&smooth));
}

/// Turns the lower arm, which no joint drives, half as far as the hand: sees the joints of all takes at once.
#[derive(Debug, Default)]
struct FollowsTheHand {
    restarts: u32,
}

impl PoseCompletion for FollowsTheHand {
    fn complete(&mut self, _: PoseMoment, status: &[BoneStatus], pose: &mut Pose) {
        assert_eq!(status[1].quality, BoneQuality::Unmapped);
        assert!(status[2].quality > BoneQuality::Unmapped);
        pose.parent_from_bone[1].rotation = Quat::IDENTITY.slerp(pose.parent_from_bone[2].rotation, 0.5);
    }

    fn change_target(&mut self, _: &TargetChange) -> Result<(), TargetError> {
        Err(TargetError::NotSupported)
    }

    fn restart(&mut self) {
        self.restarts += 1;
    }
}

#[test]
fn bones_without_a_joint_follow_the_joints_of_both_takes() {
    let inverse_kinematics = Some(InverseKinematicsHeader::default());
    let header = Header { inverse_kinematics, ..header() };
    let base = record(&header, (0..100).map(|n| n * 10_000), |t| [200.0 * t, 0.0, 0.0, 0.0]);
    let mut list = EditList::new("body.take");
    list.add([Edit::Overdub {
        take: "arms.take".into(),
        bones: vec!["hand".into()],
        at: 0.0,
        from: Some(0.2),
        to: Some(0.8),
        blend: 0.0,
    }]);
    let arms = Arc::new(arms());
    let other = |_: &str| Ok(arms.clone());
    let mut completion = FollowsTheHand::default();
    let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
    let edited = apply_edits(&list, &base, &other, Some(&mut completion), go_on).unwrap();
    assert_eq!(completion.restarts, 2, "each pass starts afresh");
    let mut turned = 0;
    for (seconds, pose) in poses(&edited) {
        let [lower, hand] = [1, 2].map(|bone| pose.parent_from_bone[bone].rotation);
        assert!(angle(lower, Quat::IDENTITY.slerp(hand, 0.5)) < 1e-6, "{seconds}");
        turned += u32::from(angle(hand, base_hand(&base)) > 0.05);
    }
    assert!(turned > 40);
    let refused = apply_edits(&list, &base, &other, None, go_on);
    assert_eq!(refused, Err(EditError::NeedsCharacter));
}

fn base_hand(base: &Take) -> Quat {
    recorded(base)[0].parent_from_bone[2].rotation
}

#[test]
fn time_edits_keep_poses_where_they_belong() {
    let plain = poses(&apply([]).unwrap());
    let mark = Edit::Marker { at: 1.5, text: "here".into() };
    let walk = Edit::Segment { name: "walk".into(), from: 0.5, to: 2.0 };
    let edited = apply([mark, walk, Edit::Trim { from: 1.0, to: 2.005 }, Edit::Retime { speed: 0.5 }]).unwrap();
    let trimmed = poses(&edited);
    assert!((edited.seconds() - 2.01).abs() < 1e-9, "{}", edited.seconds());
    assert_eq!(edited.markers, [(1.0, "here".to_owned())]);
    assert_eq!(edited.segments, [("walk".to_owned(), 0.0, 2.0)]);
    assert_eq!((bits(&trimmed[0].1), trimmed[0].0), (bits(&plain[100].1), 0.0));
    for (n, (seconds, pose)) in trimmed.iter().enumerate().take(101) {
        assert!((seconds - 0.02 * n as f64).abs() < 1e-9);
        assert_eq!(bits(pose), bits(&plain[100 + n].1));
    }
    let looped = poses(&apply([Edit::Loop { times: 3, blend: 0.5 }]).unwrap());
    let round = 2.99 - 0.5;
    assert!((looped.last().unwrap().0 - 3.0 * round).abs() < 1e-6);
    assert_eq!(bits(&looped[0].1), bits(&looped.last().unwrap().1), "the end is the start");
    let turn = |pose: &Pose| pose.parent_from_bone[2].rotation;
    let steps = looped.windows(2).map(|pair| angle(turn(&pair[0].1), turn(&pair[1].1)) / (pair[1].0 - pair[0].0));
    assert!(steps.fold(0.0, f64::max) < 4.0, "no jump where a round ends");
}

#[test]
fn bones_can_rest_and_poses_be_held() {
    let plain = poses(&apply([]).unwrap());
    let mute = Edit::Mute { bones: vec!["hand".into()], from: Some(1.0), to: Some(2.0), blend: 0.0 };
    for ((seconds, pose), (_, own)) in poses(&apply([mute]).unwrap()).iter().zip(&plain) {
        let rests = (1.0..=2.0).contains(seconds);
        let expected = if rests { arm().bones()[2].rest } else { own.parent_from_bone[2] };
        assert_eq!(pose.parent_from_bone[2], expected, "{seconds}");
        assert_eq!(pose.parent_from_bone[0], own.parent_from_bone[0]);
    }
    let hold = Edit::Hold { pose: 0.5, from: 1.0, to: 1.5, blend: 0.3, bones: vec![] };
    let held = poses(&apply([hold]).unwrap());
    assert!((100..=150).all(|n| bits(&held[n].1) == bits(&plain[50].1)), "held");
    assert!((0..70).chain(181..300).all(|n| bits(&held[n].1) == bits(&plain[n].1)), "left alone");
    let turn = |pose: &Pose| pose.parent_from_bone[0].rotation;
    let steps = held.windows(2).map(|pair| angle(turn(&pair[0].1), turn(&pair[1].1)));
    assert!(steps.fold(0.0, f64::max) < 0.05, "no jump on the way");
}

#[test]
fn smoothing_has_no_lag_and_a_filter_says_its_lag() {
    let shaky = |t: f64| [0.0, 0.0, 0.0, 500.0 * (6.0 * t).sin() + 60.0 * (std::f64::consts::TAU * 20.0 * t).sin()];
    let take = record(&header(), (0..400).map(|n| n * 5_000), shaky);
    let mut list = EditList::new("body.take");
    list.add([Edit::Smooth { cutoff: 8.0, bones: vec![] }]);
    let edited = apply_with(&list, &take, &BTreeMap::new()).unwrap();
    assert!(edited.notes[0].contains("zero phase") && edited.notes[0].contains("8 Hz"), "{:?}", edited.notes);
    let calm = record(&header(), (0..400).map(|n| n * 5_000), |t| [0.0, 0.0, 0.0, 500.0 * (6.0 * t).sin()]);
    for ((seconds, pose), own) in poses(&edited).iter().zip(recorded(&calm)).skip(60).take(280) {
        let off = angle(pose.parent_from_bone[2].rotation, own.parent_from_bone[2].rotation);
        assert!(off < 0.012, "{off} rad at {seconds} s of a tremor of 0.09 rad");
    }
    let filtered = apply([Edit::Filter { filter: "one-euro:2,1".into() }]).unwrap();
    assert!(
        filtered.notes[0].contains("lag of") && filtered.notes[0].contains("ms at 0.5 rad/s"),
        "{:?}",
        filtered.notes
    );
    assert_ne!(poses(&filtered), poses(&apply([]).unwrap()));
}

/// Two legs on hips: everything that a mirror needs.
fn legs() -> Skeleton {
    let bone = |name: &str, parent, at: [f32; 3], turn: f32, tail: [f32; 3]| armature_rig::Bone {
        name: name.into(),
        parent,
        rest: armature_rig::Transform {
            translation: at.into(),
            rotation: Quat::from_rotation_z(turn),
            ..armature_rig::Transform::IDENTITY
        },
        tail: tail.into(),
    };
    Skeleton::new(vec![
        bone("hips", None, [0.0, 1.0, 0.0], 0.0, [0.0, 0.2, 0.0]),
        bone("left thigh", Some(0), [0.1, 0.0, 0.0], 0.3, [0.0, -0.4, 0.0]),
        bone("right thigh", Some(0), [-0.1, 0.0, 0.0], -0.3, [0.0, -0.4, 0.0]),
        bone("left foot", Some(1), [0.0, -0.4, 0.0], -0.1, [0.0, 0.0, 0.2]),
        bone("right foot", Some(2), [0.0, -0.4, 0.0], 0.1, [0.0, 0.0, 0.2]),
    ])
    .unwrap()
}

fn heads(skeleton: &Skeleton, pose: &Pose) -> Vec<Vec3> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    let tails = frames.iter().zip(skeleton.bones()).map(|(frame, bone)| frame.transform_point3(bone.tail));
    frames.iter().map(|frame| frame.translation.into()).chain(tails).collect()
}

#[test]
fn the_mirror_image_has_every_point_on_the_other_side() {
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(&legs()).unwrap();
    for n in 0..20_u32 {
        let mut pose = legs().rest_pose();
        pose.parent_from_bone[0].translation += Vec3::new(0.3, 0.02, 0.1) * n as f32;
        for bone in 0..5 {
            let turn = Quat::from_euler(glam::EulerRot::XYZ, 0.05 * n as f32, 0.3 * bone as f32, 0.02 * n as f32);
            pose.parent_from_bone[bone].rotation = (pose.parent_from_bone[bone].rotation * turn).normalize();
        }
        writer.pose(n, 10_000 * u64::from(n), &pose).unwrap();
    }
    let take = read(&writer.finish().unwrap());
    let mut list = EditList::new("legs.take");
    list.add([Edit::Mirror]);
    let once = poses(&apply_with(&list, &take, &BTreeMap::new()).unwrap());
    let other_side = [0, 2, 1, 4, 3, 5, 7, 6, 9, 8];
    for ((_, mirrored), own) in once.iter().zip(recorded(&take)) {
        let (there, here) = (heads(&legs(), mirrored), heads(&legs(), &own));
        for (point, &other) in there.iter().zip(&other_side) {
            let image = here[other] * Vec3::new(-1.0, 1.0, 1.0);
            assert!(point.distance(image) < 1e-5, "{point} {image}");
        }
    }
    list.add([Edit::Mirror]);
    for ((_, twice), own) in poses(&apply_with(&list, &take, &BTreeMap::new()).unwrap()).iter().zip(recorded(&take)) {
        assert!(
            twice.parent_from_bone.iter().zip(&own.parent_from_bone).all(|(a, b)| angle(a.rotation, b.rotation) < 1e-5)
        );
    }
}

#[test]
fn a_layer_adds_its_own_motion() {
    let plain = poses(&apply([]).unwrap());
    let add = |weight| Edit::Add { take: "arms.take".into(), at: 0.0, weight, bones: vec!["hand".into()] };
    let (none, full) = (poses(&apply([add(0.0)]).unwrap()), poses(&apply([add(1.0)]).unwrap()));
    let other = recorded(&arms());
    for n in (0..160).step_by(4) {
        let moved = |poses: &[(f64, Pose)]| poses[n].1.parent_from_bone[2].rotation;
        assert!(angle(moved(&none), moved(&plain)) < 1e-6);
        // 10 ms and 8 ms meet every 40 ms.
        let turn = other[0].parent_from_bone[2].rotation.inverse() * other[n * 10 / 8].parent_from_bone[2].rotation;
        assert!(angle(moved(&full), moved(&plain) * turn) < 1e-5, "{n}");
    }
}

#[test]
fn edits_that_cannot_be_applied_say_which_and_why() {
    let trim = Edit::Trim { from: 0.0, to: 1.0 };
    let wrong = [
        (vec![overdub(&["tail"], 0.0, 0.0)], "edit 1: the skeleton has no bone \"tail\""),
        (vec![overdub(&[], 0.0, 0.0)], "name the bones"),
        (vec![overdub(&["hand"], f64::NAN, 0.0)], "NaN s is no time"),
        (vec![overdub(&["hand"], 0.0, -1.0)], "a blend of -1 s"),
        (vec![trim.clone(), Edit::Trim { from: 5.0, to: 6.0 }], "edit 2 leaves nothing"),
        (vec![Edit::Trim { from: 2.0, to: 1.0 }], "give a start before the end"),
        (vec![Edit::Retime { speed: 0.0 }], "a speed of 0"),
        (vec![Edit::Loop { times: 0, blend: 0.0 }], "0 times"),
        (vec![Edit::Loop { times: 2, blend: 2.0 }], "not be longer than half"),
        (vec![Edit::Smooth { cutoff: f64::INFINITY, bones: vec![] }], "no cutoff"),
        (vec![Edit::Filter { filter: "magic".into() }], "is not a filter"),
        (vec![Edit::Add { take: "gone.take".into(), at: 0.0, weight: 1.0, bones: vec![] }], "there is no gone.take"),
    ];
    for (edits, why) in wrong {
        let error = apply(edits).unwrap_err().to_string();
        assert!(error.contains(why), "{why:?}: {error}");
    }
    let mut late = EditList::new("body.take");
    late.edits = vec![trim, overdub(&["hand"], 0.0, 0.0)];
    let error = apply_with(&late, &body(), &BTreeMap::new()).unwrap_err();
    assert_eq!(error, EditError::TooLate { edit: 2 });
    assert!(apply([Edit::Mirror]).is_ok(), "an arm in the middle is its own counterpart");
}

#[test]
fn lists_that_are_none_name_the_line() {
    let wrong = [
        ("version = 2\ntake = \"a.take\"", "version 2"),
        ("version = 1", "take"),
        ("version = 1\ntake = \"a\"\n[[edit]]\ndo = \"fly\"", "fly"),
        ("version = 1\ntake = \"a\"\n[[edit]]\ndo = \"trim\"\nfrom = 1", "to"),
        ("version = 1\ntake = \"a\"\n[[edit]]\ndo = \"retime\"\nspeed = 1\nspin = 2", "spin"),
        ("version = 1\ntake = \"a\"\ncut = 3", "cut"),
        ("\u{0}", "line 1"),
    ];
    for (text, why) in wrong {
        let error = EditList::read(text).unwrap_err().to_string();
        assert!(error.contains(why), "{text:?}: {error}");
    }
}

fn any_edit() -> impl Strategy<Value = Edit> {
    let time = || prop_oneof![-1.0..4.0, any::<f64>()];
    let bones = || {
        prop::sample::subsequence(vec!["upper", "lower", "hand"], 0..3)
            .prop_map(|names| names.into_iter().map(String::from).collect::<Vec<_>>())
    };
    let take = || prop::sample::select(vec!["arms.take", "gone.take"]).prop_map(String::from);
    let range = || (prop::option::of(time()), prop::option::of(time()), time());
    prop_oneof![
        (take(), bones(), time(), range()).prop_map(|(take, bones, at, (from, to, blend))| Edit::Overdub {
            take,
            bones,
            at,
            from,
            to,
            blend
        }),
        Just(Edit::Filter { filter: "one-euro".into() }),
        (time(), time()).prop_map(|(from, to)| Edit::Trim { from, to }),
        (time(), time()).prop_map(|(from, to)| Edit::Segment { name: "s".into(), from, to }),
        time().prop_map(|at| Edit::Marker { at, text: "m".into() }),
        (bones(), range()).prop_map(|(bones, (from, to, blend))| Edit::Mute { bones, from, to, blend }),
        (time(), bones()).prop_map(|(cutoff, bones)| Edit::Smooth { cutoff, bones }),
        Just(Edit::Mirror),
        time().prop_map(|speed| Edit::Retime { speed }),
        (0..4_u32, time()).prop_map(|(times, blend)| Edit::Loop { times, blend }),
        (time(), time(), time(), time(), bones()).prop_map(|(pose, from, to, blend, bones)| Edit::Hold {
            pose,
            from,
            to,
            blend,
            bones
        }),
        (take(), time(), time(), bones()).prop_map(|(take, at, weight, bones)| Edit::Add { take, at, weight, bones }),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Whatever is done, the takes keep their bytes, and what comes out is in order and finite, or refused.
    #[test]
    fn editing_never_changes_a_take(edits in prop::collection::vec(any_edit(), 0..6)) {
        let (base, other) = (body(), Arc::new(arms()));
        let bytes = |take: &Take| {
            let mut writer = TakeWriter::new(Vec::new(), take.header()).unwrap();
            take.records().iter().for_each(|record| writer.record(record).unwrap());
            writer.finish().unwrap()
        };
        let before = (bytes(&base), bytes(&other));
        let mut list = EditList::new("body.take");
        list.edits = edits;
        let others = BTreeMap::from([("arms.take", other.clone())]);
        let text = list.write();
        if let Ok(again) = EditList::read(&text) {
            prop_assert_eq!(again.write(), text);
        }
        if let Ok(edited) = apply_with(&list, &base, &others) {
            prop_assert_eq!(&apply_with(&list, &base, &others).unwrap(), &edited);
            let poses = poses(&edited);
            prop_assert!(!poses.is_empty() && poses.windows(2).all(|pair| pair[0].0 < pair[1].0));
            prop_assert!(poses.iter().all(|(_, pose)| pose.parent_from_bone.iter().all(armature_rig::Transform::is_finite)));
        }
        prop_assert_eq!((bytes(&base), bytes(&other)), before);
    }
}

/// Every edit once. The bits of the result are a file; a list that was written once means the same for ever.
const EVERYTHING: &str = r#"
version = 1
take = "body.take"
[[edit]]
do = "overdub"
take = "arms.take"
bones = ["hand"]
at = 0.3
to = 2.0
blend = 0.25
[[edit]]
do = "filter"
filter = "one-euro:3,1"
[[edit]]
do = "segment"
name = "all"
from = 0.0
to = 2.5
[[edit]]
do = "marker"
at = 1.0
text = "ja – hier"
[[edit]]
do = "add"
take = "arms.take"
weight = 0.5
bones = ["upper"]
[[edit]]
do = "mute"
bones = ["lower"]
from = 0.5
[[edit]]
do = "hold"
pose = 0.2
from = 1.2
to = 1.4
blend = 0.2
[[edit]]
do = "smooth"
cutoff = 9.0
[[edit]]
do = "mirror"
[[edit]]
do = "trim"
from = 0.25
to = 2.25
[[edit]]
do = "retime"
speed = 1.25
[[edit]]
do = "loop"
times = 2
blend = 0.3
"#;

#[test]
fn a_list_means_the_same_for_ever() {
    let list = EditList::read(EVERYTHING).unwrap();
    let edited = apply_with(&list, &body(), &BTreeMap::from([("arms.take", Arc::new(arms()))])).unwrap();
    let mut writer = TakeWriter::new(Vec::new(), &header()).unwrap();
    writer.skeleton(edited.skeleton()).unwrap();
    for (n, (seconds, pose)) in poses(&edited).iter().enumerate().step_by(8) {
        writer.pose(n as u32, (seconds * 1e6).round() as u64, pose).unwrap();
    }
    let bytes = writer.finish().unwrap();
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/edited-1.take");
    if std::env::var_os("ARMATURE_UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, &bytes).unwrap();
    }
    let (golden, now) = (read(&std::fs::read(&path).unwrap()), read(&bytes));
    let pairs = golden.poses().zip(now.poses()).enumerate();
    for (n, (a, b)) in pairs {
        assert_eq!((a.sequence, a.device_micros), (b.sequence, b.device_micros), "pose {n}");
        assert_eq!(bits(&golden.unpack(a)), bits(&now.unpack(b)), "pose {n}");
    }
    assert_eq!(golden.poses().count(), now.poses().count());
}
