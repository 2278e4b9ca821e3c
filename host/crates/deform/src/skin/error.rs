//! Why a character cannot be skinned.

/// Why a character cannot be skinned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SkinError {
    /// Two arrays that must have matching lengths do not.
    #[error("{what}: {got} given, {expected} needed")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it must have.
        expected: usize,
    },
    /// A rest position or rest normal is NaN or infinite.
    #[error("vertex {vertex} has a rest position or normal that is not finite")]
    VertexNotFinite {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// A vertex follows a bone (or, if vertices are bound in several poses, a binding) that does not exist.
    #[error("vertex {vertex} follows bone {bone}, but there are only {bone_count} bones")]
    BoneOutOfRange {
        /// Zero-based vertex.
        vertex: usize,
        /// The offending zero-based bone.
        bone: u16,
        /// How many bones there are.
        bone_count: usize,
    },
    /// A binding refers to a bone that does not exist.
    #[error("binding {binding} refers to bone {bone}, but there are only {bone_count} bones")]
    BindingOutOfRange {
        /// Zero-based binding.
        binding: usize,
        /// The offending zero-based bone.
        bone: u32,
        /// How many bones there are.
        bone_count: usize,
    },
    /// Meshes are bound in more poses than 16-bit numbers can distinguish.
    #[error(
        "there are {bindings} pairs of bone and bind pose, but at most 65,536 can be used; bind the meshes in fewer poses"
    )]
    TooManyBindings {
        /// How many there are.
        bindings: usize,
    },
    /// A rest frame has no inverse (zero scale, or not finite).
    #[error("the rest frame of bone {bone} cannot be inverted; give the bone a scale other than zero at rest")]
    RestNotInvertible {
        /// Zero-based bone.
        bone: usize,
    },
    /// The weight of a morph target is NaN or infinite.
    #[error("the weight of morph target {target} is not finite")]
    WeightNotFinite {
        /// Zero-based target.
        target: usize,
    },
    /// A frame of the pose is NaN or infinite; nothing was written.
    #[error("the pose of bone {bone} is not finite; nothing was skinned")]
    PoseNotFinite {
        /// Zero-based bone.
        bone: usize,
    },
}

pub(super) fn expect_length(what: &'static str, got: usize, expected: usize) -> Result<(), SkinError> {
    if got == expected { Ok(()) } else { Err(SkinError::Length { what, got, expected }) }
}
