//! Skeleton, joint tree, calibration, mapping from joints to bones, and pose.
//!
//! Frames: right-handed, +Y up, the character looks along +Z. Angles in radians, lengths in the mesh's unit,
//! quaternions (x, y, z, w). `parent_from_bone` takes a point in the bone's frame to its parent's frame.
//! This crate does no I/O, knows no wire type and takes its trigonometry from `libm`, so that equal input
//! gives equal poses everywhere.

mod joint_tree;
mod motion;
mod pose;
mod sample;
mod skeleton;

pub use joint_tree::{JointAxis, JointTree, JointTreeError, Part, PartKind, PartUid};
pub use motion::{Motion, MotionError};
pub use pose::{Pose, Transform};
pub use sample::{RawSample, SensorState};
pub use skeleton::{Bone, Skeleton, SkeletonError};
