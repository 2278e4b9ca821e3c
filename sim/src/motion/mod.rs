//! What the puppet does: rest, a procedural motion, an exercise, or a track; with the feature `serve` also motion files
//! (`puppet_from_motion`, `retarget`).

mod exercise;
#[cfg(feature = "serve")]
mod file;
mod play;
mod procedural;
#[cfg(feature = "serve")]
mod retarget;
mod track;

pub use exercise::Exercise;
#[cfg(feature = "serve")]
pub use file::{MotionFileError, puppet_from_motion};
pub(crate) use play::Player;
pub use play::{Motion, sweep_stops};
#[cfg(feature = "serve")]
pub use retarget::{Retargeted, retarget};
pub use track::{JointTrack, TrackEnd};
