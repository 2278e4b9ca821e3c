//! What one sensor shows while a step measures. Everything here works across count zero.

use crate::calibration::SensorRange;
use crate::puppet::SensorState;

/// A sensor that moves less than this is held still, turns.
const STILL_TURNS: f64 = 3.0 / 360.0;
/// A sensor that moves less than this was not swept, turns.
const SWEPT_TURNS: f64 = 10.0 / 360.0;
/// If a sensor moves further than this between two samples, its direction is unknown, turns.
const LEAP_TURNS: f64 = 0.25;
/// A sensor that moves more than this has no stops, turns.
const ALL_ROUND_TURNS: f64 = 0.97;

/// A sensor during a held pose.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Held {
    first: Option<u16>,
    /// Sum of the differences from the first count.
    sum: i64,
    low: i64,
    high: i64,
    count: i64,
    /// What it reported when it had no good count.
    bad: SensorState,
}

/// The outcome of holding a sensor still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum HeldStill {
    /// The mean count.
    At(u16),
    /// It moved by this many degrees.
    Moved(f64),
    /// It had no good count.
    Unreadable(SensorState),
}

impl Held {
    pub(super) fn add(&mut self, counts: u16, state: SensorState, turn: u32) {
        if state != SensorState::Ok {
            self.bad = state;
            return;
        }
        let away = difference(*self.first.get_or_insert(counts), counts, turn);
        self.sum += away;
        self.low = self.low.min(away);
        self.high = self.high.max(away);
        self.count += 1;
    }

    pub(super) fn outcome(&self, turn: u32) -> HeldStill {
        let Some(first) = self.first else { return HeldStill::Unreadable(self.bad) };
        let spread = (self.high - self.low) as f64 / f64::from(turn);
        if spread > STILL_TURNS {
            return HeldStill::Moved(spread * 360.0);
        }
        let mean = libm::round(self.sum as f64 / self.count as f64) as i64;
        HeldStill::At((i64::from(first) + mean).rem_euclid(i64::from(turn)) as u16)
    }
}

/// A sensor that is swept from stop to stop.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Swept {
    first: Option<u16>,
    last: u16,
    /// A count so far off that it may be an outlier; the next count decides.
    doubtful: Option<u16>,
    position: i64,
    low: i64,
    high: i64,
    rose_first: Option<bool>,
    leapt: bool,
}

/// The outcome of sweeping a sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum SweepOutcome {
    /// It was not read.
    Unread,
    /// It hardly moved: this many degrees.
    NotMoved(f64),
    /// It moved too fast to follow.
    TooFast,
    /// It has stops.
    Between {
        /// Where.
        range: SensorRange,
        /// Whether counts rose on the way to the first stop.
        rose_first: bool,
    },
    /// It goes all the way round.
    AllRound {
        /// Whether counts rose at first.
        rose_first: bool,
    },
}

impl Swept {
    pub(super) fn add(&mut self, counts: u16, turn: u32) {
        let leap = (LEAP_TURNS * f64::from(turn)) as i64;
        if self.first.is_none() {
            (self.first, self.last) = (Some(counts), counts);
            return;
        }
        let mut away = difference(self.last, counts, turn);
        if away.abs() > leap {
            match self.doubtful.replace(counts) {
                // Two counts agree on the new place: it really went there.
                Some(before) if difference(before, counts, turn).abs() <= leap / 2 => self.leapt = true,
                _ => return,
            }
            // Where it is now is known, but not which way it went; the shorter way is assumed.
            away = difference(self.last, counts, turn);
        }
        self.doubtful = None;
        self.last = counts;
        self.position += away;
        self.low = self.low.min(self.position);
        self.high = self.high.max(self.position);
        if self.rose_first.is_none() && self.position.unsigned_abs() as f64 > SWEPT_TURNS * f64::from(turn) {
            self.rose_first = Some(self.position > 0);
        }
    }

    pub(super) fn outcome(&self, turn: u32) -> SweepOutcome {
        let Some(first) = self.first else { return SweepOutcome::Unread };
        let span = self.high - self.low;
        let turns = span as f64 / f64::from(turn);
        match self.rose_first {
            None => SweepOutcome::NotMoved(turns * 360.0),
            Some(_) if self.leapt => SweepOutcome::TooFast,
            Some(rose_first) if turns > ALL_ROUND_TURNS => SweepOutcome::AllRound { rose_first },
            Some(rose_first) => {
                let first_counts = (i64::from(first) + self.low).rem_euclid(i64::from(turn)) as u16;
                SweepOutcome::Between { range: SensorRange { first_counts, span_counts: span as u32 }, rose_first }
            }
        }
    }
}

/// The shorter way from one count to another, in [-turn/2, turn/2).
fn difference(from: u16, to: u16, turn: u32) -> i64 {
    let turn = i64::from(turn.max(1));
    let half = turn / 2;
    (i64::from(to) - i64::from(from) + half).rem_euclid(turn) - half
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn one_wild_count_is_no_sweep_and_a_leap_is_named() {
        let mut swept = Swept::default();
        for counts in [100, 110, 9_000, 120, 130, 900, 1_000] {
            swept.add(counts, 16_384);
        }
        assert!(
            matches!(swept.outcome(16_384), SweepOutcome::Between { range, rose_first: true } if range == SensorRange { first_counts: 100, span_counts: 900 })
        );
        for counts in [9_000, 9_010, 9_020] {
            swept.add(counts, 16_384);
        }
        assert_eq!(swept.outcome(16_384), SweepOutcome::TooFast);
        assert_eq!(Swept::default().outcome(16_384), SweepOutcome::Unread);
    }

    #[test]
    fn a_sensor_without_stops_goes_all_round() {
        let mut swept = Swept::default();
        for step in 0..200_u32 {
            swept.add(((4_096 + 8_000 - step * 50) % 4_096) as u16, 4_096);
        }
        assert_eq!(swept.outcome(4_096), SweepOutcome::AllRound { rose_first: false });
    }

    proptest! {
        /// Wherever the magnet is glued in, and whichever way it counts, the mean of a noisy hold is the held count.
        #[test]
        fn a_hold_is_averaged_across_the_wrap(at in 0_u32..16_384, noise in prop::collection::vec(-20_i64..=20, 50)) {
            let mut held = Held::default();
            let mean = noise.iter().sum::<i64>() as f64 / noise.len() as f64;
            for away in noise {
                held.add((i64::from(at) + away).rem_euclid(16_384) as u16, SensorState::Ok, 16_384);
            }
            held.add(9_999, SensorState::Outlier, 16_384);
            let HeldStill::At(found) = held.outcome(16_384) else { panic!("{held:?}") };
            let apart = difference(at as u16, found, 16_384) as f64;
            prop_assert!((apart - mean).abs() <= 0.5 + 1e-9);
        }

        #[test]
        fn a_sweep_finds_stops_and_direction_across_the_wrap(
            start in 0_u32..16_384, up in 500_i64..7_000, down in 500_i64..7_000, up_first: bool, step in 1_i64..400
        ) {
            let mut swept = Swept::default();
            let mut go = |from: i64, to: i64| {
                let mut at = from;
                while at != to {
                    at += (to - at).signum() * step.min((to - at).abs());
                    swept.add((i64::from(start) + at).rem_euclid(16_384) as u16, 16_384);
                }
            };
            go(-1, 0);
            let (one, other) = if up_first { (up, -down) } else { (-down, up) };
            go(0, one);
            go(one, other);
            go(other, 0);
            let SweepOutcome::Between { range, rose_first } = swept.outcome(16_384) else { panic!("{swept:?}") };
            prop_assert_eq!(rose_first, up_first);
            prop_assert_eq!(u32::from(range.first_counts), (i64::from(start) - down).rem_euclid(16_384) as u32);
            prop_assert_eq!(i64::from(range.span_counts), up + down);
        }
    }
}
