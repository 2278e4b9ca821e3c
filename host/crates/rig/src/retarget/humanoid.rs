//! The bones that humanoids have in common, and nothing else.

use glam::{DQuat, DVec3};

use super::frames::{frames, rest_frames};
use crate::mapping::{RestPose, rest_in};
use crate::recognise::{Figure, HumanoidBone, HumanoidPart, recognise};
use crate::skeleton::{Bone, Motion, MotionError, Pose, Skeleton, SkeletonError, Transform};

/// Why a motion is not that of a humanoid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HumanoidError {
    /// Another figure, or no hips.
    #[error("the skeleton is not recognised as a human with hips ({figure})")]
    NotHuman {
        /// What it is instead.
        figure: Figure,
    },
    /// The limbs cannot be brought to a T.
    #[error("the skeleton cannot be brought to a T-pose: {0}")]
    NoTPose(String),
    /// Bones that are no skeleton.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// Frames that are no motion.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// The motion of the recognised bones of a human alone, under the names of VRM 1.0 and as VRM has it: the hips are the
/// only root, each bone hangs on the recognised bone above it, rests in a T-pose with the axes of the model, and turns
/// about its head; only the hips move. At rest the feet are on the floor at height 0. Eyes and jaw are left out: other
/// means move those in VRM.
///
/// ```
/// use armature_rig::{Bone, Motion, Skeleton, Transform, humanoid_motion};
///
/// let bone = |name: &str, parent, at: [f32; 3], tail: [f32; 3]| Bone {
///     name: name.into(),
///     parent,
///     rest: Transform { translation: at.into(), ..Transform::IDENTITY },
///     tail: tail.into(),
/// };
/// let skeleton = Skeleton::new(vec![bone("stone", None, [0.0; 3], [0.0, 1.0, 0.0])])?;
/// let rest = skeleton.rest_pose();
/// let motion = Motion::new(skeleton, 0.04, vec![rest])?;
/// assert!(humanoid_motion(&motion).unwrap_err().to_string().contains("not recognised as a human"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn humanoid_motion(motion: &Motion) -> Result<Motion, HumanoidError> {
    let recognition = recognise(&motion.skeleton);
    let hips = recognition.find(HumanoidBone { part: HumanoidPart::Hips, side: None });
    let Some(hips) = hips.filter(|_| recognition.figure == Figure::Human) else {
        return Err(HumanoidError::NotHuman { figure: recognition.figure });
    };
    let t = rest_in(RestPose::T, &motion.skeleton).map_err(HumanoidError::NoTPose)?;
    let (rest, tails) = rest_frames(&t);
    let is_below_hips =
        |bone: usize| std::iter::successors(Some(bone), |&b| motion.skeleton.bones()[b].parent).any(|b| b == hips);
    let is_kept = |bone: usize| {
        let part = recognition.bones[bone].map(|found| found.bone.part);
        part.is_some_and(|part| !matches!(part, HumanoidPart::Eye | HumanoidPart::Jaw)) && is_below_hips(bone)
    };
    let kept: Vec<usize> = (0..motion.skeleton.len()).filter(|&bone| is_kept(bone)).collect();
    let parent_of = |bone: usize| {
        let above = std::iter::successors(motion.skeleton.bones()[bone].parent, |&b| motion.skeleton.bones()[b].parent);
        let found = above.into_iter().find_map(|above| kept.iter().position(|&kept| kept == above));
        found.filter(|_| bone != hips)
    };
    let feet = kept.iter().filter(|&&bone| {
        matches!(recognition.bones[bone].map(|found| found.bone.part), Some(HumanoidPart::Foot | HumanoidPart::Toes))
    });
    let floor = feet.flat_map(|&bone| [rest[bone].head.y, tails[bone].y]).fold(f64::INFINITY, f64::min);
    let floor = if floor.is_finite() { floor } else { 0.0 };
    let parents: Vec<Option<usize>> = kept.iter().map(|&bone| parent_of(bone)).collect();
    let bones = kept.iter().zip(&parents).map(|(&bone, parent)| {
        let head = rest[bone].head - parent.map_or(DVec3::new(0.0, floor, 0.0), |parent| rest[kept[parent]].head);
        Bone {
            name: recognition.bones[bone].map_or_else(String::new, |found| found.bone.to_string()),
            parent: *parent,
            rest: Transform { translation: head.as_vec3(), ..Transform::IDENTITY },
            tail: (tails[bone] - rest[bone].head).as_vec3(),
        }
    });
    let skeleton = Skeleton::new(bones.collect())?;
    let pose = |pose: &Pose| {
        let now = frames(&motion.skeleton, pose);
        let turn = |bone: usize| (now[bone].rotation * rest[bone].rotation.inverse()).normalize();
        let mut out = skeleton.rest_pose();
        for ((&bone, parent), local) in kept.iter().zip(&parents).zip(&mut out.parent_from_bone) {
            let above = parent.map_or(DQuat::IDENTITY, |parent| turn(kept[parent]));
            local.rotation = (above.inverse() * turn(bone)).normalize().as_quat().normalize();
            if parent.is_none() {
                local.translation = now[bone].head.as_vec3();
            }
        }
        out
    };
    let frames = motion.frames.iter().map(pose).collect();
    Ok(Motion::new(skeleton, motion.frame_seconds, frames)?)
}
