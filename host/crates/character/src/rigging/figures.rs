//! The templates that come with the program: a human, a quadruped, a left hand and a spider.

use armature_rig::{Bone, Skeleton, Transform};
use glam::DVec3;

use super::error::RigError;
use super::template::Template;
use crate::own::spider_skeleton;

/// Name, parent, head and tail of a bone; names that begin with `Left` get a mirror image.
type Row = (&'static str, &'static str, [f64; 3], [f64; 3]);

/// Proportions of an adult in a T-pose, in metres; the names are those of Unity's `HumanBodyBones`. Hands end at the
/// fingertips and feet at the toes.
const HUMAN: &[Row] = &[
    ("Hips", "", [0.0, 0.955, 0.0], [0.0, 1.045, -0.008]),
    ("Spine", "Hips", [0.0, 1.045, -0.008], [0.0, 1.165, -0.012]),
    ("Chest", "Spine", [0.0, 1.165, -0.012], [0.0, 1.3, -0.016]),
    ("UpperChest", "Chest", [0.0, 1.3, -0.016], [0.0, 1.475, -0.018]),
    ("Neck", "UpperChest", [0.0, 1.475, -0.018], [0.0, 1.555, 0.0]),
    ("Head", "Neck", [0.0, 1.555, 0.0], [0.0, 1.74, 0.004]),
    ("LeftShoulder", "UpperChest", [0.025, 1.428, -0.014], [0.172, 1.425, -0.014]),
    ("LeftUpperArm", "LeftShoulder", [0.172, 1.425, -0.014], [0.441, 1.425, -0.02]),
    ("LeftLowerArm", "LeftUpperArm", [0.441, 1.425, -0.02], [0.692, 1.425, -0.01]),
    ("LeftHand", "LeftLowerArm", [0.692, 1.425, -0.01], [0.875, 1.425, 0.0]),
    ("LeftUpperLeg", "Hips", [0.094, 0.905, 0.0], [0.104, 0.49, 0.008]),
    ("LeftLowerLeg", "LeftUpperLeg", [0.104, 0.49, 0.008], [0.11, 0.085, -0.024]),
    ("LeftFoot", "LeftLowerLeg", [0.11, 0.085, -0.024], [0.122, 0.03, 0.115]),
    ("LeftToes", "LeftFoot", [0.122, 0.03, 0.115], [0.124, 0.02, 0.18]),
];

/// Proportions between those of a horse, a cow and a dog, as long as high. Front legs have the names of arms, as the
/// recogniser and the mappings of puppets call them.
const QUADRUPED: &[Row] = &[
    ("Hips", "", [0.0, 0.74, -0.36], [0.0, 0.76, -0.16]),
    ("Spine", "Hips", [0.0, 0.76, -0.16], [0.0, 0.76, 0.02]),
    ("Chest", "Spine", [0.0, 0.76, 0.02], [0.0, 0.74, 0.2]),
    ("UpperChest", "Chest", [0.0, 0.74, 0.2], [0.0, 0.8, 0.33]),
    ("Neck", "UpperChest", [0.0, 0.8, 0.33], [0.0, 1.0, 0.48]),
    ("Head", "Neck", [0.0, 1.0, 0.48], [0.0, 0.92, 0.7]),
    ("Tail", "Hips", [0.0, 0.76, -0.5], [0.0, 0.64, -0.6]),
    ("TailEnd", "Tail", [0.0, 0.64, -0.6], [0.0, 0.45, -0.64]),
    ("LeftUpperArm", "UpperChest", [0.11, 0.6, 0.22], [0.11, 0.42, 0.17]),
    ("LeftLowerArm", "LeftUpperArm", [0.11, 0.42, 0.17], [0.11, 0.22, 0.2]),
    ("LeftHand", "LeftLowerArm", [0.11, 0.22, 0.2], [0.11, 0.02, 0.24]),
    ("LeftUpperLeg", "Hips", [0.11, 0.66, -0.38], [0.11, 0.46, -0.3]),
    ("LeftLowerLeg", "LeftUpperLeg", [0.11, 0.46, -0.3], [0.11, 0.24, -0.4]),
    ("LeftFoot", "LeftLowerLeg", [0.11, 0.24, -0.4], [0.11, 0.02, -0.34]),
];

/// Proportions of an adult's left hand: fingers up, palm towards +Z, so the thumb is at −X.
const HAND: &[Row] = &[
    ("LeftLowerArm", "", [0.0, 0.0, 0.0], [0.0, 0.29, 0.0]),
    ("LeftHand", "LeftLowerArm", [0.0, 0.29, 0.0], [0.0, 0.66, 0.0]),
    ("LeftThumbProximal", "LeftHand", [-0.09, 0.36, 0.04], [-0.21, 0.48, 0.07]),
    ("LeftThumbIntermediate", "LeftThumbProximal", [-0.21, 0.48, 0.07], [-0.29, 0.57, 0.08]),
    ("LeftThumbDistal", "LeftThumbIntermediate", [-0.29, 0.57, 0.08], [-0.36, 0.65, 0.08]),
    ("LeftIndexProximal", "LeftHand", [-0.10, 0.64, 0.0], [-0.12, 0.81, 0.0]),
    ("LeftIndexIntermediate", "LeftIndexProximal", [-0.12, 0.81, 0.0], [-0.13, 0.90, 0.0]),
    ("LeftIndexDistal", "LeftIndexIntermediate", [-0.13, 0.90, 0.0], [-0.14, 0.98, 0.0]),
    ("LeftMiddleProximal", "LeftHand", [-0.01, 0.66, 0.0], [-0.01, 0.84, 0.0]),
    ("LeftMiddleIntermediate", "LeftMiddleProximal", [-0.01, 0.84, 0.0], [-0.01, 0.95, 0.0]),
    ("LeftMiddleDistal", "LeftMiddleIntermediate", [-0.01, 0.95, 0.0], [-0.01, 1.04, 0.0]),
    ("LeftRingProximal", "LeftHand", [0.07, 0.64, 0.0], [0.09, 0.80, 0.0]),
    ("LeftRingIntermediate", "LeftRingProximal", [0.09, 0.80, 0.0], [0.10, 0.91, 0.0]),
    ("LeftRingDistal", "LeftRingIntermediate", [0.10, 0.91, 0.0], [0.11, 0.99, 0.0]),
    ("LeftLittleProximal", "LeftHand", [0.14, 0.60, 0.0], [0.18, 0.73, 0.0]),
    ("LeftLittleIntermediate", "LeftLittleProximal", [0.18, 0.73, 0.0], [0.20, 0.81, 0.0]),
    ("LeftLittleDistal", "LeftLittleIntermediate", [0.20, 0.81, 0.0], [0.22, 0.88, 0.0]),
];

impl Template {
    /// A human in a T-pose with 22 bones, without fingers.
    pub fn human() -> Result<Self, RigError> {
        Self::new(skeleton(HUMAN, true)?)
    }

    /// An animal on four legs with 20 bones; its front legs have the names of arms.
    pub fn quadruped() -> Result<Self, RigError> {
        Self::new(skeleton(QUADRUPED, true)?)
    }

    /// The spider that comes with the program, with eight legs of three segments.
    pub fn spider() -> Result<Self, RigError> {
        Self::new(spider_skeleton()?)
    }

    /// A left hand with a stub of a forearm and five fingers, 17 bones.
    pub fn hand() -> Result<Self, RigError> {
        Self::new(skeleton(HAND, false)?)
    }
}

fn skeleton(rows: &[Row], is_mirrored: bool) -> Result<Skeleton, RigError> {
    const LEFT: &str = "Left";
    let mut bones: Vec<Bone> = Vec::new();
    let mut heads: Vec<DVec3> = Vec::new();
    let mut add = |name: String, parent: &str, head: DVec3, tail: DVec3| {
        let parent = bones.iter().position(|bone| bone.name == parent);
        let origin = parent.map_or(DVec3::ZERO, |parent| heads[parent]);
        let rest = Transform { translation: (head - origin).as_vec3(), ..Transform::IDENTITY };
        bones.push(Bone { name, parent, rest, tail: (tail - head).as_vec3() });
        heads.push(head);
    };
    for &(name, parent, head, tail) in rows {
        add(name.to_owned(), parent, head.into(), tail.into());
    }
    let of_left = rows.iter().filter_map(|row| Some((row.0.strip_prefix(LEFT)?, row)));
    for (name, &(_, parent, head, tail)) in of_left.filter(|_| is_mirrored) {
        let parent = parent.strip_prefix(LEFT).map_or_else(|| parent.to_owned(), |own| format!("Right{own}"));
        let image = |[x, y, z]: [f64; 3]| DVec3::new(-x, y, z);
        add(format!("Right{name}"), &parent, image(head), image(tail));
    }
    Ok(Skeleton::new(bones)?)
}
