//! glTF 2.0, as JSON with buffers beside it and as GLB.
//!
//! The schema comes from `gltf-json`; buffers, accessors and the node tree are read here with every index, length and
//! count checked, because the crates' own readers trust them.

mod accessor;
mod animation;
mod buffer;
mod container;
mod nodes;
mod primitive;
mod read;
mod skin;
mod write;
mod write_clip;

pub(crate) use read::read_gltf;
pub use write::{GlbClip, GlbMesh, GlbScene, GlbTimes, write_glb};
