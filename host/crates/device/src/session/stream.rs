//! The stream of samples: its state, its rate, and its sequence numbers.

use std::collections::VecDeque;
use std::time::Duration;

use super::device_time::{DeviceTime, Judged};
use super::sequence::{Followed, SequenceFollower};
use crate::events::{DeviceNotice, DeviceProblem, Event, SessionCounters};

/// A clock that goes back this often within this time is not a restarting device.
const BACKWARDS: usize = 4;
const BACKWARDS_WITHIN: Duration = Duration::from_secs(20);
/// More samples per 1,000 seconds than 12 Mbaud carry of the smallest kind.
const IMPOSSIBLE_RATE: u32 = 50_000_000;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Phase {
    #[default]
    Stopped,
    /// Start has been requested, nothing received yet.
    Starting,
    Running,
}

#[derive(Clone, Copy, Debug)]
struct RateAnswer {
    asked: u32,
    granted: u32,
}

/// The stream, from the request to its last sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Stream {
    phase: Phase,
    rate_asked: u32,
    rate: Option<RateAnswer>,
    sequence: SequenceFollower,
    time: DeviceTime,
    backward_clock: BackwardClock,
    last_sample: Duration,
}

/// What must be requested on the way to a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Missing {
    /// An answer to the requested rate.
    Rate,
    /// Samples.
    Start,
    Nothing,
}

/// What to do with a sample, by its number and its clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// It was taken at this time, microseconds of the device's clock.
    Use(u64),
    Drop,
    /// The device has restarted.
    Restarted,
}

impl Stream {
    pub(super) fn is_on(&self) -> bool {
        self.phase != Phase::Stopped
    }

    /// Goes back to before the first start; the next start overwrites what was learnt of sequence and time.
    pub(super) fn forget(&mut self) {
        self.rate = None;
        self.phase = Phase::Stopped;
    }

    pub(super) fn stopped(&mut self) {
        self.phase = Phase::Stopped;
    }

    /// This rate is being requested.
    pub(super) fn asked_rate(&mut self, rate_millihertz: u32) {
        self.rate_asked = rate_millihertz;
    }

    /// The device answers with this rate.
    pub(super) fn granted(&mut self, granted: u32, events: &mut Vec<Event>) {
        let asked = self.rate_asked;
        self.rate = Some(RateAnswer { asked, granted });
        events.push(Event::RateGranted { asked_millihertz: asked, granted_millihertz: granted });
        if granted > IMPOSSIBLE_RATE {
            let hertz = f64::from(granted) / 1_000.0;
            events.push(Event::Notice(DeviceNotice::ImpossibleRate { hertz }));
        }
    }

    /// Samples arrive from now on, or still do.
    pub(super) fn running(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.last_sample = now;
        if self.phase == Phase::Starting {
            self.phase = Phase::Running;
            events.push(Event::Started);
        }
    }

    /// Tracks the number and the clock of a sample.
    pub(super) fn follow(
        &mut self,
        now: Duration,
        sequence: u32,
        device_micros: u64,
        counters: &mut SessionCounters,
        events: &mut Vec<Event>,
    ) -> Arrival {
        let judged = self.time.judge(now, sequence, device_micros, self.period(), events);
        counters.clock_faults = self.time.faults();
        let Judged::At(micros) = judged else { return Arrival::Drop };
        if self.time.take_went_back() {
            self.backward_clock.went_back(now, events);
        }
        match self.sequence.follow(sequence, micros) {
            Followed::Next => Arrival::Use(micros),
            Followed::After(count) => {
                counters.lost_samples += u64::from(count);
                events.push(Event::Lost { count, next_sequence: sequence });
                Arrival::Use(micros)
            }
            Followed::Duplicate => {
                counters.duplicate_samples += 1;
                Arrival::Drop
            }
            Followed::Restarted => {
                self.backward_clock.went_back(now, events);
                Arrival::Restarted
            }
        }
    }

    /// The time from one sample to the next at the rate granted, if that is one that a line carries.
    fn period(&self) -> Option<Duration> {
        let granted = self.rate?.granted;
        (1..=IMPOSSIBLE_RATE).contains(&granted).then(|| Duration::from_nanos(1_000_000_000_000 / u64::from(granted)))
    }

    /// What is missing for a stream at this rate. While samples should arrive but do not, start is repeatedly
    /// missing: it changes nothing for a device that streams. `start_awaited`: whether a start is still unanswered.
    pub(super) fn pursue(&mut self, rate: u32, now: Duration, stalled_after: Duration, start_awaited: bool) -> Missing {
        let granted = match self.rate {
            Some(answer) if answer.asked == rate => answer.granted,
            _ => return Missing::Rate,
        };
        let four_periods = Duration::from_millis(4_000_000 / u64::from(granted.max(1)));
        let stalled = now > self.last_sample + stalled_after.max(four_periods);
        if self.phase == Phase::Stopped {
            self.phase = Phase::Starting;
            self.sequence = SequenceFollower::default();
            self.time.begin();
        } else if self.phase == Phase::Running && !stalled && !start_awaited {
            return Missing::Nothing;
        }
        Missing::Start
    }
}

/// When the clock of the samples last went back, and whether that was reported.
#[derive(Clone, Debug, Default)]
struct BackwardClock {
    times: VecDeque<Duration>,
    told: bool,
}

impl BackwardClock {
    /// It went back: a single time means the device restarted.
    fn went_back(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.times.retain(|&at| now < at + BACKWARDS_WITHIN);
        self.told &= !self.times.is_empty();
        self.times.push_back(now);
        let (times, since) = (self.times.len(), self.times.front().copied().unwrap_or(now));
        if times >= BACKWARDS && !std::mem::replace(&mut self.told, true) {
            let seconds = now.saturating_sub(since).as_secs();
            events.push(Event::Problem(DeviceProblem::ClockRunsBackwards { times, seconds }));
        }
    }
}
