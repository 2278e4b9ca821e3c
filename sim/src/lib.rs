//! An emulated puppet: everything that a real one does behind the wire protocol, on a clock that the caller moves.
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
//! Bodies come as [presets](Body::preset) or part by part ([`BodyBuilder`]); [`Motion`]s by rule or as tracks;
//! [`Faults`] break what can break in the real thing, drawn from a seed and counted ([`Truth`]).
//!
//! The feature `serve` adds what touches the world: puppets from motion files and serving on a
//! pseudo-terminal or TCP. Without it the crate has neither clock nor I/O.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::float_cmp, reason = "tests ask for exactly the documented value"))]

mod body;
mod faults;
mod line;
mod motion;
#[cfg(feature = "serve")]
mod motion_file;
mod preset;
mod procedural;
mod puppet;
mod random;
#[cfg(feature = "serve")]
mod retarget;
pub mod rotation;
mod sensors;
#[cfg(feature = "serve")]
pub mod serve;
pub mod servo;
mod settings;
mod timeline;

pub use body::{Body, BodyBuilder, BodyError, BodyPart};
pub use faults::{Faults, NoiseBurst, SensorFault, SensorFaultKind, Truth, Unplugging};
pub use motion::{JointTrack, Motion, TrackEnd, sweep_stops};
#[cfg(feature = "serve")]
pub use motion_file::{MotionFileError, puppet_from_motion};
pub use puppet::Puppet;
#[cfg(feature = "serve")]
pub use retarget::{Retargeted, retarget};
pub use rotation::Rotation;
pub use settings::{PuppetSettings, SettingsError};
