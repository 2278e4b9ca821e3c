//! Where the engine's inputs come from: puppets on real lines in real time, or a simulated one on a virtual clock.

pub mod address;
mod arms;
pub mod live;
mod loading;
mod second_process;
pub mod simulated;
pub mod virtual_clock;
mod working;

use std::time::Duration;

use armature_rig::Calibration;

use super::input::{Input, LineId, Request};
use crate::failure::Failure;

pub use live::{LiveSettings, LiveSource};
pub use second_process::SimulatedPuppet;
pub use virtual_clock::VirtualSource;

/// Feeds an engine and fulfils its requests.
pub trait Source {
    /// The next input. It is [`Input::Tick`] at `until` (the engine's clock, seconds) at the latest, if given; a
    /// virtual clock may tick earlier.
    fn next(&mut self, until: Option<f64>) -> Input;
    /// The engine's clock, seconds.
    fn now(&self) -> f64;
    /// How long ago this was, by a clock that kept running; `None` on a virtual one.
    fn age(&self, at: f64) -> Option<Duration>;
    /// Whether a command to cancel or quit is waiting.
    fn is_stopped(&mut self) -> bool {
        false
    }
    /// Does what the engine requests, without blocking it.
    fn fulfil(&mut self, request: Request);
    /// Saves a calibration where this line's puppet has its own, if it has one.
    fn keep_calibration(&mut self, line: LineId, calibration: &Calibration) -> Result<(), Failure> {
        let _ = (line, calibration);
        Ok(())
    }
}
