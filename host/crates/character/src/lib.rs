//! The bound character: mesh, skeleton and weights ready to be posed; its cache file; and the characters that the
//! program makes itself.
//!
//! This crate does no I/O: bytes in, bytes out. It reads no clock and prints nothing. Long computations report
//! progress and can be cancelled. Equal input gives equal bytes whatever the number of threads.

mod bind;
mod bind_weights;
mod bone_roles;
mod cache;
mod cache_bytes;
mod cache_key;
mod cache_record;
mod cage_facets;
mod character;
mod comfort;
mod handle_weights;
mod held_pins;
mod hold_vertices;
mod inverse_kinematics;
mod make_volume;
mod misfit;
mod own;
mod pinned_bone;
mod preferred_bone;
mod weight_domain;
mod weight_warnings;

pub use bind::{BindError, BindMethod, BindProgress, BindSettings, WEIGHT_VOLUME_VERTICES, bind};
pub use bone_roles::BoneRole;
pub use cache::{CACHE_EXTENSION, CacheError, from_bytes, to_bytes};
pub use cache_key::{CacheKey, cache_key};
pub use character::{BiharmonicRecord, Character, HeatRecord, Provenance, WeightsRecord};
pub use comfort::Comfort;
pub use handle_weights::{
    BiharmonicTier, HandleWeights, HandleWeightsError, HandleWeightsSettings, Held, Partition, handle_weights,
};
pub use inverse_kinematics::{IkError, InverseKinematics};
pub use make_volume::{FlatDomain, Made, MakeError, make_volume};
pub use misfit::Misfit;
pub use own::{hand, human, spider};
pub use pinned_bone::{PinHold, PinnedBone};
pub use preferred_bone::{PreferredBone, UnknownPreference};
pub use weight_domain::{DomainKind, HandlePlace, HandleShape, WeightsOn};
