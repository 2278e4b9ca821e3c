//! Whether the time of a sample can be believed, and what stands in for it where it cannot.
//!
//! A device's clock never goes back, never stands and never leaps while the device runs; firmware that reads a clock of
//! 64 bits in two halves, or counts in too few bits, breaks that. The running number says how many samples have been
//! taken since the one before, the host's time how long that took, so that a time that contradicts both shows. One that
//! leaps ahead is rejected with its sample; one that stands or goes back is rebuilt from number and host time. A device
//! that keeps to the rule gets its own times back to the microsecond.

use std::time::Duration;

use crate::events::{DeviceNotice, Event};

/// A clock goes ahead by no more than this times what number and host time say,
const LEAP_FACTOR: f64 = 2.0;
/// and this besides, µs: bytes come in clumps.
const LEAP_MARGIN: f64 = 100e3;
/// A sample this far ahead of the last one is no continuation of it, in numbers.
const CONTINUES: u32 = 1 << 24;
/// After this many samples in a row that leapt and agree with each other, the clock is where they say.
const SETTLED: u32 = 3;
/// A clock that shows one time for this many samples in a row, over this long, has stopped; one that counts in coarse
/// steps does not.
const STANDS_SAMPLES: u32 = 5;
const STANDS: Duration = Duration::from_millis(250);
/// How much of its distance from the host's time a rebuilt time makes up with each sample.
const TOWARDS_HOST: f64 = 0.1;

/// What the time of a sample is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Judged {
    /// Microseconds of the device's clock, as it is or rebuilt.
    At(u64),
    /// It leaps ahead: the sample is not to be used.
    Leap,
}

/// A sample whose time was believed or rebuilt.
#[derive(Clone, Copy, Debug)]
struct Last {
    sequence: u32,
    /// As it came.
    raw: u64,
    /// As it was handed on.
    micros: u64,
    host: Duration,
}

/// A sample that leapt, and how many agree on where the clock is now.
#[derive(Clone, Copy, Debug)]
struct Leap {
    sequence: u32,
    raw: u64,
    host: Duration,
    agree: u32,
}

/// A clock that shows the same time again and again.
#[derive(Clone, Copy, Debug)]
struct Standing {
    samples: u32,
    since: Last,
}

/// Which faults have been reported.
#[derive(Clone, Copy, Debug, Default)]
struct Told {
    leap: bool,
    back: bool,
    stands: bool,
}

/// The clock of a device, as its samples show it.
#[derive(Clone, Debug, Default)]
pub(super) struct DeviceTime {
    last: Option<Last>,
    /// Added to what the clock shows, µs; 0 for a device whose clock has always been right.
    offset: i64,
    leap: Option<Leap>,
    standing: Option<Standing>,
    told: Told,
    /// Samples rejected or given a rebuilt time.
    faults: u64,
    /// Whether the clock has just gone back.
    went_back: bool,
}

impl DeviceTime {
    /// A new stream begins; what was reported stays reported.
    pub(super) fn begin(&mut self) {
        *self = Self { told: self.told, faults: self.faults, ..Self::default() };
    }

    /// Samples rejected for their time, and samples whose time was rebuilt.
    pub(super) fn faults(&self) -> u64 {
        self.faults
    }

    /// Whether the clock went back with the last sample; true once.
    pub(super) fn take_went_back(&mut self) -> bool {
        std::mem::take(&mut self.went_back)
    }

    /// Judges the time of a sample. `period`: what the granted rate makes of a sample's number, if it makes sense.
    pub(super) fn judge(
        &mut self,
        now: Duration,
        sequence: u32,
        raw: u64,
        period: Option<Duration>,
        events: &mut Vec<Event>,
    ) -> Judged {
        let Some(last) = self.last else { return self.accept(now, sequence, raw, raw) };
        let ahead = sequence.wrapping_sub(last.sequence);
        if ahead == 0 || ahead > CONTINUES {
            // One that came before, or a restarted device: its sequence number decides.
            return Judged::At(raw.saturating_add_signed(self.offset));
        }
        let host = now.saturating_sub(last.host).as_secs_f64() * 1e6;
        let expected = period.map_or(host, |period| period.as_secs_f64() * 1e6 * f64::from(ahead));
        let most = LEAP_FACTOR * expected.max(host) + LEAP_MARGIN;
        let shown = raw.saturating_add_signed(self.offset);
        if raw > last.raw && shown.saturating_sub(last.micros) as f64 > most {
            return self.leap(now, sequence, raw, expected.max(host), most, events);
        }
        self.leap = None;
        let step = (expected as u64).max(1);
        if raw == last.raw {
            return self.stand(now, sequence, last, step, events);
        }
        self.standing = None;
        if raw < last.raw {
            let seconds = (last.raw - raw) as f64 * 1e-6;
            if !std::mem::replace(&mut self.told.back, true) {
                events.push(Event::Notice(DeviceNotice::ClockStepsBack { seconds }));
            }
            self.faults += 1;
            self.went_back = true;
            self.rebase(raw, last.micros.saturating_add(step));
        } else if shown <= last.micros {
            // It continues from where it stopped. Coarse steps are corrected with the next one.
            let behind = last.micros - shown;
            let coarse = 2 * step + 10_000;
            if behind < coarse {
                return self.accept(now, sequence, raw, last.micros + 1);
            }
            self.faults += 1;
            self.rebase(raw, last.micros.saturating_add(step));
        }
        let micros = raw.saturating_add_signed(self.offset);
        self.accept(now, sequence, raw, micros)
    }

    fn accept(&mut self, host: Duration, sequence: u32, raw: u64, micros: u64) -> Judged {
        self.last = Some(Last { sequence, raw, micros, host });
        Judged::At(micros)
    }

    /// What the clock shows as `raw` is this time from now on.
    fn rebase(&mut self, raw: u64, micros: u64) {
        self.offset = micros.wrapping_sub(raw).cast_signed();
    }

    fn leap(
        &mut self,
        now: Duration,
        sequence: u32,
        raw: u64,
        passed: f64,
        most: f64,
        events: &mut Vec<Event>,
    ) -> Judged {
        let Some(last) = self.last else { return self.accept(now, sequence, raw, raw) };
        self.faults += 1;
        if !std::mem::replace(&mut self.told.leap, true) {
            let seconds = raw.saturating_add_signed(self.offset).saturating_sub(last.micros) as f64 * 1e-6;
            events.push(Event::Notice(DeviceNotice::ClockLeaps { seconds, host_seconds: passed * 1e-6 }));
        }
        let agrees = |leap: &Leap| {
            let newer = (1..=CONTINUES).contains(&sequence.wrapping_sub(leap.sequence)) && now >= leap.host;
            newer && raw > leap.raw && (raw - leap.raw) as f64 <= most
        };
        let agree = self.leap.filter(agrees).map_or(1, |leap| leap.agree + 1);
        if agree >= SETTLED {
            self.leap = None;
            self.standing = None;
            self.rebase(raw, last.micros.saturating_add(passed.max(1.0) as u64));
            return self.accept(now, sequence, raw, raw.saturating_add_signed(self.offset));
        }
        self.leap = Some(Leap { sequence, raw, host: now, agree });
        Judged::Leap
    }

    /// The clock shows what it showed before: number and host time say when the sample was taken.
    fn stand(&mut self, now: Duration, sequence: u32, last: Last, step: u64, events: &mut Vec<Event>) -> Judged {
        let standing = self.standing.get_or_insert(Standing { samples: 0, since: last });
        standing.samples += 1;
        let since = standing.since;
        let lasted = now.saturating_sub(since.host);
        if standing.samples >= STANDS_SAMPLES && lasted >= STANDS {
            self.faults += if standing.samples == STANDS_SAMPLES { u64::from(STANDS_SAMPLES) } else { 1 };
            if !std::mem::replace(&mut self.told.stands, true) {
                let (samples, seconds) = (standing.samples, lasted.as_secs_f64());
                events.push(Event::Notice(DeviceNotice::ClockStands { samples, seconds }));
            }
        }
        let by_number = last.micros.saturating_add(step);
        let by_host = since.micros as f64 + lasted.as_secs_f64() * 1e6;
        let steered = by_number as f64 + TOWARDS_HOST * (by_host - by_number as f64);
        self.accept(now, sequence, last.raw, (steered as u64).max(last.micros + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD: Duration = Duration::from_millis(10);

    /// Samples of 100 Hz, each with its number and what the clock shows; the host hears of each after `delay`.
    fn judged(clock: impl Fn(u32) -> u64, samples: u32, delay: impl Fn(u32) -> u64) -> (Vec<Judged>, Vec<Event>) {
        let (mut time, mut events) = (DeviceTime::default(), Vec::new());
        let judge = |number: u32| {
            let now = Duration::from_micros(u64::from(number) * 10_000 + delay(number));
            time.judge(now, number, clock(number), Some(PERIOD), &mut events)
        };
        ((0..samples).map(judge).collect(), events)
    }

    fn right(number: u32) -> u64 {
        5_000_000 + u64::from(number) * 10_000
    }

    #[test]
    fn a_clock_that_keeps_to_the_rule_is_believed_to_the_microsecond() {
        // Clumps of 200 ms.
        let clumps = |number: u32| u64::from(20 - number % 20) * 10_000;
        let (times, events) = judged(right, 1_000, clumps);
        assert!(times.iter().enumerate().all(|(n, &at)| at == Judged::At(right(n as u32))) && events.is_empty());
        // 30 ms steps.
        let coarse = |number: u32| right(number) / 30_000 * 30_000;
        let (times, events) = judged(coarse, 1_000, |_| 500);
        assert!(events.is_empty(), "{events:?}");
        for (n, at) in times.iter().enumerate() {
            let Judged::At(at) = *at else { panic!("{n}") };
            assert!(at.abs_diff(right(n as u32)) <= 30_000, "{n}: {at}");
        }
    }

    #[test]
    fn a_single_leap_is_rejected_named_and_forgotten() {
        for leap in [1 << 17, 1 << 32, 1 << 63] {
            let clock = |number: u32| right(number) + if number == 400 { leap } else { 0 };
            let (times, events) = judged(clock, 800, |_| 500);
            assert_eq!(times[400], Judged::Leap);
            let others = times.iter().enumerate().filter(|(n, _)| *n != 400);
            assert!(others.into_iter().all(|(n, &at)| at == Judged::At(right(n as u32))));
            let [Event::Notice(DeviceNotice::ClockLeaps { seconds, .. })] = events[..] else { panic!("{events:?}") };
            assert!((seconds - (leap as f64 * 1e-6 + 0.01)).abs() < 1e-3);
        }
    }

    #[test]
    fn a_clock_that_stays_ahead_costs_two_samples_and_no_time() {
        let clock = |number: u32| right(number) + if number >= 400 { 1 << 40 } else { 0 };
        let (times, _) = judged(clock, 800, |_| 500);
        assert_eq!(times[400..402], [Judged::Leap; 2]);
        assert!((402..800).all(|n| times[n] == Judged::At(right(n as u32))));
    }

    #[test]
    fn a_clock_that_goes_back_is_continued_by_its_numbers() {
        for back in [3_000, 999_000, 4_000_000] {
            let clock = |number: u32| right(number) - if number >= 400 { back } else { 0 };
            let (times, events) = judged(clock, 800, |_| 500);
            let steps_back = back > 10_000;
            assert_eq!(events.len(), usize::from(steps_back), "{events:?}");
            let off = if steps_back { 0 } else { back };
            assert!((400..800).all(|n| times[n] == Judged::At(right(n as u32) - off)), "{back}");
        }
    }

    #[test]
    fn a_clock_that_stands_still_is_rebuilt_from_numbers_and_host_time() {
        for (from, until) in [(0, 800), (100, 800), (100, 500)] {
            let clock = |number: u32| right(if (from..until).contains(&number) { from } else { number });
            let (times, events) = judged(clock, 800, |number| 300 + u64::from(number * 7 % 13) * 100);
            let mut before = None;
            for (n, at) in times.iter().enumerate() {
                let Judged::At(at) = *at else { panic!("{n}") };
                assert!(before.is_none_or(|before| at > before), "{n}: time advances");
                assert!(at.abs_diff(right(n as u32)) < 3_000, "{n}: {at} in place of {}", right(n as u32));
                before = Some(at);
            }
            assert!(matches!(events[..], [Event::Notice(DeviceNotice::ClockStands { .. })]), "{events:?}");
        }
    }

    #[test]
    fn samples_that_are_missing_or_held_back_are_no_fault_of_the_clock() {
        let (mut time, mut events) = (DeviceTime::default(), Vec::new());
        let mut judge = |millis: u64, number: u32| {
            let at = time.judge(Duration::from_millis(millis), number, right(number), Some(PERIOD), &mut events);
            assert_eq!(at, Judged::At(right(number)), "{number}");
        };
        judge(0, 0);
        judge(10, 1);
        // The line was silent for a minute and the samples of that time are lost.
        judge(60_010, 6_001);
        // It held back the samples of a minute.
        for number in 6_002..12_000 {
            judge(120_000, number);
        }
        // One comes again.
        judge(120_000, 11_990);
        assert!(events.is_empty(), "{events:?}");
    }
}
