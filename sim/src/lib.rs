//! An emulated puppet: everything a real one does on its side of the wire protocol, on a clock that the caller
//! advances.
//!
//! The bytes of a walking human puppet:
//!
//! ```
//! use armature_sim::{Body, Motion, Puppet, PuppetSettings};
//! use firmware_protocol::{FrameBuffer, HostMessage};
//!
//! let body = Body::preset("human", 1)?;
//! let mut puppet = Puppet::new(PuppetSettings { motion: Motion::Walk, ..PuppetSettings::new(body) })?;
//! let mut host = FrameBuffer::new();
//! let mut bytes = Vec::new();
//! puppet.step(0, host.encode(&HostMessage::Start)?, &mut bytes);
//! puppet.step(1_000_000, &[], &mut bytes);
//! assert_eq!(puppet.truth().samples_taken, 121, "one at once, then 120 a second");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`body`] | [`Body::preset`], [`BodyBuilder`]: the parts |
//! | [`motion`] | [`Motion::by_name`], [`JointTrack`]; with the feature `serve` `puppet_from_motion` and `retarget` |
//! | [`puppet`] | [`Puppet::step`]: time and bytes in, bytes out |
//! | [`faults`] | [`Faults`] that occur in real puppets, drawn from a seed and counted ([`Truth`]) |
//! | [`servo`] | [`ServoBus::step`](servo::ServoBus::step): an arm of bus servos |
//! | [`rotation`] | the rotations of joints |
//! | `serve` | with the feature `serve`: serving on a pseudo-terminal or over TCP, in real time |
//!
//! The feature `serve` adds everything with I/O: puppets from motion files, and serving. Without it the crate has
//! neither clock nor I/O.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests require exactly the documented value"))]

pub mod body;
pub mod faults;
pub mod motion;
pub mod puppet;
mod random;
pub mod rotation;
#[cfg(feature = "serve")]
pub mod serve;
pub mod servo;

pub use body::{Body, BodyBuilder, BodyError, BodyPart};
pub use faults::{ClockFault, ClockFaultKind, Faults, NoiseBurst, SensorFault, SensorFaultKind, Truth, Unplugging};
pub use motion::{Exercise, JointTrack, Motion, TrackEnd, sweep_stops};
#[cfg(feature = "serve")]
pub use motion::{MotionFileError, Retargeted, puppet_from_motion, retarget};
pub use puppet::{Puppet, PuppetSettings, SettingsError};
pub use rotation::Rotation;
