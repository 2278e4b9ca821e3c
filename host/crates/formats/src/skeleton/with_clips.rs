//! What a file with bones holds, whether it has a mesh or not.

use armature_rig::{Motion, Skeleton};

/// A skeleton with its clips.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SkeletonWithClips {
    /// The bones.
    pub skeleton: Skeleton,
    /// Named clips on it.
    pub motions: Vec<(String, Motion)>,
    /// Whether the file has a mesh as well.
    pub has_mesh: bool,
    /// What was unusual, ignored or repaired, in sentences for the user.
    pub warnings: Vec<String>,
}
