//! Why a character has no inverse kinematics.

use armature_deform::arap::ArapError;
use armature_deform::skin::SkinError;
use armature_rig::Skeleton;
use armature_weights::biharmonic::BiharmonicError;

use crate::volume::MakeError;

/// Why a character has no inverse kinematics.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum IkError {
    /// The skeleton has no such bone.
    #[error("there is no bone {name:?}{}", nearest.as_ref().map_or_else(String::new, |n| format!("; did you mean {n:?}?")))]
    UnknownBone {
        /// The name given.
        name: String,
        /// A bone whose name differs only in case.
        nearest: Option<String>,
    },
    /// A limit that does not contain the rest pose, or is no angle.
    #[error("the limit of {bone:?} must be angles of at most half a turn, with the rest pose between them")]
    UnusableLimit {
        /// The bone.
        bone: String,
    },
    /// The shape cannot be reduced to its bones.
    #[error("the shape cannot be posed by a few of its bones: {0}")]
    Shape(#[from] ArapError),
    /// The volume inside the character cannot be made.
    #[error("the volume inside the character cannot be made: {0}")]
    Volume(MakeError),
    /// The character is flat, or no volume of it is left.
    #[error("the character has no inside; choose the energy of its surface")]
    NoInside,
    /// The weights inside the character cannot be found.
    #[error("the weights inside the character cannot be found: {0}")]
    Weights(BiharmonicError),
    /// The character cannot be brought into its rest pose.
    #[error(transparent)]
    Skin(#[from] SkinError),
}

pub(super) fn find_bone(skeleton: &Skeleton, name: &str) -> Result<usize, IkError> {
    skeleton.find(name).ok_or_else(|| {
        let alike = skeleton.bones().iter().find(|bone| bone.name.eq_ignore_ascii_case(name));
        IkError::UnknownBone { name: name.to_owned(), nearest: alike.map(|bone| bone.name.clone()) }
    })
}
