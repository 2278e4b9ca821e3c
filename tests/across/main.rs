//! Tests across crates: whole runs on a virtual clock, and what must hold for them. One binary, for each would link the
//! whole program again.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod end_to_end;
mod few_joints;
mod hotplug;
mod joint_limits;
mod mapping;
mod mocap;
mod motions;
mod mounting;
mod noise;
mod replay;
mod rest_pose;
mod standing;
mod tapped;
mod targets;
mod volumes;
