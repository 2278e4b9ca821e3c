//! Motion capture files (Biovision hierarchy).
//!
//! Conventions where the format is ambiguous: rotation channels multiply in the order they are listed (`Zrotation
//! Xrotation Yrotation` is Rz·Rx·Ry on column vectors), angles in degrees; a position channel replaces the joint's
//! OFFSET on its axis, as in Blender and `MotionBuilder`, so a root's rest position survives.

mod hierarchy;
mod read;
mod write;

pub use read::{BvhMotion, read_bvh};
pub use write::{BvhSettings, write_bvh, write_bvh_as};
