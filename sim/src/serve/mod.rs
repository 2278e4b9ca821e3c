//! Serving an emulated puppet ([`pty`], [`tcp`], or [`Background::start`] on its own thread) or a servo bus
//! ([`bus`](bus())) in real time; [`Options`] are the options of `armature-sim`.

mod background;
mod bus;
mod hints;
mod options;
mod port;
#[cfg(unix)]
mod pseudo_terminal;
mod puppet;
mod queue;
mod settings;
mod socket;

pub use background::{Background, stop_when_input_ends};
pub use bus::bus;
pub use hints::hints_of;
pub use options::{Options, OptionsError};
pub use puppet::{pty, tcp};
pub use settings::{Place, ServeError, ServeReport, ServeSettings};
