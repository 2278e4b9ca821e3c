//! The timing of a session with an arm, and what it may do.

use std::time::Duration;

use crate::arm::NO_SEAT;

/// Whether registers that keep their value without power may be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EepromConsent {
    /// They are not written.
    #[default]
    Never,
    /// The return delay may be set to 0, once, if it is not.
    ReturnDelayZero,
}

/// The timing of a session with an arm, and what it may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoSettings {
    /// How long adapter and system may hold back an answer before the servo counts as silent; FTDI adapters hold it for
    /// 16 ms by default.
    pub patience: Duration,
    /// A servo that missed this many readings in a row is ignored until it answers again.
    pub strikes: u32,
    /// How often an ignored servo is asked again.
    pub probe_every: Duration,
    /// Pause after nothing was found on the bus.
    pub pause: Duration,
    /// Whether the servos' memory may be written.
    pub eeprom: EepromConsent,
    /// Distinguishes two identical arms, see [`ServoArm::topology`](super::ServoArm::topology).
    pub seat: u32,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self {
            patience: Duration::from_millis(40),
            strikes: 3,
            probe_every: Duration::from_millis(500),
            pause: Duration::from_secs(1),
            eeprom: EepromConsent::Never,
            seat: NO_SEAT,
        }
    }
}
