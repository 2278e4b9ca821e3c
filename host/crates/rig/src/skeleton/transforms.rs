//! Where every bone is at one moment.

use glam::{Affine3A, Quat, Vec3};

/// Translation, rotation and scale, applied in the order scale, rotate, translate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transform {
    /// In the parent's frame and the mesh's unit.
    pub translation: Vec3,
    /// Unit quaternion.
    pub rotation: Quat,
    /// Factors along the bone's own axes; 1 unless an artist's rig says otherwise.
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

/// One transform per bone.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// In the skeleton's order; for a root, `model_from_bone`.
    pub parent_from_bone: Vec<Transform>,
}

/// Writes the frames of transforms, each relative to an earlier one, or to none.
pub(super) fn compose(transforms: &[Transform], parents: impl Iterator<Item = Option<usize>>, frames: &mut [Affine3A]) {
    for (index, (parent, local)) in parents.zip(transforms).enumerate() {
        let own = local.to_affine();
        frames[index] = parent.map_or(own, |parent| frames[parent] * own);
    }
}
