//! Motions: BVH, and keys in GLB files. glTF clips are read with the model, see [`read_model`](crate::read_model).

mod bvh;
mod glb_animation;

pub use bvh::{BvhMotion, read_bvh, write_bvh};
pub use glb_animation::{KeyInterpolation, KeyTrack, KeyedPart, add_clip, annotate_clips};
