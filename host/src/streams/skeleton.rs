//! What is streamed: a skeleton, known from the start, and its poses.

use armature_rig::{Figure, HumanoidBone, ShapeWeights, Skeleton, recognise};
use glam::{Affine3A, Quat, Vec3};

/// A bone of a streamed skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct StreamedBone {
    /// As in the character's file.
    pub name: String,
    /// Index of the parent, less than the bone's own.
    pub parent: Option<usize>,
    /// From the bone's to model space, in the rest pose.
    pub rest_model_from_bone: Affine3A,
    /// Which bone of a humanoid it is, if it was recognised.
    pub humanoid: Option<HumanoidBone>,
}

/// A skeleton whose poses are streamed. Model space is right-handed with Y up; the character looks along +Z, its left is
/// +X. Lengths are the character's (metres in glTF files).
#[derive(Clone, Debug, PartialEq)]
pub struct StreamedSkeleton {
    /// The character's name.
    pub subject: String,
    /// What it is.
    pub figure: Figure,
    /// Its bones, parents first.
    pub bones: Vec<StreamedBone>,
}

/// A pose of a streamed skeleton.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StreamedPose {
    /// The device's clock, seconds.
    pub seconds: f64,
    /// n transforms from a bone's to model space, in the skeleton's order.
    pub model_from_bone: Vec<Affine3A>,
    /// Weights of blend shapes that are set by hand or by joints.
    pub shapes: ShapeWeights,
}

impl StreamedSkeleton {
    /// A character's skeleton.
    pub fn new(subject: &str, skeleton: &Skeleton) -> Self {
        let rest = skeleton.rest_model_from_bone();
        let recognised = recognise(skeleton);
        let bones = skeleton.bones().iter().zip(rest).zip(recognised.bones);
        Self {
            subject: subject.to_owned(),
            figure: recognised.figure,
            bones: bones
                .map(|((bone, rest_model_from_bone), recognised)| StreamedBone {
                    name: bone.name.clone(),
                    parent: bone.parent,
                    rest_model_from_bone,
                    humanoid: recognised.map(|recognised| recognised.bone),
                })
                .collect(),
        }
    }

    /// How a bone is turned in model space compared with its rest pose.
    pub fn turn(&self, bone: usize, pose: &StreamedPose) -> Quat {
        let rest = rotation(&self.bones[bone].rest_model_from_bone);
        (rotation(&pose.model_from_bone[bone]) * rest.inverse()).normalize()
    }

    /// How far a bone's head is from where it rests, in model space.
    pub fn shift(&self, bone: usize, pose: &StreamedPose) -> Vec3 {
        Vec3::from(pose.model_from_bone[bone].translation - self.bones[bone].rest_model_from_bone.translation)
    }

    /// A bone's transform in its parent's space, in model space for a root.
    pub fn parent_from_bone(&self, bone: usize, pose: &StreamedPose) -> Affine3A {
        let model_from_bone = pose.model_from_bone[bone];
        self.bones[bone]
            .parent
            .map_or(model_from_bone, |parent| pose.model_from_bone[parent].inverse() * model_from_bone)
    }

    /// The nearest bone above that was recognised as part of a humanoid.
    pub fn humanoid_parent(&self, bone: usize) -> Option<usize> {
        let mut above = self.bones[bone].parent;
        while let Some(index) = above.filter(|&index| self.bones[index].humanoid.is_none()) {
            above = self.bones[index].parent;
        }
        above
    }
}

/// A transform's rotation, without its scale; none if it is degenerate.
pub(super) fn rotation(transform: &Affine3A) -> Quat {
    let (_, rotation, _) = transform.to_scale_rotation_translation();
    if rotation.is_finite() { rotation.normalize() } else { Quat::IDENTITY }
}
