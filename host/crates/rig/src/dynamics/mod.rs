//! Bones that swing by themselves: tails, ears, hair. [`Dynamics`] says which and how, [`SpringBones`] moves them.
//!
//! The springs are those of VRM avatars (`VRMC_springBone`): the tip of each bone is a point on a rod of fixed length that
//! is drawn back to where the pose has it, pulled by gravity, slowed down by the air and kept out of colliders. VRM leaves
//! the length of a time step to the program; here steps are [`STEP_MICROS`] long, whatever the rate of samples.

mod settings;
mod springs;

pub use settings::{Dynamics, DynamicsError, SpringBone, SpringChain, SpringCollider};
pub use springs::{LONGEST_GAP_MICROS, STEP_MICROS, SpringBones};
