//! From transforms between bones to frames in the model.

use glam::Affine3A;

use super::bones::Skeleton;
use super::transforms::{Pose, compose};

impl Pose {
    /// Writes `model_from_bone` of every bone; does not allocate.
    ///
    /// ```
    /// use armature_rig::{Bone, Skeleton, Transform};
    /// use glam::{Affine3A, Quat, Vec3};
    ///
    /// let bone = |name: &str, parent, at| Bone {
    ///     name: name.into(),
    ///     parent,
    ///     rest: Transform { translation: at, ..Transform::IDENTITY },
    ///     tail: Vec3::Y,
    /// };
    /// let skeleton = Skeleton::new(vec![bone("upper", None, Vec3::ZERO), bone("lower", Some(0), Vec3::Y)])?;
    /// let mut pose = skeleton.rest_pose();
    /// pose.parent_from_bone[0].rotation = Quat::from_rotation_z(std::f32::consts::FRAC_PI_2);
    /// let mut model_from_bone = vec![Affine3A::IDENTITY; skeleton.len()];
    /// pose.forward_kinematics(&skeleton, &mut model_from_bone);
    /// assert!(model_from_bone[1].translation.distance(Vec3::NEG_X.into()) < 1e-6);
    /// # Ok::<(), armature_rig::SkeletonError>(())
    /// ```
    ///
    /// # Panics
    /// If the pose or `model_from_bone` has a different length than the skeleton.
    pub fn forward_kinematics(&self, skeleton: &Skeleton, model_from_bone: &mut [Affine3A]) {
        assert_eq!(self.parent_from_bone.len(), skeleton.len());
        assert_eq!(model_from_bone.len(), skeleton.len());
        compose(&self.parent_from_bone, skeleton.bones().iter().map(|bone| bone.parent), model_from_bone);
    }
}
