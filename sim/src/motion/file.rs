//! Puppets and tracks from recorded motion.

use armature_rig::{JointTreeError, Motion, Skeleton, skeleton_puppet};
use firmware_protocol::PartKind;
use glam::DQuat;

use super::track::{JointTrack, TrackEnd};
use crate::body::{Body, BodyBuilder, BodyError};

/// Why a puppet cannot play a motion.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionFileError {
    /// There are no bones.
    #[error("the motion has no bones; choose a file with a hierarchy")]
    NoBones,
    /// The bones cannot be turned into a puppet.
    #[error(transparent)]
    Tree(#[from] JointTreeError),
    /// Too many bones.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// No bone has the name of a human joint.
    #[error(
        "none of the {bones} bones has a name like Hips, LeftUpLeg or LeftForeArm; play the motion on its own puppet instead"
    )]
    NoKnownBones {
        /// Bones of the motion.
        bones: usize,
    },
    /// The body lacks a part that the motion needs.
    #[error("the puppet has no joint called {label}; only the human preset can play another figure's motion")]
    NotHuman {
        /// The label that was looked for.
        label: &'static str,
    },
}

/// A puppet with one three-axis joint per bone, splitters where a bone has several children, and the motion as its
/// track. Parts are labelled with their bones' names. The figure's movement through space is lost: a puppet only knows
/// its joints.
pub fn puppet_from_motion(motion: &Motion, seed: u64) -> Result<(Body, JointTrack), MotionFileError> {
    let skeleton = &motion.skeleton;
    if skeleton.is_empty() {
        return Err(MotionFileError::NoBones);
    }
    let number = |index: usize| {
        let mut uid = armature_rig::PartUid::default();
        uid.0[4..].copy_from_slice(&(index as u64).to_be_bytes());
        uid
    };
    let (tree, part_of_bone) = skeleton_puppet(skeleton, 2, number)?;
    let mut label_of_part: Vec<Option<&str>> = vec![None; tree.parts().len()];
    for (bone, &part) in part_of_bone.iter().enumerate() {
        label_of_part[part] = Some(&skeleton.bones()[bone].name);
    }
    let mut builder = BodyBuilder::new("motion", seed);
    for (index, part) in tree.parts().iter().enumerate() {
        match (part.kind, label_of_part[index]) {
            (armature_rig::PartKind::Splitter { outlets }, _) => {
                builder.splitter(format!("splitter {index}"), outlets, part.parent)
            }
            (_, label) => builder.joint(label.unwrap_or_default(), PartKind::TwistBendTwist, part.parent),
        };
    }
    let frames = skeleton.rest_model_from_bone();
    let joint_frames: Vec<DQuat> =
        (0..skeleton.len()).map(|bone| skeleton.bone_from_joint(bone, &frames).as_dquat().normalize()).collect();
    let mut rotations = Vec::with_capacity(motion.frames.len() * skeleton.len());
    for pose in &motion.frames {
        for ((bone, local), f) in skeleton.bones().iter().zip(&pose.parent_from_bone).zip(&joint_frames) {
            let turn = bone.rest.rotation.as_dquat().inverse() * local.rotation.as_dquat();
            rotations.push((f.inverse() * turn * *f).normalize().to_array());
        }
    }
    let (frame_seconds, end) = (motion.frame_seconds, TrackEnd::Hold);
    Ok((builder.finish()?, JointTrack { frame_seconds, parts: part_of_bone, rotations, end }))
}

/// Model-space rotations of all bones, parents first.
pub(super) fn model_rotations(skeleton: &Skeleton, pose: &armature_rig::Pose) -> Vec<DQuat> {
    let mut rotations: Vec<DQuat> = Vec::with_capacity(skeleton.len());
    for (bone, local) in skeleton.bones().iter().zip(&pose.parent_from_bone) {
        let local = local.rotation.as_dquat().normalize();
        rotations.push(bone.parent.map_or(local, |parent| rotations[parent] * local));
    }
    rotations
}
