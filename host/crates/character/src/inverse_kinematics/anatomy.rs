//! How far the joints of a human turn.

use std::f64::consts::PI;

use armature_rig::{Figure, HumanoidPart, Skeleton, recognise};
use glam::Vec3;

use super::joint_limit::{JointLimit, LimitedBone};

/// A knee or an elbow bends as far as this from straight, degrees.
const WHOLLY_BENT: f64 = 150.0;
/// A knee or an elbow that is solved for keeps so much of the bend that it has at rest, degrees: nearer to straight, a small
/// way of its end turns it far.
const KEEPS_BENT: f64 = 6.0;
/// What a hinge gives to the side, degrees.
const PLAY: f64 = 3.0;

/// Limits of the bones of a recognised human, away from rest: knees and elbows as hinges that bend one way;
/// spine, neck, hips, shoulders and feet as far as people turn them. In whole tenths of a degree, so that the text of a
/// limit says all of it. Empty for anything else.
pub fn anatomical_limits(skeleton: &Skeleton) -> Vec<LimitedBone> {
    let recognition = recognise(skeleton);
    if recognition.figure != Figure::Human {
        return Vec::new();
    }
    let segments = skeleton.rest_segments();
    let frames = skeleton.rest_model_from_bone();
    let limited = skeleton.bones().iter().zip(&recognition.bones).enumerate().filter_map(|(index, (bone, found))| {
        let part = found.as_ref()?.bone.part;
        // By how much the joint is bent at rest, about the axis that it bends about.
        let bent = bone.parent.map_or(0.0, |parent| {
            let along = |bone: usize| segments[bone].1 - segments[bone].0;
            let above = segments[index].0 - segments[parent].0;
            let rotation = frames[index].to_scale_rotation_translation().1;
            bend_between(above, along(index), rotation * skeleton.bone_from_joint(index, &frames) * Vec3::X)
        });
        let limit = limit_of(part, bent)?;
        let text = LimitedBone { bone: bone.name.clone(), limit }.to_string();
        text.parse().ok()
    });
    limited.collect()
}

/// `bent`: of a hinge at rest, about +X of its joint, radians.
fn limit_of(part: HumanoidPart, bent: f64) -> Option<JointLimit> {
    let degrees = |bend: [f64; 2], lean: f64, roll: f64| JointLimit {
        bend: bend.map(f64::to_radians),
        lean: [-lean, lean].map(f64::to_radians),
        roll: [-roll, roll].map(f64::to_radians),
    };
    let most = WHOLLY_BENT.to_radians();
    let straighter = |bent: f64| (bent - KEEPS_BENT.to_radians()).max(0.0);
    Some(match part {
        // A knee bends about +X, an elbow the other way; a joint that rests beyond straight goes no further.
        HumanoidPart::LowerLeg => {
            JointLimit { bend: [-straighter(bent), (most - bent).clamp(0.0, PI)], ..degrees([0.0; 2], PLAY, 30.0) }
        }
        HumanoidPart::LowerArm => {
            JointLimit { bend: [(-most - bent).clamp(-PI, 0.0), straighter(-bent)], ..degrees([0.0; 2], PLAY, 90.0) }
        }
        HumanoidPart::Spine | HumanoidPart::Chest | HumanoidPart::UpperChest => degrees([-35.0, 45.0], 35.0, 40.0),
        HumanoidPart::Neck | HumanoidPart::Head => degrees([-50.0, 50.0], 40.0, 60.0),
        HumanoidPart::UpperLeg => degrees([-130.0, 40.0], 60.0, 50.0),
        HumanoidPart::Foot => degrees([-50.0, 50.0], 30.0, 30.0),
        HumanoidPart::Toes => degrees([-60.0, 60.0], 10.0, 10.0),
        HumanoidPart::Shoulder => degrees([-35.0, 35.0], 35.0, 20.0),
        HumanoidPart::UpperArm => degrees([-140.0, 60.0], 110.0, 100.0),
        HumanoidPart::Hand => degrees([-80.0, 80.0], 45.0, 30.0),
        _ => return None,
    })
}

/// The angle from one direction to the other about an axis, radians.
fn bend_between(from: Vec3, to: Vec3, axis: Vec3) -> f64 {
    let flat = |v: Vec3| v - axis * v.dot(axis);
    let (from, to) = (flat(from), flat(to));
    f64::from(libm::atan2f(from.cross(to).dot(axis), from.dot(to)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::own;

    #[test]
    fn knees_and_elbows_of_the_human_bend_one_way() {
        let skeleton = own::human().unwrap().skeleton;
        let limits = anatomical_limits(&skeleton);
        let of = |name: &str| limits.iter().find(|limited| limited.bone == name).map(|limited| limited.limit).unwrap();
        for side in ["Left", "Right"] {
            let (knee, elbow) = (of(&format!("{side}LowerLeg")), of(&format!("{side}LowerArm")));
            assert!(knee.bend[0] > -0.15 && knee.bend[1] > 2.3, "{knee:?}");
            assert!(elbow.bend[1] < 0.15 && elbow.bend[0] < -2.3, "{elbow:?}");
        }
        assert!(limits.iter().all(|limited| limited.limit.is_sound()));
        assert!(limits.len() >= 18, "{}", limits.len());
    }
}
