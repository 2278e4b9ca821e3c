//! Skeleton, joint tree, calibration, mapping from joints to bones, and pose.
//!
//! Frames: right-handed, +Y up, the character looks along +Z. Angles in radians, lengths in the mesh's unit,
//! quaternions (x, y, z, w). `parent_from_bone` takes a point in the bone's frame to its parent's frame.
//! This crate does no I/O, knows no wire type and takes its trigonometry from `libm`, so that equal input
//! gives equal poses everywhere.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests ask for exactly the documented value"))]

mod alignment;
mod assignment;
mod calibration;
mod calibration_step;
mod child_order;
mod completion;
mod engagement;
mod filter;
mod joint_rotation;
mod joint_tree;
mod mapping;
mod measure;
mod motion;
mod mounting;
mod pose;
mod pose_solver;
mod propose;
mod sample;
mod skeleton;
mod skeleton_puppet;
mod step_report;
mod stream_solver;

pub use calibration::{
    Calibration, CalibrationError, PartSettings, SensorCalibration, SensorRange, SkippedSensor, ZeroReport,
};
pub use calibration_step::{CalibrationRun, CalibrationStep, Progress, Reading, StepError, StepTimes, UnknownStep};
pub use child_order::ChildOrder;
pub use completion::PoseCompletion;
pub use filter::{DEFAULT_PATIENCE_SECONDS, Filter, FilterError, OneEuro};
pub use joint_rotation::{joint_angles, joint_angles_near, joint_rotation, wrapped};
pub use joint_tree::{JointAxis, JointTree, JointTreeError, Part, PartKind, PartUid, PartUidError};
pub use mapping::{Mapping, MappingEntry, MappingError};
pub use motion::{Motion, MotionError};
pub use mounting::{Mounting, MountingError, mounting_from_axes, mounting_from_axis};
pub use pose::{Pose, Transform};
pub use pose_solver::{BoneQuality, BoneStatus, PoseSolver, SampleError};
pub use propose::{Proposal, propose};
pub use sample::{RawSample, SensorState};
pub use skeleton::{Bone, Skeleton, SkeletonError};
pub use skeleton_puppet::skeleton_puppet;
pub use step_report::{Finding, StepFinding, StepReport};
pub use stream_solver::{SolveError, StreamSolver};
