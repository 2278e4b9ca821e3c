//! The stream: one reading of all servos after the other, whoever is missing.

use std::collections::VecDeque;
use std::f64::consts::TAU;
use std::time::Duration;

use super::arm::COUNTS_PER_TURN;
use super::bus::ReadMode;
use super::exchange::{Exchange, Purpose, Step, Task};
use super::session::{Phase, ServoSession};
use crate::{DeviceNotice, Event, Sample, SensorState};

/// Faster than a hand turns a joint, radians a second; what moves faster is believed when it is read twice. The check
/// byte of a Feetech status lets one damaged reading in 256 through.
const FASTEST_TURN: f64 = 40.0;
/// What a reading may be off by besides, counts.
const UNLIKELY_MARGIN: f64 = 64.0;
/// After so long without a reading every value is believed.
const FORGOTTEN: Duration = Duration::from_millis(500);
/// So many readings in a row of which nobody answered, and the next slower way of reading is tried.
const BARREN: u32 = 3;

/// One reading of all servos, while it goes on.
#[derive(Clone, Debug)]
pub(super) struct Cycle {
    began: Duration,
    /// Servos still to be asked, request by request.
    groups: VecDeque<Vec<usize>>,
    /// Whether those that did not answer have been asked again.
    repeated: bool,
    readings: Vec<Option<(u16, SensorState)>>,
}

impl ServoSession {
    /// Begins the next reading if it is time; whether anything was done.
    pub(super) fn proceed_stream(&mut self, now: Duration, events: &mut Vec<Event>) -> bool {
        if let Some(cycle) = &mut self.cycle {
            let Some(group) = cycle.groups.pop_front() else {
                self.finish_cycle(now, events);
                return true;
            };
            self.ask_positions(now, &group);
            return true;
        }
        let Some(asked) = self.wanted else {
            if std::mem::replace(&mut self.streaming, false) {
                events.push(Event::Stopped);
            }
            return false;
        };
        if !self.servos.iter().any(|servo| servo.present) {
            // Everything is gone: the arm may be without power, or come back at another speed.
            self.look_from(0);
            return true;
        }
        let granted = self.grant(asked, events);
        if !std::mem::replace(&mut self.streaming, true) {
            self.sequence = 0;
            self.next_cycle = now;
            events.push(Event::Started);
        }
        if now >= self.next_probe {
            self.next_probe = now + self.settings.probe_every;
            if let Some(servo) = self.next_missing() {
                self.tasks.push_back(Task { servo, step: Step::ReadModel, tried: 0 });
                return true;
            }
        }
        if now < self.next_cycle {
            return false;
        }
        let period = Duration::from_nanos(1_000_000_000_000 / u64::from(granted.max(1)));
        let on_time = self.next_cycle + period;
        self.next_cycle = if on_time > now { on_time } else { now };
        self.begin_cycle(now);
        true
    }

    fn grant(&mut self, asked: u32, events: &mut Vec<Event>) -> u32 {
        if let Some(granted) = self.granted {
            return granted;
        }
        let bound = (self.bound_hertz(self.mode) * 1000.0) as u32;
        let granted = asked.min(bound).max(1);
        self.granted = Some(granted);
        events.push(Event::RateGranted { asked_millihertz: asked, granted_millihertz: granted });
        granted
    }

    /// The servos that are missing take turns in being asked after.
    fn next_missing(&self) -> Option<usize> {
        let missing: Vec<usize> =
            (0..self.servos.len()).filter(|&s| !self.servos[s].present && !self.servos[s].foreign).collect();
        let turn = (self.next_probe.as_nanos() / self.settings.probe_every.as_nanos().max(1)) as usize;
        missing.get(turn % missing.len().max(1)).copied()
    }

    fn begin_cycle(&mut self, now: Duration) {
        let present: Vec<usize> = (0..self.servos.len()).filter(|&servo| self.servos[servo].present).collect();
        let groups = if self.mode == ReadMode::Single {
            present.iter().map(|&servo| vec![servo]).collect()
        } else {
            VecDeque::from([present])
        };
        self.cycle = Some(Cycle { began: now, groups, repeated: false, readings: vec![None; self.servos.len()] });
    }

    fn ask_positions(&mut self, now: Duration, group: &[usize]) {
        let ids: Vec<u8> = group.iter().map(|&servo| self.arm.joints[servo].id).collect();
        let request = self.arm.protocol.read_positions(self.mode, &ids);
        let data_length = usize::from(self.arm.protocol.registers().position_length);
        self.send(now, Purpose::Positions, group, data_length, &request);
    }

    pub(super) fn finish_positions(&mut self, now: Duration, exchange: &Exchange, events: &mut Vec<Event>) {
        for (servo, status) in &exchange.answers {
            self.hear_error(*servo, status.error, events);
            let counts = self.arm.protocol.counts(status).filter(|_| !self.arm.protocol.failed(status.error));
            if let Some(counts) = counts {
                let state = self.judge(*servo, now, counts);
                if let Some(cycle) = &mut self.cycle {
                    cycle.readings[*servo] = Some((counts, state));
                }
            }
        }
        let Some(cycle) = &mut self.cycle else { return };
        if exchange.awaited.is_empty() || cycle.repeated || self.mode == ReadMode::Single {
            return;
        }
        // Servos answer in turn, and each waits for the one before: behind one that is not there nobody speaks. If
        // others spoke after the first that is missing, its answer was only damaged.
        cycle.repeated = true;
        let first_missing = exchange.awaited[0];
        let broke_off = exchange.answers.iter().all(|(servo, _)| *servo < first_missing);
        let again: Vec<usize> = exchange.awaited.iter().copied().skip(usize::from(broke_off)).collect();
        if !again.is_empty() {
            self.counters.repeated_requests += 1;
            cycle.groups.push_back(again);
        }
    }

    /// A reading that no hand could have caused is marked, unless the next one says the same.
    fn judge(&mut self, index: usize, now: Duration, counts: u16) -> SensorState {
        let turn = f64::from(COUNTS_PER_TURN);
        let reachable = |from: &(Duration, u16)| {
            let seconds = now.saturating_sub(from.0);
            let apart = (f64::from(counts) - f64::from(from.1)).rem_euclid(turn);
            let allowed = UNLIKELY_MARGIN + FASTEST_TURN / TAU * turn * seconds.as_secs_f64();
            seconds > FORGOTTEN || apart.min(turn - apart) <= allowed
        };
        let servo = &mut self.servos[index];
        let believed = servo.last.as_ref().is_none_or(reachable) || servo.unlikely.as_ref().is_some_and(reachable);
        if believed {
            servo.last = Some((now, counts));
            servo.unlikely = None;
            SensorState::Ok
        } else {
            servo.unlikely = Some((now, counts));
            SensorState::Outlier
        }
    }

    fn finish_cycle(&mut self, now: Duration, events: &mut Vec<Event>) {
        let Some(cycle) = self.cycle.take() else { return };
        if cycle.readings.iter().all(Option::is_none) {
            self.counters.lost_samples += 1;
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
                None => self.strike(&cycle, events),
            }
            return;
        }
        let quickest = Self::quickest(&self.arm);
        if self.mode != quickest && self.granted.is_some() && self.barren == 0 && self.slower_untold() {
            let (quick, instead) = (quickest.words(), self.mode.words());
            events.push(Event::Notice(DeviceNotice::SlowerReads { quick, instead }));
            self.granted = None;
        }
        self.barren = 0;
        self.strike(&cycle, events);
        let counts = |(servo, reading): (usize, &Option<(u16, SensorState)>)| {
            reading.map_or_else(|| self.servos[servo].last.map_or(0, |(_, counts)| counts), |(counts, _)| counts)
        };
        let middle = ((cycle.began + now) / 2).as_micros() as u64;
        self.last_micros = middle.max(self.last_micros + u64::from(self.sequence > 0));
        let sample = Sample {
            device_micros: self.last_micros,
            sequence: self.sequence,
            epoch: self.topology.epoch,
            received: now,
            counts: cycle.readings.iter().enumerate().map(counts).collect(),
            states: cycle.readings.iter().map(|r| r.map_or(SensorState::NoData, |(_, state)| state)).collect(),
        };
        self.sequence = self.sequence.wrapping_add(1);
        self.counters.samples += 1;
        events.push(Event::Sample(sample));
    }

    /// Leaves out those that have been silent too often.
    fn strike(&mut self, cycle: &Cycle, events: &mut Vec<Event>) {
        for (index, reading) in cycle.readings.iter().enumerate() {
            let servo = &mut self.servos[index];
            if !servo.present {
                continue;
            }
            servo.strikes = if reading.is_some() { 0 } else { servo.strikes + 1 };
            if servo.strikes >= self.settings.strikes {
                servo.present = false;
                servo.model = None;
                self.granted = None;
                if !std::mem::replace(&mut servo.missed, true) {
                    let joint = &self.arm.joints[index];
                    let (id, name) = (joint.id, joint.name.clone());
                    events.push(Event::Notice(DeviceNotice::ServoMissing { id, name }));
                }
            }
        }
        debug_assert_eq!(self.phase, Phase::Ready);
    }

    /// Whether the change to slower reads has yet to be told; true once.
    fn slower_untold(&mut self) -> bool {
        !std::mem::replace(&mut self.slower_told, true)
    }
}
