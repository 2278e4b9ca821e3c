//! Retargets another figure's motion to the human preset.

use armature_rig::{Bone, Motion, Skeleton, Transform};
use glam::{DQuat, DVec3, Vec3};

use super::file::{MotionFileError, model_rotations};
use super::track::{JointTrack, TrackEnd};
use crate::body::Body;

/// A joint of the human preset: label, how it turns, where its bone points in T-pose, and the names that motion files
/// give the bone, most specific first. `*` stands for the side.
struct Joint {
    label: &'static str,
    parent: Option<usize>,
    along: [f32; 3],
    kind: Kind,
    names: &'static [&'static str],
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    /// Turns in any direction; its bone's direction at rest is taken as it is.
    Trunk,
    /// Turns in any direction; a rest pose other than the T-pose is compensated for.
    Limb,
    /// Bends one way only; +1 backwards (a knee), -1 forwards (an elbow).
    Hinge(i8),
}

const UP: [f32; 3] = [0.0, 1.0, 0.0];
const DOWN: [f32; 3] = [0.0, -1.0, 0.0];
const FOOT: [f32; 3] = [0.0, -0.5, 0.87];
const HIP: &[&str] = &["*upleg", "*upperleg", "*thigh", "*hip"];
const KNEE: &[&str] = &["*lowerleg", "*knee", "*calf", "*shin", "*leg"];
const ANKLE: &[&str] = &["*foot", "*ankle"];
const SHOULDER: &[&str] = &["*upperarm", "*uparm", "*arm", "*shoulder"];
const ELBOW: &[&str] = &["*forearm", "*lowerarm", "*elbow"];
const WRIST: &[&str] = &["*hand", "*wrist"];

const fn joint(
    label: &'static str,
    parent: Option<usize>,
    along: [f32; 3],
    kind: Kind,
    names: &'static [&'static str],
) -> Joint {
    Joint { label, parent, along, kind, names }
}

const fn left(x: f32) -> [f32; 3] {
    [x, 0.0, 0.0]
}

/// Parents before children; a hinge follows the joint it is attached to.
const JOINTS: [Joint; 17] = [
    joint("hips", None, UP, Kind::Trunk, &["hips", "pelvis", "hip", "root"]),
    joint("spine", Some(0), UP, Kind::Trunk, &["spine", "spine1", "abdomen", "lowerback", "chest"]),
    joint(
        "chest",
        Some(1),
        UP,
        Kind::Trunk,
        &["upperchest", "spine3", "spine2", "chest2", "chest", "thorax", "spine1"],
    ),
    joint("neck", Some(2), UP, Kind::Trunk, &["neck", "neck1"]),
    joint("head", Some(3), UP, Kind::Trunk, &["head"]),
    joint("left_hip", Some(0), DOWN, Kind::Limb, HIP),
    joint("left_knee", Some(5), DOWN, Kind::Hinge(1), KNEE),
    joint("left_ankle", Some(6), FOOT, Kind::Trunk, ANKLE),
    joint("right_hip", Some(0), DOWN, Kind::Limb, HIP),
    joint("right_knee", Some(8), DOWN, Kind::Hinge(1), KNEE),
    joint("right_ankle", Some(9), FOOT, Kind::Trunk, ANKLE),
    joint("left_shoulder", Some(2), left(1.0), Kind::Limb, SHOULDER),
    joint("left_elbow", Some(11), left(1.0), Kind::Hinge(-1), ELBOW),
    joint("left_wrist", Some(12), left(1.0), Kind::Limb, WRIST),
    joint("right_shoulder", Some(2), left(-1.0), Kind::Limb, SHOULDER),
    joint("right_elbow", Some(14), left(-1.0), Kind::Hinge(-1), ELBOW),
    joint("right_wrist", Some(15), left(-1.0), Kind::Limb, WRIST),
];

/// A hinge bent less than the first of these does not define where its axis points; beyond the second, it does.
const HINGE_TELLS_FROM: f64 = 0.1;
const HINGE_TELLS_SURELY: f64 = 0.45;

/// A motion fitted to the human preset.
#[derive(Clone, Debug, PartialEq)]
pub struct Retargeted {
    /// Ready to play.
    pub track: JointTrack,
    /// Which joint follows which bone.
    pub matched: Vec<(&'static str, String)>,
    /// Joints without a matching bone; they stay at rest.
    pub unmatched: Vec<&'static str>,
}

/// Retargets a human figure's motion to the human preset, by the names of its bones (Mixamo, Unreal, CMU and the like).
///
/// The figure may have a different rest pose, proportions and number of bones. Limb directions are kept in model space;
/// knees and elbows, which bend about one axis only, have their thigh or upper arm twisted until that axis fits.
pub fn retarget(motion: &Motion, body: &Body) -> Result<Retargeted, MotionFileError> {
    let skeleton = &motion.skeleton;
    let bones = match_bones(skeleton);
    if bones.iter().all(Option::is_none) {
        return Err(MotionFileError::NoKnownBones { bones: skeleton.len() });
    }
    let find = |label: &'static str| body.find(label).ok_or(MotionFileError::NotHuman { label });
    let mut parts = JOINTS.iter().map(|joint| find(joint.label)).collect::<Result<Vec<usize>, _>>()?;
    let forearms = [(12, find("left_forearm")?), (15, find("right_forearm")?)];
    parts.extend(forearms.map(|(_, part)| part));

    let frames = joint_frames()?;
    let rest = model_rotations(skeleton, &skeleton.rest_pose());
    let from_t_pose = JOINTS.iter().zip(&bones).map(|(joint, bone)| bone.map(|b| t_pose_to_rest(joint, skeleton, b)));
    let from_t_pose: Vec<DQuat> = from_t_pose.map(Option::unwrap_or_default).collect();
    let mut rotations = Vec::with_capacity(motion.frames.len() * parts.len());
    for pose in &motion.frames {
        let now = model_rotations(skeleton, pose);
        let turned = |joint: usize| bones[joint].map(|b| now[b] * rest[b].inverse() * from_t_pose[joint]);
        let turns = joint_turns(&frames, turned);
        rotations.extend(turns.joints.iter().map(|q| q.normalize().to_array()));
        rotations.extend(forearms.map(|(elbow, _)| turns.twist_after[elbow].normalize().to_array()));
    }
    let named = |bone: usize| skeleton.bones()[bone].name.clone();
    let pairs = || JOINTS.iter().zip(&bones);
    Ok(Retargeted {
        track: JointTrack { frame_seconds: motion.frame_seconds, parts, rotations, end: TrackEnd::Hold },
        matched: pairs().filter_map(|(joint, bone)| bone.map(|b| (joint.label, named(b)))).collect(),
        unmatched: pairs().filter(|(_, bone)| bone.is_none()).map(|(joint, _)| joint.label).collect(),
    })
}

struct Turns {
    joints: [DQuat; JOINTS.len()],
    /// The part of a rotation that a hinge cannot do and a twist after it can.
    twist_after: [DQuat; JOINTS.len()],
}

/// Rotations of all joints in their own frames, from the target rotations in model space.
fn joint_turns(frames: &[DQuat], wanted: impl Fn(usize) -> Option<DQuat>) -> Turns {
    let mut turns = Turns { joints: [DQuat::IDENTITY; JOINTS.len()], twist_after: [DQuat::IDENTITY; JOINTS.len()] };
    // What each joint actually contributes to its bone's model-space rotation.
    let mut reached = [DQuat::IDENTITY; JOINTS.len()];
    for (index, joint) in JOINTS.iter().enumerate() {
        let before = joint.parent.map_or(DQuat::IDENTITY, |parent| reached[parent]);
        let f = frames[index];
        let own = |target: DQuat, before: DQuat| f.inverse() * before.inverse() * target * f;
        let Some(target) = wanted(index) else {
            reached[index] = before;
            continue;
        };
        let (Kind::Hinge(sign), Some(parent)) = (joint.kind, joint.parent) else {
            turns.joints[index] = own(target, before);
            reached[index] = target;
            continue;
        };
        // The limb above twists until the hinge's axis fits. Both share one frame in T-pose.
        let twist = hinge_twist(own(target, before), f64::from(sign));
        turns.joints[parent] *= twist;
        reached[parent] *= f * twist * f.inverse();
        let (bend, after) = bend_then_twist(own(target, reached[parent]));
        turns.joints[index] = bend;
        let has_twist = joint.label.ends_with("elbow");
        turns.twist_after[index] = if has_twist { after } else { DQuat::IDENTITY };
        reached[index] = reached[parent] * f * bend * turns.twist_after[index] * f.inverse();
    }
    turns
}

/// The twist a of `turn` = twist a · bend b · twist c with b of the given sign, to the extent that the bend is large
/// enough to determine it.
fn hinge_twist(turn: DQuat, sign: f64) -> DQuat {
    let along = turn * DVec3::Y;
    let bend = libm::acos(along.y.clamp(-1.0, 1.0));
    let sure = ((bend - HINGE_TELLS_FROM) / (HINGE_TELLS_SURELY - HINGE_TELLS_FROM)).clamp(0.0, 1.0);
    let twist = libm::atan2(sign * along.x, sign * along.z);
    turn_about(DVec3::Y, twist * sure * sure * (3.0 - 2.0 * sure))
}

/// The bend that takes the bone where `turn` takes it, as closely as a bend can, and the remaining twist.
fn bend_then_twist(turn: DQuat) -> (DQuat, DQuat) {
    let along = turn * DVec3::Y;
    let bend = turn_about(DVec3::X, libm::atan2(along.z, along.y));
    let left = bend.inverse() * turn;
    (bend, turn_about(DVec3::Y, 2.0 * libm::atan2(left.y, left.w)))
}

fn turn_about(axis: DVec3, angle: f64) -> DQuat {
    let (sin, cos) = libm::sincos(0.5 * angle);
    DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
}

/// `model_from_joint` of every joint of a human in T-pose.
fn joint_frames() -> Result<Vec<DQuat>, MotionFileError> {
    let bone = |joint: &Joint| Bone {
        name: joint.label.to_owned(),
        parent: None,
        rest: Transform::IDENTITY,
        tail: joint.along.into(),
    };
    let skeleton = Skeleton::new(JOINTS.iter().map(bone).collect()).map_err(|_| MotionFileError::NoBones)?;
    let rest = skeleton.rest_model_from_bone();
    Ok((0..JOINTS.len()).map(|bone| skeleton.bone_from_joint(bone, &rest).as_dquat().normalize()).collect())
}

/// The model-space rotation from the T-pose to the figure's rest pose, for limbs.
fn t_pose_to_rest(joint: &Joint, skeleton: &Skeleton, bone: usize) -> DQuat {
    if joint.kind == Kind::Trunk {
        return DQuat::IDENTITY;
    }
    let (head, tail) = skeleton.rest_segments()[bone];
    let along = (tail - head).as_dvec3();
    let t_pose = Vec3::from(joint.along).as_dvec3();
    along.try_normalize().map_or(DQuat::IDENTITY, |along| DQuat::from_rotation_arc(t_pose, along))
}

fn match_bones(skeleton: &Skeleton) -> [Option<usize>; JOINTS.len()] {
    let plain: Vec<String> = skeleton.bones().iter().map(|bone| plain_name(&bone.name)).collect();
    let mut found = [None; JOINTS.len()];
    // The chest is matched before the spine, which gets whatever remains of their common names.
    let mut order: Vec<usize> = (0..JOINTS.len()).collect();
    order.swap(1, 2);
    for index in order {
        let joint = &JOINTS[index];
        let side = joint.label.split('_').next().filter(|_| joint.names[0].starts_with('*'));
        let names = joint.names.iter().flat_map(|name| spellings(name, side));
        let is_free = |bone: usize| !found.contains(&Some(bone));
        let position = |name: String| (0..plain.len()).find(|&bone| plain[bone] == name && is_free(bone));
        found[index] = names.into_iter().find_map(position);
    }
    found
}

/// "*foot" on the left: leftfoot, lfoot, footl, footleft.
fn spellings(name: &str, side: Option<&str>) -> Vec<String> {
    let Some(side) = side else { return vec![name.to_owned()] };
    let (base, letter) = (&name[1..], &side[..1]);
    vec![format!("{side}{base}"), format!("{letter}{base}"), format!("{base}{letter}"), format!("{base}{side}")]
}

/// Lower-case letters and digits after the last prefix: "mixamorig:LeftForeArm" becomes leftforearm.
fn plain_name(name: &str) -> String {
    let name = name.rsplit([':', '|']).next().unwrap_or(name);
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn apart(a: DQuat, b: DQuat) -> f64 {
        let d = a.inverse() * b;
        2.0 * libm::atan2(d.xyz().length(), d.w.abs())
    }

    #[test]
    fn names_of_many_rigs_are_known() {
        let bones = |names: &[&'static str]| {
            let bone =
                |name: &&str| Bone { name: (*name).into(), parent: None, rest: Transform::IDENTITY, tail: Vec3::Y };
            let skeleton = Skeleton::new(names.iter().map(bone).collect()).unwrap();
            match_bones(&skeleton).map(|b| b.map(|b| names[b]))
        };
        let mixamo = bones(&["m:Hips", "m:Spine", "m:Spine1", "m:Spine2", "m:LeftShoulder", "m:LeftArm", "m:LeftLeg"]);
        assert_eq!((mixamo[1], mixamo[2]), (Some("m:Spine"), Some("m:Spine2")));
        assert_eq!((mixamo[11], mixamo[6]), (Some("m:LeftArm"), Some("m:LeftLeg")));
        let other = bones(&["Hips", "Chest", "Chest2", "LeftCollar", "LeftShoulder", "LeftElbow", "RightWrist"]);
        assert_eq!((other[1], other[2]), (Some("Chest"), Some("Chest2")));
        assert_eq!((other[11], other[12], other[16]), (Some("LeftShoulder"), Some("LeftElbow"), Some("RightWrist")));
        let unreal = bones(&["pelvis", "spine_01", "thigh_l", "calf_r", "upperarm_l", "lowerarm_r", "foot_r"]);
        assert_eq!((unreal[0], unreal[5], unreal[9]), (Some("pelvis"), Some("thigh_l"), Some("calf_r")));
        assert_eq!((unreal[11], unreal[15], unreal[10]), (Some("upperarm_l"), Some("lowerarm_r"), Some("foot_r")));
    }

    #[test]
    fn an_elbow_bent_any_way_reaches_its_direction() {
        let frames = joint_frames().unwrap();
        for (angle, axis) in [(1.0, DVec3::Y), (0.8, DVec3::Z), (1.4, DVec3::new(0.3, 0.8, -0.5).normalize())] {
            let forearm = DQuat::from_axis_angle(axis, angle);
            let wanted = |joint: usize| match joint {
                12 => Some(forearm),
                _ => Some(DQuat::IDENTITY),
            };
            let turns = joint_turns(&frames, wanted);
            let f = frames[11];
            let upper = f * turns.joints[11] * f.inverse();
            let lower = upper * f * turns.joints[12] * turns.twist_after[12] * f.inverse();
            assert!(apart(lower, forearm) < 1e-9, "elbow and twist together miss nothing");
            assert!((upper * DVec3::X - DVec3::X).length() < 1e-9, "the upper arm only turns about itself");
            let bend = 2.0 * libm::atan2(turns.joints[12].x, turns.joints[12].w);
            assert!(bend < 0.0, "elbows bend forwards");
            let hand = lower * frames[13] * turns.joints[13] * frames[13].inverse();
            assert!(apart(hand, DQuat::IDENTITY) < 1e-9, "the hand makes up for what is not its own");
        }
    }
}
