//! From the readings of a puppet's sensors to the pose of a character's bones: skeleton, joint tree, calibration,
//! mapping from joints to bones, and pose.
//!
//! From a sample to a pose, for a puppet that has one joint per bone:
//!
//! ```
//! use armature_rig::{Bone, Calibration, PartUid, RawSample, SensorState, Skeleton, StreamSolver, Transform};
//! use armature_rig::{propose, skeleton_puppet};
//!
//! let arm = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
//! let skeleton = Skeleton::new(vec![arm])?;
//! let (tree, _) = skeleton_puppet(&skeleton, 4096, |part| PartUid([part as u8; 12]))?;
//! let sample = |counts| RawSample { counts, states: vec![SensorState::Ok; 3], ..RawSample::default() };
//! let mut calibration = Calibration::for_tree(&tree);
//! calibration.zero(&tree, &sample(vec![1000, 2000, 3000]))?;
//! let mut solver = StreamSolver::new(skeleton.clone());
//! solver.set_mapping(propose(&tree, &skeleton).mapping);
//! solver.set_calibration(calibration);
//! solver.set_topology(0, tree);
//! let pose = solver.solve(&sample(vec![1000, 2000 + 1024, 3000]))?;
//! let tip = pose.parent_from_bone[0].to_affine().transform_point3(skeleton.bones()[0].tail);
//! assert!(tip.distance([0.0, 0.0, -1.0].into()) < 1e-6, "bent back by a quarter turn: {tip}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`skeleton`] | [`Skeleton::new`], [`Pose::forward_kinematics`] |
//! | [`puppet`] | [`JointTree::new`], [`joint_rotation`], [`joint_angles`], [`skeleton_puppet`] |
//! | [`calibration`] | [`Calibration::zero`], [`SensorCalibration::angle`] |
//! | [`steps`] | [`CalibrationRun::take`] and [`finish`](CalibrationRun::finish): zero, sweep, mounting, heading |
//! | [`filter`] | [`Filter`], and its lag |
//! | [`recognise`](mod@recognise) | [`recognise`](fn@recognise) what a skeleton and each of its bones is |
//! | [`mapping`] | [`propose`] which part drives which bone; [`match_rest`]: the character's rest pose as the puppet's |
//! | [`retarget`](mod@retarget) | [`retarget()`] a motion to another skeleton; [`humanoid_motion`]: the bones that humanoids share |
//! | [`ground`] | [`GroundContact::follow`]: roots that follow the foot on the floor |
//! | [`dynamics`] | [`SpringBones::follow`]: bones that swing |
//! | [`pose`] | [`StreamSolver::solve`] a sample into a pose |
//!
//! Frames: right-handed, +Y up, the character faces +Z. Angles in radians, lengths in the mesh's unit, quaternions (x,
//! y, z, w). `parent_from_bone` takes a point in the bone's frame to its parent's frame. This crate does no I/O, knows
//! no wire types and takes its trigonometry from `libm`, so that equal input gives equal poses everywhere.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests require exactly the documented value"))]

pub mod calibration;
pub mod dynamics;
pub mod filter;
pub mod ground;
pub mod mapping;
pub mod pose;
pub mod puppet;
pub mod recognise;
pub mod retarget;
pub mod skeleton;
pub mod steps;

pub use calibration::{
    Calibration, CalibrationError, PartSettings, SensorCalibration, SensorRange, SkippedSensor, ZeroReport,
};
pub use dynamics::{Dynamics, DynamicsError, SpringBone, SpringBones, SpringChain, SpringCollider};
pub use filter::{DEFAULT_PATIENCE_SECONDS, Filter, FilterError, OneEuro};
pub use ground::{Footing, Ground, GroundContact, GroundError, GroundMode, GroundPoint, Standing};
pub use mapping::{
    DriveAxis, LEAST_REST_TURN, MOST_CURL, Mapping, MappingEntry, MappingError, Proposal, PuppetHints, PuppetKind,
    RestMatch, RestPose, RestTurn, ShapeDrive, SharedJoint, Sharing, carried, match_rest, match_rest_pose, propose,
    propose_with, rest_in,
};
pub use pose::{
    BoneQuality, BoneStatus, PoseCompletion, PoseMoment, PoseSolver, SampleError, ShapeError, ShapeWeights, SolveError,
    StreamSolver, Target, TargetChange, TargetError, TargetPoint,
};
pub use puppet::{
    JointAxis, JointTree, JointTreeError, Part, PartKind, PartUid, PartUidError, RawSample, SensorState, joint_angles,
    joint_angles_near, joint_rotation, skeleton_puppet, wrapped,
};
pub use recognise::{
    BoneNames, Evidence, Figure, Finger, HumanoidBone, HumanoidPart, RecognisedBone, Recognition, Side, recognise,
};
pub use retarget::{
    HumanoidError, RetargetError, RetargetReport, RetargetSettings, Retargeted, humanoid_motion, retarget,
};
pub use skeleton::{Bone, ChildOrder, Motion, MotionError, Pose, Skeleton, SkeletonError, Transform};
pub use steps::{
    CalibrationRun, CalibrationStep, Finding, Progress, Reading, StepError, StepFinding, StepReport, StepTimes,
    UnknownStep,
};
