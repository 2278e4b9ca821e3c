//! Where all rooms meet at pose time: device session → rig solver → skin → take, and the window's engine.

pub mod actor;
pub mod bridge;
pub mod calibrating;
pub mod completion;
pub mod frames;
pub mod latency;
pub mod live;
pub mod perform;
pub mod performance;
pub mod recorder;
pub mod second_process;
pub mod show;
pub mod simulated;
pub mod stage;
pub mod virtual_clock;
