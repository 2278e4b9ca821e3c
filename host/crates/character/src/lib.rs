//! The bound character: mesh, skeleton and weights ready to be posed; its cache file; and the characters that the
//! program makes itself.
//!
//! This crate does no I/O: bytes in, bytes out. It reads no clock and prints nothing. Long computations report
//! progress and can be cancelled. Equal input gives equal bytes whatever the number of threads.

mod bind;
mod bone_roles;
mod cache;
mod cache_bytes;
mod cache_key;
mod character;
mod held_pins;
mod inverse_kinematics;
mod misfit;
mod own;
mod pinned_bone;

pub use bind::{BindError, BindProgress, BindSettings, bind};
pub use bone_roles::BoneRole;
pub use cache::{CACHE_EXTENSION, CacheError, from_bytes, to_bytes};
pub use cache_key::{CacheKey, cache_key};
pub use character::{Character, HeatRecord, Provenance};
pub use inverse_kinematics::{IkError, InverseKinematics};
pub use misfit::Misfit;
pub use own::{hand, human, spider};
pub use pinned_bone::{PinHold, PinnedBone};
