//! Skinning: where every vertex goes when the bones move.
//!
//! What repeats per frame is split in two: a `precompute` that is built once for a character and a `solve` that
//! runs every frame and allocates nothing. Pose time is `f32`. This crate does no I/O and reads no clock.

mod linear_blend_skinning;

pub use linear_blend_skinning::{LinearBlendSkin, SkinError};
