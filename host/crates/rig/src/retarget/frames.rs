//! Poses in model space, in double precision.

use glam::{DQuat, DVec3};

use crate::skeleton::{Pose, Skeleton};

/// Where a bone is: rotations composed without scales, places with them.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    pub(super) rotation: DQuat,
    pub(super) head: DVec3,
}

/// The frames of a pose.
pub(super) fn frames(skeleton: &Skeleton, pose: &Pose) -> Vec<Frame> {
    let mut affine = vec![glam::DAffine3::IDENTITY; skeleton.len()];
    let mut out: Vec<Frame> = Vec::with_capacity(skeleton.len());
    for (index, (bone, local)) in skeleton.bones().iter().zip(&pose.parent_from_bone).enumerate() {
        let turn = local.rotation.as_dquat().normalize();
        let own =
            glam::DAffine3::from_scale_rotation_translation(local.scale.as_dvec3(), turn, local.translation.as_dvec3());
        affine[index] = bone.parent.map_or(own, |parent| affine[parent] * own);
        let rotation = bone.parent.map_or(turn, |parent| (out[parent].rotation * turn).normalize());
        out.push(Frame { rotation, head: affine[index].translation });
    }
    out
}

/// The frames of the rest pose, and the places of the bones' tails.
pub(super) fn rest_frames(skeleton: &Skeleton) -> (Vec<Frame>, Vec<DVec3>) {
    let frames = frames(skeleton, &skeleton.rest_pose());
    let tails = skeleton.rest_segments().iter().map(|(_, tail)| tail.as_dvec3()).collect();
    (frames, tails)
}

/// The shortest turn from one direction to another; none if one of them has no length.
pub(super) fn shortest(from: DVec3, to: DVec3) -> DQuat {
    match (from.try_normalize(), to.try_normalize()) {
        (Some(from), Some(to)) => DQuat::from_rotation_arc(from, to),
        _ => DQuat::IDENTITY,
    }
}
