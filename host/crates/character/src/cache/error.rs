//! Why bytes are not a character.

use super::format::FORMAT_VERSION;

/// Why bytes are not a character.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CacheError {
    /// The file does not start like a character file.
    #[error("this is not a character file (it does not begin with {:?}); bind a mesh to make one", "ARMATURE")]
    NotACharacter,
    /// The file was written in another layout.
    #[error(
        "this character file has format {found}, but formats up to {FORMAT_VERSION} can be read; bind the mesh again"
    )]
    Version {
        /// The version in the file.
        found: u32,
    },
    /// The file ends too early.
    #[error(
        "the character file ends too early: {needed} bytes needed at byte {byte}, {left} left; bind the mesh again"
    )]
    Truncated {
        /// Where reading stopped.
        byte: usize,
        /// Bytes wanted there.
        needed: usize,
        /// Bytes there.
        left: usize,
    },
    /// The checksum does not match the body.
    #[error("the character file is damaged: its checksum does not match; bind the mesh again")]
    Checksum,
    /// An impossible value.
    #[error("byte {byte} of the character file: {what}; bind the mesh again")]
    Malformed {
        /// Where in the file: just after the value.
        byte: usize,
        /// What is wrong.
        what: String,
    },
}
