//! A motion on another skeleton: [`retarget`].
//!
//! Bones are paired by what they are ([`recognise`](fn@crate::recognise)), others by their names. The target's limbs are
//! turned to where the source's point at rest; from there, each bone turns in model space as its partner does, so that
//! limbs point where the source's do. The hips go the source's way, scaled by the legs. Feet that stand still in the source
//! do so in the target: the figure goes along a little, and the legs are bent for what is left.

mod feet;
mod frames;
mod humanoid;
mod pairs;
mod rest;
mod transfer;
mod trunk;

pub use humanoid::{HumanoidError, humanoid_motion};
pub use transfer::{RetargetError, RetargetReport, RetargetSettings, Retargeted, retarget};
