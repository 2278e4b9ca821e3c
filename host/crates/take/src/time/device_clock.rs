//! One timeline from a device clock that may restart, and may be wrong.
//!
//! A device's clock never goes back, never stands and never leaps while the device runs. In takes of devices that break
//! that (the session of this program mends it before it records, older ones and other programs' may not) a time that
//! contradicts the sequence number and the host's time is replaced by what those two say.

use std::fmt;

use crate::file::{EventKind, Record, Take};

/// A clock that goes back further than this has restarted, unless the sequence numbers go on; less is a sample that came
/// late.
const RESTART_STEP_MICROS: u64 = 1_000_000;
/// A clock goes ahead by no more than this times what number and host time say, and the margin besides, microseconds:
/// bytes come in clumps. Without a host time the rate that was asked for says how long a sample takes, which is less
/// certain.
const LEAP_FACTOR: f64 = 2.0;
const LEAP_MARGIN: f64 = 100e3;
const LEAP_MARGIN_WITHOUT_HOST: f64 = 60e6;
/// A sample this far ahead of the last one is no continuation of it, in numbers.
const CONTINUES: u32 = 1 << 24;
/// After this many samples in a row that leapt and agree with each other, the clock is where they say.
const SETTLED: u32 = 3;
/// A clock that shows one time for this many samples in a row stands still; one that counts in coarse steps does not.
const STANDS: u32 = 5;
/// How much of its distance from the host's time a rebuilt place makes up with each sample.
const TOWARDS_HOST: f64 = 0.1;

/// The device restarted in the middle of the take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockRestart {
    /// Time of the first sample afterwards, seconds since the take's first sample.
    pub at_seconds: f64,
    /// Time between it and the latest sample before.
    pub gap_seconds: f64,
    /// Whether the gap was measured by the host's clock. Otherwise it is unknown how long the device was away, and the
    /// gap is taken as one sample period.
    pub measured: bool,
}

/// Samples whose device time could not be believed; their times are rebuilt from their numbers and the host's time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ClockFaults {
    /// Their clock leapt ahead.
    pub leapt: u64,
    /// Their clock stood still.
    pub stood: u64,
    /// Their clock went back while their numbers went on.
    pub went_back: u64,
}

impl ClockFaults {
    /// Whether every time was believed.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for ClockFaults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let kinds = [(self.leapt, "leapt ahead"), (self.stood, "stood still"), (self.went_back, "went back")];
        let mut said = kinds.iter().filter(|(count, _)| *count > 0).peekable();
        if said.peek().is_none() {
            return f.write_str("the device's clock was right throughout");
        }
        f.write_str("the device's clock ")?;
        for (index, (count, what)) in said.enumerate() {
            let separator = if index > 0 { ", " } else { "" };
            let samples = if *count == 1 { "sample" } else { "samples" };
            write!(f, "{separator}{what} at {count} {samples}")?;
        }
        f.write_str("; times are rebuilt from the samples' numbers and the host's clock")
    }
}

/// What a take says of the time of a sample.
#[derive(Clone, Copy, Debug)]
struct SampleTime {
    sequence: u32,
    device_micros: u64,
    host_seconds: Option<f64>,
    /// The device was seen to restart since the sample before.
    restarted: bool,
}

/// Places device times on one timeline that starts with the first one.
#[derive(Debug)]
pub(crate) struct DeviceClock {
    /// All samples of the take, and which of them is next.
    samples: Vec<SampleTime>,
    next: usize,
    /// Assumed time between two samples if nothing better is known.
    period_micros: i64,
    /// The same, if the take says.
    nominal_micros: Option<f64>,
    run: Option<Run>,
    restarts: Vec<ClockRestart>,
    faults: ClockFaults,
}

/// The time from one start of the device to the next.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// A time that the clock shows, and its place on the timeline.
    base_device_micros: u64,
    base_micros: i64,
    latest: Latest,
    /// Samples in a row that leapt and agree with each other, with the last of them.
    leapt: Option<(u32, Latest)>,
    /// Samples in a row that show one time, and the first of them.
    stands: Option<(u32, Latest)>,
}

/// A sample, as its clock shows it and where it is on the timeline.
#[derive(Clone, Copy, Debug)]
struct Latest {
    sequence: u32,
    device_micros: u64,
    micros: i64,
    host_seconds: Option<f64>,
}

impl Run {
    fn begin(sequence: u32, device_micros: u64, micros: i64, host_seconds: Option<f64>) -> Self {
        let latest = Latest { sequence, device_micros, micros, host_seconds };
        Self { base_device_micros: device_micros, base_micros: micros, latest, leapt: None, stands: None }
    }

    fn place(&self, device_micros: u64) -> i64 {
        let since = i128::from(device_micros) - i128::from(self.base_device_micros);
        let limit = i128::from(i64::MAX / 4);
        self.base_micros.saturating_add(since.clamp(-limit, limit) as i64)
    }
}

/// What number and host time say of the time since the latest sample, microseconds.
#[derive(Clone, Copy, Debug)]
struct Passed {
    by_number: Option<f64>,
    by_host: Option<f64>,
}

impl Passed {
    fn longer(self) -> Option<f64> {
        match (self.by_number, self.by_host) {
            (Some(number), Some(host)) => Some(number.max(host)),
            (one, other) => one.or(other),
        }
    }

    /// How far the clock may go ahead.
    fn most(self) -> Option<f64> {
        let margin = if self.by_host.is_some() { LEAP_MARGIN } else { LEAP_MARGIN_WITHOUT_HOST };
        self.longer().map(|passed| LEAP_FACTOR * passed + margin)
    }
}

impl DeviceClock {
    /// A clock for the samples of this take, in their order.
    pub(crate) fn new(take: &Take) -> Self {
        let mut samples = Vec::new();
        let mut restarted = false;
        for record in take.records() {
            match record {
                Record::Sample(sample) => {
                    let (sequence, device_micros) = (sample.raw.sequence, sample.raw.device_micros);
                    let host_seconds = sample.host_receive_seconds.filter(|seconds| seconds.is_finite());
                    samples.push(SampleTime { sequence, device_micros, host_seconds, restarted });
                    restarted = false;
                }
                Record::Event(event) if event.kind == EventKind::Restart => restarted = !samples.is_empty(),
                _ => {}
            }
        }
        Self::of(take.header().nominal_samples_per_second, samples)
    }

    fn of(nominal_samples_per_second: Option<f64>, samples: Vec<SampleTime>) -> Self {
        let nominal = nominal_samples_per_second.map(|rate| 1e6 / rate);
        let nominal_micros = nominal.filter(|period| period.is_finite() && (1.0..=60e6).contains(period));
        let period = nominal.unwrap_or(0.0);
        // An invalid rate leaves the smallest possible step.
        let period_micros = if period.is_finite() { period.clamp(1.0, 60e6) as i64 } else { 1 };
        Self {
            samples,
            next: 0,
            period_micros,
            nominal_micros,
            run: None,
            restarts: Vec::new(),
            faults: ClockFaults::default(),
        }
    }

    /// Place of the next sample of the take on the timeline, microseconds after the first one.
    pub(crate) fn next_sample(&mut self) -> i64 {
        let Some(&now) = self.samples.get(self.next) else { return self.run.map_or(0, |run| run.latest.micros) };
        self.next += 1;
        let SampleTime { sequence, device_micros, host_seconds, restarted } = now;
        let Some(mut run) = self.run else {
            self.run = Some(Run::begin(sequence, device_micros, 0, host_seconds));
            return 0;
        };
        let ahead = sequence.wrapping_sub(run.latest.sequence);
        let continues = (1..=CONTINUES).contains(&ahead);
        let back = run.latest.device_micros.saturating_sub(device_micros);
        let micros = if restarted || (!continues && back > RESTART_STEP_MICROS) {
            run = self.restart(run, sequence, device_micros, host_seconds);
            run.base_micros
        } else {
            let by_host = host_seconds.zip(run.latest.host_seconds).map(|(now, then)| (now - then).max(0.0) * 1e6);
            let by_number = self.nominal_micros.filter(|_| continues).map(|period| period * f64::from(ahead));
            let now = Latest { sequence, device_micros, micros: 0, host_seconds };
            self.go_on(&mut run, now, continues, Passed { by_number, by_host })
        };
        self.run = Some(run);
        micros
    }

    /// Whether this is so for each of the next samples of the same run, as many as these.
    fn goes_on(&self, samples: u32, is_so: impl Fn(u64) -> bool) -> bool {
        let upcoming = self.samples[self.next..].iter().take(samples as usize).take_while(|sample| !sample.restarted);
        upcoming.filter(|sample| is_so(sample.device_micros)).count() == samples as usize
    }

    /// Place of a sample of the same run of the device.
    fn go_on(&mut self, run: &mut Run, now: Latest, continues: bool, passed: Passed) -> i64 {
        let latest = run.latest;
        if now.device_micros > latest.device_micros {
            let step = run.place(now.device_micros).saturating_sub(latest.micros) as f64;
            if passed.most().is_some_and(|most| step > most) {
                return self.leap(run, now, passed);
            }
            return self.forward(run, now, passed);
        }
        if !continues {
            // It came late, or again: it stays at its own time.
            return run.place(now.device_micros);
        }
        if now.device_micros == latest.device_micros {
            let stands = run.stands.is_some() || self.goes_on(STANDS - 1, |micros| micros == now.device_micros);
            return if stands { self.stand(run, now, passed) } else { run.place(now.device_micros) };
        }
        let far = latest.device_micros - now.device_micros > RESTART_STEP_MICROS;
        let stays = self.goes_on(SETTLED, |micros| micros < latest.device_micros);
        if !stays && !far {
            return run.place(now.device_micros);
        }
        self.faults.went_back += 1;
        let rebuilt = latest.micros.saturating_add(self.step(passed));
        if stays {
            (run.base_device_micros, run.base_micros) = (now.device_micros, rebuilt);
            self.forward(run, now, passed)
        } else {
            rebuilt
        }
    }

    /// Place of a sample whose time can be believed.
    fn forward(&mut self, run: &mut Run, now: Latest, passed: Passed) -> i64 {
        let latest = run.latest;
        if run.stands.is_some() && run.place(now.device_micros) <= latest.micros {
            // The clock continues from where it stopped.
            let rebuilt = latest.micros.saturating_add(self.step(passed));
            (run.base_device_micros, run.base_micros) = (now.device_micros, rebuilt);
        }
        (run.leapt, run.stands) = (None, None);
        let micros = run.place(now.device_micros);
        run.latest = Latest { micros, host_seconds: now.host_seconds.or(latest.host_seconds), ..now };
        micros
    }

    /// The time to the next sample where the clock says nothing.
    fn step(&self, passed: Passed) -> i64 {
        let step = passed.by_number.or(passed.by_host).unwrap_or(self.period_micros as f64);
        step.clamp(1.0, i64::MAX as f64 / 4.0) as i64
    }

    fn leap(&mut self, run: &mut Run, now: Latest, passed: Passed) -> i64 {
        self.faults.leapt += 1;
        let waited = passed.longer().unwrap_or(1.0).clamp(1.0, i64::MAX as f64 / 4.0) as i64;
        let micros = run.latest.micros.saturating_add(waited);
        let agrees = |(_, before): &(u32, Latest)| {
            let step = now.device_micros.checked_sub(before.device_micros);
            step.is_some_and(|step| passed.most().is_some_and(|most| step as f64 <= most))
        };
        let agree = run.leapt.filter(agrees).map_or(1, |(agree, _)| agree + 1);
        let now = Latest { micros, host_seconds: now.host_seconds.or(run.latest.host_seconds), ..now };
        run.leapt = Some((agree, now));
        if agree >= SETTLED {
            *run = Run::begin(now.sequence, now.device_micros, micros, now.host_seconds);
        }
        micros
    }

    /// The clock shows what it showed before: number and host time say when the sample was taken.
    fn stand(&mut self, run: &mut Run, now: Latest, passed: Passed) -> i64 {
        let (samples, since) = run.stands.map_or((1, run.latest), |(samples, since)| (samples + 1, since));
        run.stands = Some((samples, since));
        self.faults.stood += 1;
        let by_number = run.latest.micros.saturating_add(self.step(passed));
        let lasted = now.host_seconds.zip(since.host_seconds).map(|(now, then)| (now - then).max(0.0) * 1e6);
        let steered = lasted.map_or(by_number as f64, |lasted| {
            by_number as f64 + TOWARDS_HOST * (since.micros as f64 + lasted - by_number as f64)
        });
        let limit = i64::MAX as f64 / 4.0;
        let micros = (steered.clamp(-limit, limit) as i64).max(run.latest.micros.saturating_add(1));
        run.leapt = None;
        run.latest = Latest { micros, host_seconds: now.host_seconds.or(run.latest.host_seconds), ..now };
        micros
    }

    /// Place of a device time without a sample.
    pub(crate) fn place(&mut self, device_micros: u64) -> i64 {
        let run = self.run.get_or_insert_with(|| Run::begin(0, device_micros, 0, None));
        run.place(device_micros)
    }

    /// The restarts, and the samples whose time was not believed.
    pub(crate) fn finish(self) -> (Vec<ClockRestart>, ClockFaults) {
        (self.restarts, self.faults)
    }

    fn restart(&mut self, before: Run, sequence: u32, device_micros: u64, host_seconds: Option<f64>) -> Run {
        let elapsed = host_seconds.zip(before.latest.host_seconds).map(|(now, then)| now - then);
        let measured = elapsed.filter(|seconds| *seconds > 0.0).map(|seconds| (seconds * 1e6).round() as i64);
        let gap_micros = measured.unwrap_or(self.period_micros).clamp(1, i64::MAX / 4);
        let start_micros = before.latest.micros.saturating_add(gap_micros);
        self.restarts.push(ClockRestart {
            at_seconds: start_micros as f64 * 1e-6,
            gap_seconds: gap_micros as f64 * 1e-6,
            measured: measured.is_some(),
        });
        Run::begin(sequence, device_micros, start_micros, host_seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A clock for samples given by number, device time and host time.
    fn clock(rate: Option<f64>, samples: &[(u32, u64, Option<f64>)]) -> DeviceClock {
        let sample = |&(sequence, device_micros, host_seconds): &(u32, u64, Option<f64>)| SampleTime {
            sequence,
            device_micros,
            host_seconds,
            restarted: false,
        };
        DeviceClock::of(rate, samples.iter().map(sample).collect())
    }

    #[test]
    fn late_samples_stay_at_their_own_time() {
        for numbers in [[7, 9, 8, 6], [7, 8, 9, 10]] {
            let times = [5_000_000, 5_020_000, 5_010_000, 4_990_000];
            let samples = [0, 1, 2, 3].map(|n: usize| (numbers[n], times[n], None));
            let mut clock = clock(Some(100.0), &samples);
            let places = samples.map(|_| clock.next_sample());
            assert_eq!(places, [0, 20_000, 10_000, -10_000]);
            assert_eq!(clock.finish(), (vec![], ClockFaults::default()));
        }
    }

    #[test]
    fn a_restart_is_measured_by_the_host_where_it_can() {
        let mut clock = clock(Some(100.0), &[(900, 9_000_000, Some(10.0)), (0, 400, Some(12.5)), (1, 10_400, None)]);
        assert_eq!([0; 3].map(|_| clock.next_sample()), [0, 2_500_000, 2_510_000]);
        assert_eq!(clock.finish().0, [ClockRestart { at_seconds: 2.5, gap_seconds: 2.5, measured: true }]);
    }

    #[test]
    fn an_unmeasured_restart_takes_one_period_and_says_so() {
        let mut clock = clock(Some(100.0), &[(900, 9_000_000, None), (0, 400, None)]);
        assert_eq!([0; 2].map(|_| clock.next_sample()), [0, 10_000]);
        assert!(!clock.finish().0[0].measured);
    }

    #[test]
    fn an_announced_restart_counts_even_if_the_clock_went_forward() {
        let mut clock = clock(Some(1000.0), &[(0, 100, Some(1.0)), (1, 5_000_000, Some(1.25))]);
        clock.samples[1].restarted = true;
        assert_eq!([0; 2].map(|_| clock.next_sample()), [0, 250_000]);
    }

    /// Places of 800 samples of 100 Hz whose clock shows this, with and without the host's times.
    fn places(device: impl Fn(u32) -> u64, hosts: bool) -> (Vec<i64>, ClockFaults) {
        let host = |n: u32| hosts.then(|| 3.0 + f64::from(n) * 0.01 + f64::from(n * 7 % 13) * 1e-4);
        let samples: Vec<_> = (0..800).map(|n| (n, device(n), host(n))).collect();
        let mut clock = clock(Some(100.0), &samples);
        let places = samples.iter().map(|_| clock.next_sample()).collect();
        let (restarts, faults) = clock.finish();
        assert_eq!(restarts, []);
        (places, faults)
    }

    fn right(n: u32) -> u64 {
        5_000_000 + u64::from(n) * 10_000
    }

    #[test]
    fn times_that_cannot_be_are_rebuilt_and_counted() {
        let none = ClockFaults::default();
        let leaps = |by: u64| move |n: u32| right(n) + if n == 400 { by } else { 0 };
        let stays = |n: u32| right(n) + if n >= 400 { 1 << 40 } else { 0 };
        let back = |n: u32| right(n) - if n >= 400 { 900_000 } else { 0 };
        let once = |n: u32| right(n) - if n == 400 { 4_000_000 } else { 0 };
        let stands = |n: u32| right(n.min(100));
        let resumes = |n: u32| right(if (100..300).contains(&n) { 100 } else { n });
        for hosts in [true, false] {
            for (name, (places, faults), expected) in [
                ("leap of 32 bits", places(leaps(1 << 32), hosts), ClockFaults { leapt: 1, ..none }),
                ("leap of 63 bits", places(leaps(1 << 63), hosts), ClockFaults { leapt: 1, ..none }),
                ("stays ahead", places(stays, hosts), ClockFaults { leapt: 3, ..none }),
                ("goes back", places(back, hosts), ClockFaults { went_back: 1, ..none }),
                ("goes back once", places(once, hosts), ClockFaults { went_back: 1, ..none }),
                ("stands", places(stands, hosts), ClockFaults { stood: 699, ..none }),
                ("stands for a while", places(resumes, hosts), ClockFaults { stood: 199, ..none }),
            ] {
                assert_eq!(faults, expected, "{name}");
                for (n, place) in places.iter().enumerate() {
                    let off = place - 10_000 * n as i64;
                    assert!(off.abs() <= 3_000, "{name}, host times: {hosts}: sample {n} is off by {off} µs");
                }
                assert!(places.is_sorted_by(|a, b| a < b), "{name}");
                let words = faults.to_string();
                assert!(words.contains(" at ") && words.contains("rebuilt"), "{words}");
            }
        }
    }

    #[test]
    fn a_clock_that_is_right_is_not_touched() {
        // Every tenth sample is missing, what comes comes in clumps of half a second, and then nobody took samples for
        // ten minutes.
        let numbers = (0..5_000).filter(|n| n % 10 != 3);
        let mut samples: Vec<_> = numbers.map(|n| (n, right(n), Some(f64::from(n / 50 + 1) * 0.5))).collect();
        samples.push((5_000, right(65_000), Some(650.5)));
        let mut clock = clock(Some(100.0), &samples);
        for &(_, micros, _) in &samples {
            assert_eq!(clock.next_sample(), (micros - right(0)) as i64);
        }
        assert_eq!(clock.finish(), (vec![], ClockFaults::default()));
    }

    #[test]
    fn clocks_from_hostile_files_saturate() {
        let mut samples = Vec::new();
        for (n, micros) in [0, u64::MAX, 0, u64::MAX, 1, u64::MAX, 2, u64::MAX].into_iter().enumerate() {
            let n = n as u32;
            samples.push((n, micros, Some(f64::MAX)));
            samples.push((n, micros, None));
            samples.push((u32::MAX - n, micros, Some(-f64::MAX)));
        }
        for rate in [None, Some(0.0), Some(-1.0), Some(f64::NAN), Some(f64::INFINITY)] {
            let mut clock = clock(rate, &samples);
            (0..samples.len() + 3).for_each(|_| {
                clock.next_sample();
            });
        }
    }
}
