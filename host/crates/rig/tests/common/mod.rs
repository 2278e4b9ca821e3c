//! Small puppets and skeletons for the tests.

#![allow(dead_code, unreachable_pub, reason = "each test binary uses what it needs")]

use armature_rig::{Bone, JointTree, Part, PartKind, PartUid, Skeleton, Transform};
use glam::Vec3;

pub const TBT: PartKind = PartKind::TwistBendTwist;
pub const BEND: PartKind = PartKind::Bend;
pub const TWIST: PartKind = PartKind::Twist;

pub fn split(outlets: u8) -> PartKind {
    PartKind::Splitter { outlets }
}

pub fn uid(number: usize) -> PartUid {
    let mut uid = PartUid([0xa5; 12]);
    uid.0[..8].copy_from_slice(&(number as u64).to_be_bytes());
    uid
}

/// Parts as (label, kind, parent's label), plugged in in order; labels give the number of the part.
pub fn puppet(parts: &[(&str, PartKind, &str)]) -> JointTree {
    let index = |label: &str| parts.iter().position(|p| p.0 == label);
    let mut list: Vec<Part> = Vec::new();
    for (number, &(_, kind, parent)) in parts.iter().enumerate() {
        let parent = index(parent).filter(|&p| p != number);
        let outlet = list.iter().filter(|p| p.parent == parent).count() as u8;
        list.push(Part { uid: uid(number), kind, parent, outlet, counts_per_turn: 16384 });
    }
    JointTree::new(list).unwrap()
}

/// Bones as (name, parent's name or "", head in model space); tails at the largest child, leaves extend by half.
pub fn skeleton(bones: &[(&str, &str, [f32; 3])]) -> Skeleton {
    let index = |name: &str| bones.iter().position(|b| b.0 == name);
    let head = |i: usize| Vec3::from(bones[i].2);
    let list = bones.iter().enumerate().map(|(i, &(name, parent, _))| {
        let parent = index(parent);
        let translation = head(i) - parent.map_or(Vec3::ZERO, head);
        let children: Vec<usize> = (0..bones.len()).filter(|&c| index(bones[c].1) == Some(i)).collect();
        let tail = match children.len() {
            0 => translation * 0.5,
            n => children.iter().map(|&c| head(c) - head(i)).sum::<Vec3>() / n as f32,
        };
        Bone { name: name.into(), parent, rest: Transform { translation, ..Transform::IDENTITY }, tail }
    });
    Skeleton::new(list.collect()).unwrap()
}

/// A human with collarbones, three fingers per hand, toes, eyes and end markers, in T-pose.
pub fn rich_human() -> Skeleton {
    let mut bones: Vec<(String, String, [f32; 3])> = Vec::new();
    let mut add = |name: &str, parent: &str, at: [f32; 3]| bones.push((name.into(), parent.into(), at));
    add("Hips", "", [0.0, 1.0, 0.0]);
    add("Spine", "Hips", [0.0, 1.1, 0.0]);
    add("Spine1", "Spine", [0.0, 1.22, 0.0]);
    add("Spine2", "Spine1", [0.0, 1.35, 0.0]);
    add("Neck", "Spine2", [0.0, 1.5, 0.0]);
    add("Head", "Neck", [0.0, 1.6, 0.03]);
    add("HeadTop_End", "Head", [0.0, 1.8, 0.09]);
    add("LeftEye", "Head", [0.03, 1.68, 0.12]);
    add("RightEye", "Head", [-0.03, 1.68, 0.12]);
    for (side, s) in [("Left", 1.0), ("Right", -1.0)] {
        let n = |name: &str| format!("{side}{name}");
        add(&n("Shoulder"), "Spine2", [0.06 * s, 1.44, 0.0]);
        add(&n("Arm"), &n("Shoulder"), [0.19 * s, 1.44, -0.02]);
        add(&n("ForeArm"), &n("Arm"), [0.46 * s, 1.43, -0.03]);
        add(&n("Hand"), &n("ForeArm"), [0.74 * s, 1.42, -0.02]);
        for (finger, z) in [("Thumb", 0.05), ("Index", 0.03), ("Middle", 0.0)] {
            let f = |i: usize| format!("{side}Hand{finger}{i}");
            let reach = if finger == "Thumb" { 0.77 } else { 0.86 };
            add(&f(1), &n("Hand"), [reach * s, 1.41, z]);
            add(&f(2), &f(1), [(reach + 0.04) * s, 1.41, z]);
            add(&f(3), &f(2), [(reach + 0.07) * s, 1.41, z]);
        }
        add(&n("UpLeg"), "Hips", [0.09 * s, 0.95, 0.0]);
        add(&n("Leg"), &n("UpLeg"), [0.09 * s, 0.53, 0.0]);
        add(&n("Foot"), &n("Leg"), [0.09 * s, 0.1, -0.04]);
        add(&n("ToeBase"), &n("Foot"), [0.09 * s, 0.02, 0.1]);
        add(&n("Toe_End"), &n("ToeBase"), [0.09 * s, 0.02, 0.18]);
    }
    let mut order: Vec<usize> = (0..bones.len()).collect();
    order.sort_by_key(|&i| depth(&bones, i));
    let borrowed: Vec<(&str, &str, [f32; 3])> =
        order.iter().map(|&i| (bones[i].0.as_str(), bones[i].1.as_str(), bones[i].2)).collect();
    skeleton(&borrowed)
}

fn depth(bones: &[(String, String, [f32; 3])], bone: usize) -> usize {
    bones.iter().position(|b| b.0 == bones[bone].1).map_or(0, |parent| 1 + depth(bones, parent))
}

/// The parts of a human puppet; the wrist comes after elbow and forearm twist.
pub const HUMAN: [(&str, PartKind, &str); 22] = [
    ("hips", TBT, ""),
    ("pelvis", PartKind::Splitter { outlets: 3 }, "hips"),
    ("left hip", TBT, "pelvis"),
    ("spine", TBT, "pelvis"),
    ("right hip", TBT, "pelvis"),
    ("left knee", BEND, "left hip"),
    ("left ankle", TBT, "left knee"),
    ("right knee", BEND, "right hip"),
    ("right ankle", TBT, "right knee"),
    ("chest", TBT, "spine"),
    ("shoulders", PartKind::Splitter { outlets: 3 }, "chest"),
    ("left shoulder", TBT, "shoulders"),
    ("neck", TBT, "shoulders"),
    ("right shoulder", TBT, "shoulders"),
    ("left elbow", BEND, "left shoulder"),
    ("left forearm", TWIST, "left elbow"),
    ("left wrist", TBT, "left forearm"),
    ("right elbow", BEND, "right shoulder"),
    ("right forearm", TWIST, "right elbow"),
    ("right wrist", TBT, "right forearm"),
    ("head", TBT, "neck"),
    ("spare", BEND, "spare"),
];
