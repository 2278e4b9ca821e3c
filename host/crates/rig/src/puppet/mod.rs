//! The puppet: its parts as plugged together ([`JointTree::new`]), one reading of its sensors ([`RawSample`]), and
//! joint rotations from angles and back ([`joint_rotation`], [`joint_angles`]).

mod joint_rotation;
mod joint_tree;
mod sample;
mod skeleton_puppet;

pub use joint_rotation::{joint_angles, joint_angles_near, joint_rotation, wrapped};
pub use joint_tree::{JointAxis, JointTree, JointTreeError, Part, PartKind, PartUid, PartUidError};
pub use sample::{RawSample, SensorState};
pub use skeleton_puppet::skeleton_puppet;
