//! Knees bend one way, elbows too, and what is out of reach is approached without a jump.

use std::sync::Arc;

use armature::characters::LoadedCharacter;
use armature::characters::inverse_kinematics::IkArgs;
use armature::takes;
use armature_rig::{Pose, PoseCompletion, Skeleton};
use armature_take::{Header, Take, verify_completed};
use armature_tests::{Run, Setup, character, keep_going, options, perform};
use glam::{Affine3A, Quat, Vec3};

const RATE: f64 = 200.0;
/// No solved bone turns further from one sample to the next, degrees; the quickest joint turns by 1.8.
const FURTHEST: f32 = 4.0;

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(ToString::to_string).collect()
}

/// Eight joints walk and wave; head, hands and feet alone would do less.
fn walk(human: &Arc<LoadedCharacter>, pins: &[&str], limits: &[&str]) -> Run {
    let ik = IkArgs { pin: words(pins), limit: words(limits), ..IkArgs::default() };
    let header = Header { character_hash: human.content_hash(), ..Header::default() };
    perform(options("human8", 4).puppet().unwrap(), human, &Setup { ik, header, ..Setup::samples(260, RATE) })
}

pub(crate) fn frames(skeleton: &Skeleton, pose: &Pose) -> Vec<Affine3A> {
    let mut frames = vec![Affine3A::IDENTITY; skeleton.len()];
    pose.forward_kinematics(skeleton, &mut frames);
    frames
}

/// How far a hinge is bent, degrees, positive the way that people bend it.
pub(crate) fn bent(skeleton: &Skeleton, frames: &[Affine3A], bone: &str, forward: f32) -> f32 {
    let bone = skeleton.find(bone).unwrap();
    let above = skeleton.bones()[bone].parent.unwrap();
    let rest = skeleton.rest_model_from_bone();
    let turn = |frame: &Affine3A| frame.to_scale_rotation_translation().1;
    let model_from_joint = turn(&rest[bone]) * skeleton.bone_from_joint(bone, &rest);
    let axis = turn(&frames[above]) * turn(&rest[above]).inverse() * model_from_joint * Vec3::X;
    let along = |bone: usize| frames[bone].transform_vector3(skeleton.bones()[bone].tail);
    let flat = |v: Vec3| v - axis * v.dot(axis);
    let (from, to) = (flat(along(above)), flat(along(bone)));
    forward * from.cross(to).dot(axis).atan2(from.dot(to)).to_degrees()
}

/// What the solved joints of a take do.
#[derive(Debug, Default)]
struct Measured {
    /// The furthest that a knee or an elbow bends the wrong way, degrees.
    wrong: f32,
    /// The furthest that a solved bone turns from one sample to the next, and a driven one, degrees.
    step: f32,
    driven_step: f32,
    /// How far a pinned foot is from its place.
    missed: f32,
}

fn measured(take: &Take, human: &LoadedCharacter, driven: &[String]) -> Measured {
    let skeleton = take.skeleton().unwrap();
    let rest = skeleton.rest_model_from_bone();
    let pinned = take.header().inverse_kinematics.as_ref().unwrap().pins.iter();
    let pinned: Vec<usize> = pinned.filter_map(|pin| skeleton.find(pin.split(':').next()?)).collect();
    let mut found = Measured::default();
    let mut before: Option<Pose> = None;
    assert_eq!(skeleton, &human.skeleton);
    for packed in take.poses() {
        let pose = take.unpack(packed);
        let frames = frames(skeleton, &pose);
        for side in ["Left", "Right"] {
            for (bone, forward) in [("LowerLeg", 1.0), ("LowerArm", -1.0)] {
                let name = format!("{side}{bone}");
                if !driven.contains(&name) {
                    found.wrong = found.wrong.max(-bent(skeleton, &frames, &name, forward));
                }
            }
        }
        for &bone in &pinned {
            found.missed = found.missed.max((frames[bone].translation - rest[bone].translation).length());
        }
        if let Some(before) = before.replace(pose.clone()) {
            let turned = |bone: usize| {
                let between: Quat =
                    before.parent_from_bone[bone].rotation.inverse() * pose.parent_from_bone[bone].rotation;
                2.0 * between.xyz().length().min(1.0).asin().to_degrees()
            };
            for (bone, named) in skeleton.bones().iter().enumerate() {
                let most = if driven.contains(&named.name) { &mut found.driven_step } else { &mut found.step };
                *most = most.max(turned(bone));
            }
        }
    }
    found
}

#[test]
fn knees_bend_one_way_and_nothing_jumps() {
    let human = character("human");
    for pins in [&["LeftFoot", "RightFoot"][..], &["LeftFoot", "RightFoot", "Hips:upright"], &["LeftHand:turning"], &[]]
    {
        let (free, limited) = (walk(&human, pins, &["off"]), walk(&human, pins, &[]));
        let driven: Vec<String> = limited.mapping().entries.iter().map(|entry| entry.bone.clone()).collect();
        let [before, after] = [&free, &limited].map(|run| measured(&run.take, &human, &driven));
        println!("{pins:?}\n  before {before:?}\n  after  {after:?}");
        assert!(after.wrong < 2.0, "{pins:?}: bent by {}° the wrong way", after.wrong);
        assert!(after.step < FURTHEST, "{pins:?}: {after:?} {before:?}");
        for run in [&free, &limited] {
            let mut completion = takes::completion(&run.take, &human).unwrap().unwrap();
            let completion: &mut dyn PoseCompletion = &mut completion;
            let verification = verify_completed(&run.take, Some(completion), &mut keep_going).unwrap();
            assert!(verification.is_exact(), "{pins:?}: {verification:?}");
        }
        let limits = |run: &Run| run.take.header().inverse_kinematics.as_ref().unwrap().limits.len();
        assert!(limits(&free) == 0 && limits(&limited) >= 18);
    }
}
