//! Motions: BVH, VRM animations, and keys in GLB files. glTF clips are read with the model, see [`read_model`](crate::read_model).

mod bvh;
mod glb_animation;
mod vrma;

pub use bvh::{BvhMotion, BvhSettings, read_bvh, write_bvh, write_bvh_as};
pub use glb_animation::{KeyInterpolation, KeyTrack, KeyedPart, add_clip, annotate_clips};
pub use vrma::{VrmaFile, write_vrma};
