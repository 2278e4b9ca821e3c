//! Legs that no joint turns: the foot stays, the knee bends as a hinge, whatever the hips do.

use glam::{Affine3A, DMat3, DQuat, DVec3};

use crate::recognise::{HumanoidPart, Recognition};
use crate::skeleton::{Pose, Skeleton};

/// Beyond this share of a leg's length it stretches out ever more slowly, unless its rest is straighter: so a foot out of
/// reach is approached without a jump of the knee.
const NEARLY_STRAIGHT: f64 = 0.98;
/// The same for a leg that rests straight.
const STRAIGHT: f64 = 0.9999;
/// A leg that rests straighter than this bends as its joint would, sine of the angle.
const TELLS_ITS_BEND: f64 = 0.02;
/// Shorter vectors have no direction, as a share of the leg's length.
const TINY: f64 = 1e-6;

/// Thigh, shin and foot, or upper arm, forearm and hand.
#[derive(Clone, Debug)]
pub(super) struct Leg {
    thigh: usize,
    shin: usize,
    foot: usize,
    /// About which a shin bends forward to back, in the frames of the three bones.
    hinges: [DVec3; 3],
    lengths: [f64; 2],
    /// Up to this distance of the foot from the hip a target is met exactly.
    reach: f64,
}

impl Leg {
    /// The leg that ends in a bone; `None` where two bones with a length above it are missing, or hang on nothing.
    pub(super) fn above(skeleton: &Skeleton, recognition: &Recognition, foot: usize) -> Option<Self> {
        let bones = skeleton.bones();
        let ancestors = || std::iter::successors(bones[foot].parent, |&bone| bones[bone].parent);
        let part =
            |bone: usize| recognition.bones.get(bone).and_then(|found| found.as_ref()).map(|found| found.bone.part);
        let of =
            |wanted: [HumanoidPart; 2]| ancestors().find(|&bone| part(bone).is_some_and(|part| wanted.contains(&part)));
        let shin = of([HumanoidPart::LowerLeg, HumanoidPart::LowerArm]).or(bones[foot].parent)?;
        let thigh = of([HumanoidPart::UpperLeg, HumanoidPart::UpperArm]).or(bones[shin].parent)?;
        bones[thigh].parent?;
        let frames = skeleton.rest_model_from_bone();
        let head = |bone: usize| frames[bone].translation.as_dvec3();
        let (upper, lower) = (head(shin) - head(thigh), head(foot) - head(shin));
        let lengths = [upper.length(), lower.length()];
        let whole = lengths[0] + lengths[1];
        if !(lengths[0] > TINY * whole && lengths[1] > TINY * whole) {
            return None;
        }
        let across = upper.cross(lower) / (lengths[0] * lengths[1]);
        let joint = skeleton.bone_from_joint(shin, &frames).as_dquat() * DVec3::X;
        let about = (turn_of(&frames[shin]) * joint).normalize();
        // An elbow bends the other way, and a knee that rests beyond straight no further.
        let about = if part(shin) == Some(HumanoidPart::LowerArm) { -about } else { about };
        let tells = across.length() > TELLS_ITS_BEND && (part(shin).is_none() || across.dot(about) > 0.0);
        let hinge = if tells { across.normalize() } else { about };
        let at_rest = (head(foot) - head(thigh)).length() / whole;
        Some(Self {
            hinges: [thigh, shin, foot].map(|bone| turn_of(&frames[bone]).inverse() * hinge),
            reach: whole * at_rest.clamp(NEARLY_STRAIGHT, STRAIGHT),
            thigh,
            shin,
            foot,
            lengths,
        })
    }

    /// Whether no joint turns thigh or shin.
    pub(super) fn is_free(&self, driven: &[bool]) -> bool {
        [self.thigh, self.shin].iter().all(|&bone| !driven.get(bone).copied().unwrap_or(false))
    }

    pub(super) fn thigh(&self) -> usize {
        self.thigh
    }

    /// How much too high the hip is for a foot there to be in reach, mesh units; negative if it could be higher.
    pub(super) fn too_high(&self, hip: DVec3, foot: DVec3) -> f64 {
        let away = (hip - foot).with_y(0.0).length_squared();
        hip.y - foot.y - (self.reach * self.reach - away).max(0.0).sqrt()
    }

    /// Turns thigh, shin and foot so that the foot is at `place`, turned to `turn` (both in the model), or stretched out
    /// towards it. `frames`: `model_from_bone` of the pose, to which the turns are written too. The knee points between
    /// where hips and foot face.
    pub(super) fn step_to(
        &self,
        place: DVec3,
        turn: DQuat,
        skeleton: &Skeleton,
        pose: &mut Pose,
        frames: &mut [Affine3A],
    ) {
        let head = |bone: usize| frames[bone].translation.as_dvec3();
        let (hip, knee, ankle) = (head(self.thigh), head(self.shin), head(self.foot));
        let turns = [self.thigh, self.shin].map(|bone| turn_of(&frames[bone]));
        let [upper, lower] = self.lengths;
        let Some(along) = (place - hip).try_normalize() else { return };
        let distance = self.eased((place - hip).length());
        let across = |v: DVec3| (v - along * v.dot(along)).try_normalize();
        let (of_thigh, of_foot) = (turns[0] * self.hinges[0], turn * self.hinges[2]);
        let hinge = across(of_thigh + of_foot).or_else(|| across(of_thigh)).or_else(|| across(of_foot));
        let Some(hinge) = hinge else { return };
        let forward = (upper * upper - lower * lower + distance * distance) / (2.0 * distance);
        let aside = (upper * upper - forward * forward).max(0.0).sqrt();
        let new_knee = hip + forward * along + aside * along.cross(hinge);
        let new_ankle = hip + distance * along;
        let upper_turn = turned(knee - hip, of_thigh, new_knee - hip, hinge);
        let lower_turn = turned(ankle - knee, turns[1] * self.hinges[1], new_ankle - new_knee, hinge);
        let (Some(upper_turn), Some(lower_turn)) = (upper_turn, lower_turn) else { return };
        let new = [(self.thigh, upper_turn * turns[0]), (self.shin, lower_turn * turns[1]), (self.foot, turn)];
        for (bone, turn) in new {
            let Some(parent) = skeleton.bones()[bone].parent else { continue };
            pose.parent_from_bone[bone].rotation = (turn_of(&frames[parent]).inverse() * turn).normalize().as_quat();
            // What is between the three bones goes along.
            for below in bone..=self.foot {
                if let Some(parent) = skeleton.bones()[below].parent {
                    frames[below] = frames[parent] * pose.parent_from_bone[below].to_affine();
                }
            }
        }
    }

    /// A distance of the foot from the hip that the leg can have, at a slope that never jumps.
    fn eased(&self, distance: f64) -> f64 {
        let [upper, lower] = self.lengths;
        let left = upper + lower - self.reach;
        let within = if distance > self.reach {
            self.reach - left * libm::expm1((self.reach - distance) / left)
        } else {
            distance
        };
        within.max((upper - lower).abs() + TINY * (upper + lower))
    }
}

/// The rotation of a frame.
pub(super) fn turn_of(frame: &Affine3A) -> DQuat {
    frame.to_scale_rotation_translation().1.as_dquat().normalize()
}

/// The rotation that takes one direction and the axis across it to another pair.
fn turned(from: DVec3, from_axis: DVec3, to: DVec3, to_axis: DVec3) -> Option<DQuat> {
    let basis = |along: DVec3, axis: DVec3| {
        let along = along.try_normalize()?;
        let across = (axis - along * axis.dot(along)).try_normalize()?;
        Some(DMat3::from_cols(along, across, along.cross(across)))
    };
    let turn = DQuat::from_mat3(&(basis(to, to_axis)? * basis(from, from_axis)?.transpose()));
    turn.is_finite().then(|| turn.normalize())
}
