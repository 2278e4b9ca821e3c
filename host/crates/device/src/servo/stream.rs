//! The stream: one reading of all servos after another, even if some are missing.

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::SensorState;

use super::bus::ReadMode;
use super::packet::Status;
use super::readings::Readings;
use super::roster::Roster;
use super::settings::ServoSettings;
use crate::arm::ServoProtocol;
use crate::events::{DeviceNotice, Event, Sample};

/// After this many readings in a row without any answer, the next slower read mode is tried.
const BARREN: u32 = 3;

/// One reading of all servos in progress.
#[derive(Clone, Debug)]
struct Cycle {
    began: Duration,
    /// Servos still to be asked, request by request.
    groups: VecDeque<Vec<usize>>,
    /// Whether those that did not answer have been asked again.
    repeated: bool,
    readings: Vec<Option<(u16, SensorState)>>,
}

/// What to do next.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Next {
    /// Ask these servos for their positions.
    Ask(Vec<usize>),
    /// Ask this servo, which is missing, who it is.
    Probe(usize),
    /// Look for the servos again: none is left.
    Search,
    /// Ask again what to do next.
    Proceed,
    /// Nothing for now.
    Wait,
}

/// The stream of readings.
#[derive(Clone, Debug)]
pub(super) struct Stream {
    settings: ServoSettings,
    quickest: ReadMode,
    mode: ReadMode,
    /// Readings in a row without any answer.
    barren: u32,
    cycle: Option<Cycle>,
    readings: Readings,
    wanted: Option<u32>,
    granted: Option<u32>,
    streaming: bool,
    next_cycle: Duration,
    next_probe: Duration,
    sequence: u32,
    last_micros: u64,
    slower_told: bool,
    samples: u64,
    lost: u64,
    repeated: u64,
}

impl Stream {
    pub(super) fn new(protocol: ServoProtocol, servos: usize, settings: ServoSettings) -> Self {
        let quickest = match protocol {
            ServoProtocol::Feetech => ReadMode::Sync,
            ServoProtocol::Dynamixel => ReadMode::Fast,
        };
        Self {
            settings,
            quickest,
            mode: quickest,
            barren: 0,
            cycle: None,
            readings: Readings::new(servos),
            wanted: None,
            granted: None,
            streaming: false,
            next_cycle: Duration::ZERO,
            next_probe: Duration::ZERO,
            sequence: 0,
            last_micros: 0,
            slower_told: false,
            samples: 0,
            lost: 0,
            repeated: 0,
        }
    }

    /// The current read mode.
    pub(super) fn mode(&self) -> ReadMode {
        self.mode
    }

    /// Whether readings are coming.
    pub(super) fn is_on(&self) -> bool {
        self.streaming
    }

    /// When the next reading begins.
    pub(super) fn next_cycle(&self) -> Duration {
        self.next_cycle
    }

    /// Samples delivered, samples lost, and requests sent again.
    pub(super) fn counts(&self) -> (u64, u64, u64) {
        (self.samples, self.lost, self.repeated)
    }

    /// Requests this many readings per 1,000 seconds, or none.
    pub(super) fn want(&mut self, rate_millihertz: Option<u32>) {
        self.wanted = rate_millihertz;
        if rate_millihertz.is_some() {
            self.granted = None;
        }
    }

    /// The servos are being looked for: the reading in progress is given up.
    pub(super) fn begin_search(&mut self) {
        self.mode = self.quickest;
        self.barren = 0;
        self.cycle = None;
        self.readings.forget_doubts();
    }

    /// The line was reopened: readings start as soon as the servos are found.
    pub(super) fn reopened(&mut self, now: Duration) {
        self.cycle = None;
        self.streaming = false;
        self.next_cycle = now;
    }

    /// The servos are known now; the missing ones are asked again after a while.
    pub(super) fn begin(&mut self, now: Duration) {
        self.next_probe = now + self.settings.probe_every;
    }

    /// A servo is back.
    pub(super) fn welcome(&mut self, servo: usize) {
        self.readings.forget_doubt(servo);
        self.granted = None;
    }

    /// Ends a stream that is no longer wanted; returns whether one was running.
    pub(super) fn end_if_unwanted(&mut self, events: &mut Vec<Event>) {
        if self.wanted.is_none() && std::mem::replace(&mut self.streaming, false) {
            events.push(Event::Stopped);
        }
    }

    /// Continues the reading, or starts the next one if it is due.
    pub(super) fn proceed(
        &mut self,
        now: Duration,
        baud: u32,
        epoch: u16,
        roster: &mut Roster,
        events: &mut Vec<Event>,
    ) -> Next {
        if let Some(cycle) = &mut self.cycle {
            if let Some(group) = cycle.groups.pop_front() {
                return Next::Ask(group);
            }
            self.finish_cycle(now, epoch, roster, events);
            return Next::Proceed;
        }
        let Some(asked) = self.wanted else {
            self.end_if_unwanted(events);
            return Next::Wait;
        };
        let present = roster.present();
        if present.is_empty() {
            // Everything is gone: the arm may have lost power, or come back at another speed.
            return Next::Search;
        }
        let granted = self.grant(asked, baud, roster, events);
        if !std::mem::replace(&mut self.streaming, true) {
            self.sequence = 0;
            self.next_cycle = now;
            events.push(Event::Started);
        }
        if now >= self.next_probe {
            self.next_probe = now + self.settings.probe_every;
            if let Some(servo) = self.next_missing(roster) {
                return Next::Probe(servo);
            }
        }
        if now < self.next_cycle {
            return Next::Wait;
        }
        let period = Duration::from_nanos(1_000_000_000_000 / u64::from(granted.max(1)));
        let on_time = self.next_cycle + period;
        self.next_cycle = if on_time > now { on_time } else { now };
        self.begin_cycle(now, present);
        Next::Proceed
    }

    fn grant(&mut self, asked: u32, baud: u32, roster: &Roster, events: &mut Vec<Event>) -> u32 {
        if let Some(granted) = self.granted {
            return granted;
        }
        let bound = (roster.bound_hertz(self.mode, baud) * 1000.0) as u32;
        let granted = asked.min(bound).max(1);
        self.granted = Some(granted);
        events.push(Event::RateGranted { asked_millihertz: asked, granted_millihertz: granted });
        granted
    }

    /// The missing servos take turns being asked.
    fn next_missing(&self, roster: &Roster) -> Option<usize> {
        let missing = roster.missing();
        let turn = (self.next_probe.as_nanos() / self.settings.probe_every.as_nanos().max(1)) as usize;
        missing.get(turn % missing.len().max(1)).copied()
    }

    fn begin_cycle(&mut self, now: Duration, present: Vec<usize>) {
        let servos = self.readings.len();
        let groups = if self.mode == ReadMode::Single {
            present.iter().map(|&servo| vec![servo]).collect()
        } else {
            VecDeque::from([present])
        };
        self.cycle = Some(Cycle { began: now, groups, repeated: false, readings: vec![None; servos] });
    }

    /// Takes the positions that a group of servos answered; `silent`: those that did not, in order.
    pub(super) fn take_positions(
        &mut self,
        now: Duration,
        answers: &[(usize, Status)],
        silent: &[usize],
        roster: &mut Roster,
        events: &mut Vec<Event>,
    ) {
        let protocol = roster.protocol();
        for (servo, status) in answers {
            roster.hear_error(*servo, status.error, events);
            if let Some(counts) = protocol.counts(status).filter(|_| !protocol.failed(status.error)) {
                let state = self.readings.judge(*servo, now, counts);
                if let Some(cycle) = &mut self.cycle {
                    cycle.readings[*servo] = Some((counts, state));
                }
            }
        }
        let Some(cycle) = &mut self.cycle else { return };
        let Some(&first_missing) = silent.first() else { return };
        if cycle.repeated || self.mode == ReadMode::Single {
            return;
        }
        // Servos answer in turn, each waiting for the one before: after a missing one nobody answers. If others
        // answered after the first missing one, its answer was only damaged.
        cycle.repeated = true;
        let broke_off = answers.iter().all(|(servo, _)| *servo < first_missing);
        let again: Vec<usize> = silent.iter().copied().skip(usize::from(broke_off)).collect();
        if !again.is_empty() {
            self.repeated += 1;
            cycle.groups.push_back(again);
        }
    }

    fn finish_cycle(&mut self, now: Duration, epoch: u16, roster: &mut Roster, events: &mut Vec<Event>) {
        let Some(cycle) = self.cycle.take() else { return };
        if cycle.readings.iter().all(Option::is_none) {
            self.lost += 1;
            events.push(Event::Lost { count: 1, next_sequence: self.sequence });
            self.go_slower(&cycle, roster, events);
            return;
        }
        if self.mode != self.quickest
            && self.granted.is_some()
            && self.barren == 0
            && !std::mem::replace(&mut self.slower_told, true)
        {
            let (quick, instead) = (self.quickest.words(), self.mode.words());
            events.push(Event::Notice(DeviceNotice::SlowerReads { quick, instead }));
            self.granted = None;
        }
        self.barren = 0;
        self.strike(&cycle, roster, events);
        let counts = |(servo, reading): (usize, &Option<(u16, SensorState)>)| {
            reading.map_or_else(|| self.readings.last(servo).unwrap_or(0), |(counts, _)| counts)
        };
        let middle = ((cycle.began + now) / 2).as_micros() as u64;
        self.last_micros = middle.max(self.last_micros + u64::from(self.sequence > 0));
        let sample = Sample {
            device_micros: self.last_micros,
            sequence: self.sequence,
            epoch,
            received: now,
            counts: cycle.readings.iter().enumerate().map(counts).collect(),
            states: cycle.readings.iter().map(|r| r.map_or(SensorState::NoData, |(_, state)| state)).collect(),
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.samples += 1;
        events.push(Event::Sample(sample));
    }

    /// Nobody answered: after a few times the next slower read mode is used.
    fn go_slower(&mut self, cycle: &Cycle, roster: &mut Roster, events: &mut Vec<Event>) {
        self.barren += 1;
        let slower = match self.mode {
            ReadMode::Fast => Some(ReadMode::Sync),
            ReadMode::Sync => Some(ReadMode::Single),
            ReadMode::Single => None,
        };
        match slower {
            Some(_) if self.barren < BARREN => {}
            Some(instead) => {
                self.barren = 0;
                self.mode = instead;
            }
            None => self.strike(cycle, roster, events),
        }
    }

    /// Ignores those that have been silent too often.
    fn strike(&mut self, cycle: &Cycle, roster: &mut Roster, events: &mut Vec<Event>) {
        for (servo, reading) in cycle.readings.iter().enumerate() {
            if roster.strike(servo, reading.is_some(), self.settings.strikes, events) {
                self.granted = None;
            }
        }
    }
}
