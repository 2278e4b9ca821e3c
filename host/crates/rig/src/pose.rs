//! Where every bone is at one moment.

use glam::{Affine3A, Quat, Vec3};

use crate::Skeleton;

/// Translation, rotation and scale, applied in the order scale, rotate, translate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// In the parent's frame and the mesh's unit.
    pub translation: Vec3,
    /// Unit quaternion.
    pub rotation: Quat,
    /// Factors along the own axes; one unless an artist's rig says otherwise.
    pub scale: Vec3,
}

impl Transform {
    /// No change.
    pub const IDENTITY: Self = Self { translation: Vec3::ZERO, rotation: Quat::IDENTITY, scale: Vec3::ONE };

    /// As an affine map.
    pub fn to_affine(self) -> Affine3A {
        Affine3A::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }

    /// Whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.translation.is_finite() && self.rotation.is_finite() && self.scale.is_finite()
    }
}

/// One transform a bone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// In the skeleton's order; for a root, `model_from_bone`.
    pub parent_from_bone: Vec<Transform>,
}

impl Pose {
    /// Writes `model_from_bone` of every bone; allocates nothing.
    ///
    /// # Panics
    /// If the pose or `model_from_bone` has another length than the skeleton.
    pub fn forward_kinematics(&self, skeleton: &Skeleton, model_from_bone: &mut [Affine3A]) {
        assert_eq!(self.parent_from_bone.len(), skeleton.len());
        assert_eq!(model_from_bone.len(), skeleton.len());
        for (index, (bone, local)) in skeleton.bones().iter().zip(&self.parent_from_bone).enumerate() {
            let parent_from_bone = local.to_affine();
            model_from_bone[index] =
                bone.parent.map_or(parent_from_bone, |parent| model_from_bone[parent] * parent_from_bone);
        }
    }
}
