//! Motion capture files (Biovision hierarchy).
//!
//! Conventions, where the format leaves room: rotation channels multiply in the order they are listed
//! (`Zrotation Xrotation Yrotation` is Rz·Rx·Ry on column vectors), angles in degrees; a position channel replaces
//! the joint's OFFSET on its axis, as Blender and `MotionBuilder` have it, so a root's rest position survives.

mod hierarchy;
mod read;
mod write;

pub use read::read_bvh;
pub use write::write_bvh;

/// What a channel moves; the number is the axis, x = 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Channel {
    Position(usize),
    Rotation(usize),
}
