//! How a device's clock relates to the session's.

use std::time::Duration;

/// How the device's clock relates to the session's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockEstimate {
    /// Device clock minus session clock when it was measured, seconds.
    pub offset_seconds: f64,
    /// The round trip of that measurement, seconds; the offset is off by at most half of it.
    pub round_trip_seconds: f64,
    /// When it was measured, in the session's time.
    pub measured: Duration,
    /// How much faster the device's clock runs: seconds gained per second.
    pub drift: f64,
    /// The drift is off by at most this, as long as it is constant over a minute.
    pub drift_error: f64,
}

impl ClockEstimate {
    /// The session time at which the device's clock showed this, seconds; negative before the session began.
    pub fn session_seconds(&self, device_micros: u64) -> f64 {
        let measured = self.measured.as_secs_f64();
        let since = device_micros as f64 * 1e-6 - measured - self.offset_seconds;
        measured + since / (1.0 + self.drift)
    }

    /// The largest possible error of [`session_seconds`](Self::session_seconds) at a session time, seconds.
    pub fn error_seconds(&self, session_seconds: f64) -> f64 {
        let away = (session_seconds - self.measured.as_secs_f64()).abs();
        self.round_trip_seconds / 2.0 + self.drift_error * away
    }
}
