//! When the poses of a take were: on one timeline ([`Timeline::recorded`]), and at a constant rate ([`resample`]).

mod device_clock;
mod frame_rate;
mod low_pass;
mod resample;
mod timecode;
mod timeline;

pub(crate) use device_clock::DeviceClock;
pub use device_clock::{ClockFaults, ClockRestart};
pub use frame_rate::{FrameRate, FrameRateError};
pub(crate) use low_pass::LowPass;
pub(crate) use resample::between;
pub use resample::{HeldGap, ResampleError, ResampleSettings, Resampled, resample};
pub use timecode::{Timecode, TimecodeError};
pub use timeline::{Timeline, TimelineReport};
