//! The device's clock as seen from the session's, by ping.

use std::collections::VecDeque;
use std::time::Duration;

/// Pings in flight at most; older ones are given up.
const IN_FLIGHT: usize = 16;
/// Measurements among which the shortest round trip is looked for. At one ping a second the clocks of two quartzes
/// (100 parts in a million apart) drift by 1.6 ms meanwhile.
const REMEMBERED: usize = 16;

/// How the device's clock stands to the session's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockEstimate {
    /// Device clock minus session clock, seconds.
    pub offset_seconds: f64,
    /// The round trip it was measured by, seconds; the offset is off by at most half of that.
    pub round_trip_seconds: f64,
    /// When it was measured, in the session's time.
    pub measured: Duration,
}

impl ClockEstimate {
    /// The session's time at which the device's clock showed this, seconds; before the session began it is negative.
    pub fn session_seconds(&self, device_micros: u64) -> f64 {
        device_micros as f64 * 1e-6 - self.offset_seconds
    }
}

/// Pairs pings with pongs and keeps the measurement with the shortest round trip.
#[derive(Clone, Debug, Default)]
pub(crate) struct ClockFilter {
    next_token: u64,
    in_flight: VecDeque<(u64, Duration)>,
    measurements: VecDeque<ClockEstimate>,
}

impl ClockFilter {
    /// The token of a ping that is sent now.
    pub(crate) fn ping(&mut self, now: Duration) -> u64 {
        let token = self.next_token;
        self.next_token += 1;
        if self.in_flight.len() == IN_FLIGHT {
            self.in_flight.pop_front();
        }
        self.in_flight.push_back((token, now));
        token
    }

    /// Takes a pong; returns the estimate if this measurement is the best of those remembered.
    pub(crate) fn pong(
        &mut self,
        now: Duration,
        token: u64,
        received_micros: u64,
        sent_micros: u64,
    ) -> Option<ClockEstimate> {
        let at = self.in_flight.iter().position(|&(sent, _)| sent == token)?;
        let (_, pinged) = self.in_flight.remove(at)?;
        let held = sent_micros.checked_sub(received_micros)?;
        let away = now.checked_sub(pinged)?.as_secs_f64();
        let round_trip_seconds = (away - held as f64 * 1e-6).max(0.0);
        let there = (received_micros as f64 + held as f64 / 2.0) * 1e-6;
        let here = pinged.as_secs_f64() + away / 2.0;
        let measured = ClockEstimate { offset_seconds: there - here, round_trip_seconds, measured: now };
        if self.measurements.len() == REMEMBERED {
            self.measurements.pop_front();
        }
        self.measurements.push_back(measured);
        (self.best() == Some(measured)).then_some(measured)
    }

    /// The best of the measurements remembered.
    pub(crate) fn best(&self) -> Option<ClockEstimate> {
        self.measurements.iter().copied().min_by(|a, b| a.round_trip_seconds.total_cmp(&b.round_trip_seconds))
    }

    /// Forgets everything measured, as when the device's clock starts anew; tokens are never used twice.
    pub(crate) fn forget(&mut self) {
        self.in_flight.clear();
        self.measurements.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFSET: f64 = 1_000.0;

    /// A ping that takes so long there and back, with a device that holds it for 40 µs.
    fn exchange(filter: &mut ClockFilter, sent: f64, there: f64, back: f64) -> Option<ClockEstimate> {
        let token = filter.ping(Duration::from_secs_f64(sent));
        let received = ((sent + there + OFFSET) * 1e6) as u64;
        let answered = Duration::from_secs_f64(sent + there + 40e-6 + back);
        filter.pong(answered, token, received, received + 40)
    }

    #[test]
    fn even_ways_give_the_exact_offset() {
        let mut filter = ClockFilter::default();
        let estimate = exchange(&mut filter, 5.0, 0.001, 0.001).expect("the first is the best");
        assert!((estimate.offset_seconds - OFFSET).abs() < 2e-6, "{estimate:?}");
        assert!((estimate.round_trip_seconds - 0.002).abs() < 2e-6, "{estimate:?}");
        assert!((estimate.session_seconds(1_007_000_000) - 7.0).abs() < 2e-6);
    }

    #[test]
    fn the_shortest_round_trip_wins_and_bounds_the_error() {
        let mut filter = ClockFilter::default();
        for step in 0..15 {
            exchange(&mut filter, f64::from(step), 0.001 + f64::from((step * 7) % 5) * 0.01, 0.000_2);
        }
        let best = filter.best().expect("there were pongs");
        assert!((best.round_trip_seconds - 0.001_2).abs() < 2e-6);
        assert!((best.offset_seconds - OFFSET).abs() <= best.round_trip_seconds / 2.0 + 2e-6);
        assert_eq!(exchange(&mut filter, 16.0, 0.1, 0.1), None, "a slow one does not replace it");
    }

    #[test]
    fn old_measurements_are_forgotten() {
        let mut filter = ClockFilter::default();
        exchange(&mut filter, 0.0, 0.000_1, 0.000_1);
        for step in 1..20 {
            exchange(&mut filter, f64::from(step), 0.01, 0.01);
        }
        assert!(filter.best().is_some_and(|best| best.round_trip_seconds > 0.019));
    }

    #[test]
    fn foreign_and_impossible_pongs_are_ignored() {
        let mut filter = ClockFilter::default();
        let token = filter.ping(Duration::from_secs(1));
        assert_eq!(filter.pong(Duration::from_secs(2), token + 1, 5, 6), None);
        assert_eq!(filter.pong(Duration::from_secs(2), token, 6, 5), None, "sent before it was received");
        assert_eq!(filter.pong(Duration::from_secs(2), token, 5, 6), None, "each ping counts once");
        let token = filter.ping(Duration::from_secs(3));
        assert!(filter.pong(Duration::from_secs(4), token, u64::MAX, u64::MAX).is_some());
    }
}
