//! The device's clock relative to the session's, by ping.

use std::collections::VecDeque;
use std::time::Duration;

use crate::events::ClockEstimate;

/// Most pings in flight; older ones are given up.
const IN_FLIGHT: usize = 16;
/// Number of measurements kept; at one ping a second, the last minute.
const REMEMBERED: usize = 64;
/// From this many measurements on, their median is typical of the line.
const A_FEW: usize = 4;
/// Assumed difference in clock speed before anything is measured: two cheap crystals, 100 ppm each.
const WORST_DRIFT: f64 = 200e-6;
/// An estimate is also reported when its drift is known this much better than in the last one reported.
const WORTH_TELLING: f64 = 0.7;

/// All in seconds.
#[derive(Clone, Copy, Debug)]
struct Measurement {
    offset: f64,
    round_trip: f64,
    /// The session's time halfway between ping and pong.
    at: f64,
}

/// Pairs pings with pongs. Each pair bounds the offset by half its round trip; two pairs bound the drift between them,
/// and the bounds of all pairs hold together.
#[derive(Clone, Debug, Default)]
pub(super) struct ClockFilter {
    next_token: u64,
    in_flight: VecDeque<(u64, Duration)>,
    measurements: VecDeque<Measurement>,
    drift: Option<(f64, f64)>,
    best: Option<ClockEstimate>,
    told: Option<ClockEstimate>,
}

impl ClockFilter {
    /// The token of a ping sent now.
    pub(super) fn ping(&mut self, now: Duration) -> u64 {
        let token = self.next_token;
        self.next_token += 1;
        if self.in_flight.len() == IN_FLIGHT {
            self.in_flight.pop_front();
        }
        self.in_flight.push_back((token, now));
        token
    }

    /// Takes a pong; returns the estimate if it improved, or if its measurement had to be replaced.
    pub(super) fn pong(
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
        let there = (received_micros as f64 + held as f64 / 2.0) * 1e-6;
        let here = pinged.as_secs_f64() + away / 2.0;
        if self.measurements.len() == REMEMBERED {
            self.measurements.pop_front();
        }
        let round_trip = (away - held as f64 * 1e-6).max(0.0);
        self.measurements.push_back(Measurement { offset: there - here, round_trip, at: here });
        self.bound_drift();
        self.best = self.choose(now.as_secs_f64());
        let (best, told) = (self.best?, self.told);
        let better = told
            .is_none_or(|told| best.measured != told.measured || best.drift_error < WORTH_TELLING * told.drift_error);
        if better {
            self.told = Some(best);
        }
        better.then_some(best)
    }

    /// The median round trip of the measurements kept, without the time that the device held the pings.
    pub(super) fn median_round_trip(&self) -> Option<Duration> {
        if self.measurements.len() < A_FEW {
            return None;
        }
        let mut trips: Vec<f64> = self.measurements.iter().map(|measurement| measurement.round_trip).collect();
        trips.sort_by(f64::total_cmp);
        Some(Duration::from_secs_f64(trips[trips.len() / 2]))
    }

    /// The drifts allowed by all pairs of measurements. A clock whose speed changes may allow none; then only the pairs
    /// with the latest measurement count.
    fn bound_drift(&mut self) {
        let all = self.allowed(self.measurements.iter());
        let allowed = all.or_else(|| self.allowed(self.measurements.iter().rev().take(1)));
        self.drift = allowed.or(self.drift);
    }

    /// Midpoint and half width of the drifts that these measurements allow together with all others.
    fn allowed<'a>(&self, with: impl Iterator<Item = &'a Measurement>) -> Option<(f64, f64)> {
        let (mut least, mut most) = (-WORST_DRIFT, WORST_DRIFT);
        for one in with {
            for other in &self.measurements {
                let apart = one.at - other.at;
                if apart <= 0.0 {
                    continue;
                }
                let middle = (one.offset - other.offset) / apart;
                let slack = f64::midpoint(one.round_trip, other.round_trip) / apart;
                least = least.max(middle - slack);
                most = most.min(middle + slack);
            }
        }
        (least <= most).then_some((f64::midpoint(least, most), (most - least) / 2.0))
    }

    /// The measurement that is most informative about now.
    fn choose(&self, now: f64) -> Option<ClockEstimate> {
        let (drift, drift_error) = self.drift.unwrap_or((0.0, WORST_DRIFT));
        let estimate = |measurement: &Measurement| ClockEstimate {
            offset_seconds: measurement.offset,
            round_trip_seconds: measurement.round_trip,
            measured: Duration::from_secs_f64(measurement.at.max(0.0)),
            drift,
            drift_error,
        };
        let estimates = self.measurements.iter().map(estimate);
        estimates.min_by(|a, b| a.error_seconds(now).total_cmp(&b.error_seconds(now)))
    }

    /// The best estimate so far.
    pub(super) fn best(&self) -> Option<ClockEstimate> {
        self.best
    }

    /// Discards all measurements, as when the device's clock restarts; tokens are never reused.
    pub(super) fn forget(&mut self) {
        *self = Self { next_token: self.next_token, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OFFSET: f64 = 1_000.0;

    /// A ping that takes this long there and back, with a device that holds it for 40 µs.
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
        let measured = best.measured;
        let slow = exchange(&mut filter, 16.0, 0.1, 0.1);
        assert!(slow.is_none_or(|slow| slow.measured == measured), "a slow one does not replace it");
    }

    #[test]
    fn old_measurements_are_forgotten() {
        let mut filter = ClockFilter::default();
        exchange(&mut filter, 0.0, 0.000_1, 0.000_1);
        for step in 1..70 {
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

    /// A device whose clock runs at another speed, on a line whose delays each way differ all the time.
    #[test]
    fn drift_is_found_and_the_error_stated_holds() {
        for (seed, drift) in [(1_u64, 80e-6), (2, -55e-6), (3, 0.0), (4, 150e-6)] {
            let (mut filter, mut state) = (ClockFilter::default(), seed);
            let mut delay = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                0.000_3 + (state >> 40) as f64 / (1_u64 << 24) as f64 * 0.004
            };
            let device = |seconds: f64| seconds * (1.0 + drift) + OFFSET;
            for step in 0..600 {
                let sent = f64::from(step);
                let token = filter.ping(Duration::from_secs_f64(sent));
                let (there, back) = (delay(), delay());
                let received = (device(sent + there) * 1e6) as u64;
                filter.pong(Duration::from_secs_f64(sent + there + back), token, received, received);
                let best = filter.best().expect("there are pongs");
                let at = sent + 0.5;
                let off = (best.session_seconds((device(at) * 1e6) as u64) - at).abs();
                assert!(off <= best.error_seconds(at) + 3e-6, "{step}: off by {off}, {best:?}");
            }
            let best = filter.best().expect("there are pongs");
            assert!((best.drift - drift).abs() <= best.drift_error + 1e-6 && best.drift_error < 30e-6, "{best:?}");
            assert!(best.error_seconds(600.0) < 0.002, "{best:?}");
        }
    }
}
