//! glTF 2.0, as JSON with separate buffers and as GLB.
//!
//! The schema comes from `gltf-json`; buffers, accessors and the node tree are read here with every index, length and
//! count checked, because the crates' own readers trust them.

mod accessor;
mod animation;
mod buffer;
mod container;
mod draco;
mod follow;
mod gather;
mod meshopt;
mod nodes;
mod open;
pub(crate) mod pieces;
pub(crate) mod points;
mod primitive;
mod read;
mod read_material;
mod rest;
pub(crate) mod scene;
mod skeleton;
mod skin;
mod turn;
mod vrm;
mod write;
pub(crate) mod write_clip;
mod write_material;
pub(crate) mod write_skin;
mod write_surface;

pub(crate) use read::read_gltf;
pub use scene::{GlbClip, GlbMesh, GlbScene, GlbTimes};
pub use skeleton::read_gltf_skeleton;
pub use write::write_glb;
