//! The character's skeleton in its rest pose.

use std::collections::BTreeMap;

use glam::{Affine3A, Mat3, Quat, Vec3};

use super::transforms::{Pose, Transform, compose};

/// One segment of a skeleton.
#[derive(Clone, Debug, PartialEq)]
pub struct Bone {
    /// Unique within the skeleton.
    pub name: String,
    /// Index of the parent, always smaller than the bone's own; `None` for a root.
    pub parent: Option<usize>,
    /// Rest transform, `parent_from_bone` (for a root: `model_from_bone`). Its origin is the bone's head.
    pub rest: Transform,
    /// The bone's other end in its own rest frame; zero for a bone without length (a hub).
    pub tail: Vec3,
}

/// Bones, parents before children. Several roots are allowed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skeleton {
    bones: Vec<Bone>,
}

/// Why a list of bones is not a skeleton.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SkeletonError {
    /// A parent does not come before its child.
    #[error("bone {bone} ({name}) names parent {parent}, which does not come before it")]
    ParentAfterChild {
        /// Zero-based bone.
        bone: usize,
        /// Its name.
        name: String,
        /// The parent index given.
        parent: usize,
    },
    /// Two bones share a name.
    #[error("two bones are called {name:?}; mapping, takes and exports tell bones apart by name")]
    DuplicateName {
        /// The shared name.
        name: String,
    },
    /// A rest transform is NaN, infinite, of zero scale, or not a rotation.
    #[error(
        "the rest transform of bone {bone} ({name}) is not usable: it must be finite, with a unit rotation and a scale other than zero"
    )]
    BadRest {
        /// Zero-based bone.
        bone: usize,
        /// Its name.
        name: String,
    },
    /// More bones than an influence can index.
    #[error("{count} bones are too many; a skeleton can have at most {limit}")]
    TooMany {
        /// Bones given.
        count: usize,
        /// Bones possible.
        limit: usize,
    },
}

impl Skeleton {
    /// The largest number of bones a skeleton may have.
    pub const MAX_BONES: usize = u16::MAX as usize;

    /// Checks the bones and builds the skeleton.
    pub fn new(bones: Vec<Bone>) -> Result<Self, SkeletonError> {
        if bones.len() > Self::MAX_BONES {
            return Err(SkeletonError::TooMany { count: bones.len(), limit: Self::MAX_BONES });
        }
        let mut seen = BTreeMap::new();
        for (index, bone) in bones.iter().enumerate() {
            if let Some(parent) = bone.parent.filter(|&p| p >= index) {
                return Err(SkeletonError::ParentAfterChild { bone: index, name: bone.name.clone(), parent });
            }
            if seen.insert(bone.name.as_str(), index).is_some() {
                return Err(SkeletonError::DuplicateName { name: bone.name.clone() });
            }
            let scale = bone.rest.scale.abs().min_element();
            if !bone.rest.is_finite() || !bone.tail.is_finite() || !bone.rest.rotation.is_normalized() || scale <= 0.0 {
                return Err(SkeletonError::BadRest { bone: index, name: bone.name.clone() });
            }
        }
        Ok(Self { bones })
    }

    /// All bones, parents before children.
    pub fn bones(&self) -> &[Bone] {
        &self.bones
    }

    /// Number of bones.
    pub fn len(&self) -> usize {
        self.bones.len()
    }

    /// Whether there are no bones.
    pub fn is_empty(&self) -> bool {
        self.bones.is_empty()
    }

    /// Index of the bone with this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.bones.iter().position(|b| b.name == name)
    }

    /// Indices of the direct children of a bone, in order.
    pub fn children(&self, bone: usize) -> impl Iterator<Item = usize> + '_ {
        self.bones.iter().enumerate().filter(move |(_, b)| b.parent == Some(bone)).map(|(i, _)| i)
    }

    /// The rest pose.
    pub fn rest_pose(&self) -> Pose {
        Pose { parent_from_bone: self.bones.iter().map(|b| b.rest).collect() }
    }

    /// `model_from_bone` of every bone in the rest pose.
    pub fn rest_model_from_bone(&self) -> Vec<Affine3A> {
        let mut frames = vec![Affine3A::IDENTITY; self.len()];
        compose(&self.rest_pose().parent_from_bone, self.bones.iter().map(|bone| bone.parent), &mut frames);
        frames
    }

    /// Head and tail of every bone in model space, in the rest pose.
    pub fn rest_segments(&self) -> Vec<(Vec3, Vec3)> {
        let frames = self.rest_model_from_bone();
        frames.iter().zip(&self.bones).map(|(m, b)| (m.translation.into(), m.transform_point3(b.tail))).collect()
    }

    /// Where bones meet and end in the rest pose, in model space, each with the bone it hangs on: the head of every bone,
    /// in their order and with its parent, then the tail of every bone with a length and without children.
    pub fn rest_joints(&self) -> Vec<(Vec3, Option<usize>)> {
        let segments = self.rest_segments();
        let heads = self.bones.iter().zip(&segments).map(|(bone, (head, _))| (*head, bone.parent));
        let is_end =
            |&(bone, (head, tail)): &(usize, &(Vec3, Vec3))| self.children(bone).next().is_none() && head != tail;
        let ends = segments.iter().enumerate().filter(is_end).map(|(bone, (_, tail))| (*tail, Some(bone)));
        heads.chain(ends).collect()
    }

    /// `bone_from_joint`: the frame in which a joint that drives this bone turns.
    ///
    /// A joint's +Y (its twist axis) runs along the bone; its +X (its bend axis) is horizontal and perpendicular to
    /// both the bone and the character's view direction +Z; if the bone itself points forward, +X is perpendicular to
    /// the bone and to +Y. A knee, elbow or finger therefore bends about its own X axis. A bone without length turns in
    /// the model's own axes.
    pub fn bone_from_joint(&self, bone: usize, rest_model_from_bone: &[Affine3A]) -> Quat {
        let model_from_bone = rest_model_from_bone[bone];
        let model_rotation = rotation_of(&model_from_bone);
        let along = model_from_bone.transform_vector3(self.bones[bone].tail);
        let model_from_joint = along.try_normalize().map_or(Quat::IDENTITY, |y| {
            let reference = if y.z.abs() > 0.9 { Vec3::Y } else { Vec3::Z };
            let x = reference.cross(y).normalize();
            Quat::from_mat3(&Mat3::from_cols(x, y, x.cross(y)))
        });
        (model_rotation.inverse() * model_from_joint).normalize()
    }
}

fn rotation_of(frame: &Affine3A) -> Quat {
    frame.to_scale_rotation_translation().1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bone(name: &str, parent: Option<usize>, at: [f32; 3], tail: [f32; 3]) -> Bone {
        Bone {
            name: name.into(),
            parent,
            rest: Transform { translation: at.into(), ..Transform::IDENTITY },
            tail: tail.into(),
        }
    }

    #[test]
    fn segments_follow_the_hierarchy() {
        let skeleton = Skeleton::new(vec![
            bone("upper", None, [0.0, 1.0, 0.0], [0.0, -0.5, 0.0]),
            bone("lower", Some(0), [0.0, -0.5, 0.0], [0.0, -0.4, 0.0]),
        ])
        .unwrap();
        let segments = skeleton.rest_segments();
        assert!(segments[1].0.distance(Vec3::new(0.0, 0.5, 0.0)) < 1e-6);
        assert!(segments[1].1.distance(Vec3::new(0.0, 0.1, 0.0)) < 1e-6);
    }

    #[test]
    fn joint_frame_runs_along_the_bone_and_bends_sideways() {
        let skeleton = Skeleton::new(vec![bone("shin", None, [0.0; 3], [0.0, -1.0, 0.0])]).unwrap();
        let q = skeleton.bone_from_joint(0, &skeleton.rest_model_from_bone());
        assert!((q * Vec3::Y).distance(Vec3::NEG_Y) < 1e-6);
        assert!((q * Vec3::X).distance(Vec3::X) < 1e-6);
    }

    #[test]
    fn nonsense_is_named() {
        let twice = vec![bone("a", None, [0.0; 3], [0.0; 3]), bone("a", None, [0.0; 3], [0.0; 3])];
        assert_eq!(Skeleton::new(twice), Err(SkeletonError::DuplicateName { name: "a".into() }));
        let cycle = vec![bone("a", Some(0), [0.0; 3], [0.0; 3])];
        assert!(matches!(Skeleton::new(cycle), Err(SkeletonError::ParentAfterChild { .. })));
        let nan = vec![bone("a", None, [f32::NAN; 3], [0.0; 3])];
        assert!(matches!(Skeleton::new(nan), Err(SkeletonError::BadRest { .. })));
    }
}
