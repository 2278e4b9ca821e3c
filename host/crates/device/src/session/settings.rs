//! The timing of a session.

use std::time::Duration;

/// The timing of a session. The defaults suit every device that follows the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionSettings {
    /// An unanswered request is sent again after this time; a topology request after twice this.
    pub answer_after: Duration,
    /// After this many attempts without an answer the session goes back to the hello.
    pub attempts: u32,
    /// After this long without an answer on a line that was just opened, the session says that it waits.
    pub waits_after: Duration,
    /// Opening the port resets many boards, and their boot loader runs first: until this long after the line was opened, a
    /// device that has sent no frame is reported neither as silent nor as sending garbage.
    pub starting_for: Duration,
    /// After this long without a byte the device is reported as silent.
    pub silent_after: Duration,
    /// After this long with bytes but no frame the device is reported as sending garbage.
    pub garbage_after: Duration,
    /// After this long without an expected sample, start is sent again. At least four sample periods.
    pub stalled_after: Duration,
    /// Pause before a refused request is sent again.
    pub refused_pause: Duration,
    /// Time between two pings.
    pub ping_every: Duration,
}

impl Default for SessionSettings {
    fn default() -> Self {
        Self {
            answer_after: Duration::from_millis(250),
            attempts: 8,
            waits_after: Duration::from_secs(1),
            starting_for: Duration::from_secs(4),
            silent_after: Duration::from_secs(2),
            garbage_after: Duration::from_secs(2),
            stalled_after: Duration::from_secs(1),
            refused_pause: Duration::from_secs(1),
            ping_every: Duration::from_secs(1),
        }
    }
}
