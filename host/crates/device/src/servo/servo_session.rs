//! The conversation with an arm: bytes and the time in, events and bytes out. No I/O, no clock.

use std::time::Duration;

use firmware_protocol::{PartUid, features};

use super::bus::{ReadMode, wire_bound_hertz};
use super::line::{Concluded, Line, Purpose, Request};
use super::packet::PacketCounters;
use super::preparation::Preparation;
use super::roster::Roster;
use super::settings::ServoSettings;
use super::stream::{Next, Stream};
use super::task::{Step, Task};
use crate::arm::{ServoArm, ServoProtocol};
use crate::events::{DeviceInfo, DeviceNotice, DeviceProblem, Event, SessionCounters};
use crate::topology::{Topology, TopologyProblem};

/// An adapter that holds every answer for longer than this is reported. USB itself takes about 1 ms.
const SLOW_ADAPTER: Duration = Duration::from_millis(4);
/// A return delay below this costs less than a tenth of the rate.
const WORTHWHILE_DELAY: Duration = Duration::from_micros(20);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    /// Looking for the servos at the n-th speed.
    Looking {
        speed: usize,
    },
    /// Nothing was found; looks again at this time.
    Pausing {
        until: Duration,
    },
    /// Preparing the servos found.
    Preparing,
    Ready,
}

/// One connection to one arm.
///
/// Times are durations since the session began, as for [`Session`](crate::Session), and the caller moves the bytes in
/// the same way. Two things are different: the line must be set to [`line_baud`](Self::line_baud) before
/// [`take_outgoing`](Self::take_outgoing) is sent, and [`tick`](Self::tick) should be called at
/// [`next_due`](Self::next_due), because the bus is silent unless it is asked.
///
/// ```
/// use std::time::Duration;
/// use armature_device::servo::{ServoArm, ServoProtocol, ServoSession, ServoSettings};
///
/// let arm = ServoArm::preset(ServoProtocol::Feetech, Some("so101-leader"))?;
/// let mut session = ServoSession::new(arm, None, ServoSettings::default())?;
/// session.start(100_000);
/// session.tick(Duration::ZERO, &mut Vec::new());
/// assert_eq!(session.line_baud(), 1_000_000);
/// assert!(!session.take_outgoing().is_empty(), "the first servo is asked who it is");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct ServoSession {
    settings: ServoSettings,
    topology: Topology,
    info: Option<DeviceInfo>,
    connections: u64,
    phase: Phase,
    /// Where to look, bits per second; the first is where they were last found.
    speeds: Vec<u32>,
    silence_told: bool,
    light_off: Option<(usize, Duration)>,
    roster: Roster,
    line: Line,
    preparation: Preparation,
    stream: Stream,
}

impl ServoSession {
    /// A session that has not sent or received anything. `baud`: where to look first; without it, the arm's own speed.
    pub fn new(arm: ServoArm, baud: Option<u32>, settings: ServoSettings) -> Result<Self, TopologyProblem> {
        let topology = arm.topology(settings.seat)?;
        let first = baud.unwrap_or(arm.baud).max(1);
        let mut speeds = vec![first];
        let others = std::iter::once(arm.baud).chain(arm.protocol.bauds().iter().copied());
        for speed in others {
            if !speeds.contains(&speed) {
                speeds.push(speed);
            }
        }
        let ids = arm.joints.iter().map(|joint| joint.id).collect();
        let mut session = Self {
            topology,
            info: None,
            connections: 0,
            phase: Phase::Looking { speed: 0 },
            speeds,
            silence_told: false,
            light_off: None,
            line: Line::new(arm.protocol, ids, first, settings.patience),
            preparation: Preparation::new(settings.eeprom),
            stream: Stream::new(arm.protocol, arm.joints.len(), settings),
            roster: Roster::new(arm),
            settings,
        };
        session.look_from(0);
        Ok(session)
    }

    /// Requests readings at this rate, in readings per 1,000 seconds, or as many as the wire allows if that is fewer.
    pub fn start(&mut self, rate_millihertz: u32) {
        self.stream.want(Some(rate_millihertz.max(1)));
    }

    /// Ends the readings; [`Event::Stopped`] follows the last one.
    pub fn stop(&mut self) {
        self.stream.want(None);
    }

    /// Makes a servo blink its light, if it has one.
    pub fn blink(&mut self, now: Duration, uid: PartUid, duration_millis: u16, events: &mut Vec<Event>) {
        let Some(servo) = self.topology.parts.iter().position(|part| part.uid == uid) else { return };
        let arm = self.roster.arm();
        if arm.protocol.registers().light.is_none() {
            let name = arm.joints[servo].name.clone();
            events.push(Event::Notice(DeviceNotice::NoLight { name }));
            return;
        }
        let on = duration_millis > 0;
        self.preparation.add(servo, Step::Light { on });
        self.light_off = on.then(|| (servo, now + Duration::from_millis(u64::from(duration_millis))));
        if on {
            events.push(Event::Blinking { uid });
        }
    }

    /// The line was reopened: everything starts over, at the speed found before.
    pub fn line_opened(&mut self, now: Duration) {
        self.line.reopened();
        self.info = None;
        self.stream.reopened(now);
        let at = self.speeds.iter().position(|&speed| speed == self.line.baud()).unwrap_or(0);
        self.look_from(at);
    }

    /// The speed that the line must have, bits per second.
    pub fn line_baud(&self) -> u32 {
        self.line.baud()
    }

    /// Takes bytes that arrived at this time, in portions of any size; appends what they mean to `events`.
    pub fn receive(&mut self, now: Duration, bytes: &[u8], events: &mut Vec<Event>) {
        let before = self.line.packets();
        self.line.receive(bytes);
        self.report_noise(before, events);
        self.pursue(now, events);
    }

    /// Advances time: gives up on unanswered requests, and sends the next one.
    pub fn tick(&mut self, now: Duration, events: &mut Vec<Event>) {
        if let Some((servo, at)) = self.light_off
            && now >= at
        {
            self.light_off = None;
            self.preparation.add(servo, Step::Light { on: false });
        }
        self.pursue(now, events);
    }

    /// When [`tick`](Self::tick) has something to do; `None` if it only waits for the caller.
    pub fn next_due(&self) -> Option<Duration> {
        self.line.deadline().or(match self.phase {
            Phase::Pausing { until } => Some(until),
            Phase::Ready if self.stream.is_on() => Some(self.stream.next_cycle()),
            _ => self.light_off.map(|(_, at)| at),
        })
    }

    /// The bytes to send to the bus now.
    pub fn take_outgoing(&mut self) -> Vec<u8> {
        self.line.take_outgoing()
    }

    /// Who the arm is, once its servos are known.
    pub fn device(&self) -> Option<&DeviceInfo> {
        self.info.as_ref()
    }

    /// The arm as a tree of parts.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// The current read mode.
    pub fn read_mode(&self) -> ReadMode {
        self.stream.mode()
    }

    /// Whether readings are coming.
    pub fn is_streaming(&self) -> bool {
        self.stream.is_on()
    }

    /// The counters so far.
    pub fn counters(&self) -> SessionCounters {
        let PacketCounters { packets, checksum_errors, discarded_bytes } = self.line.packets();
        let (samples, lost_samples, repeated) = self.stream.counts();
        SessionCounters {
            bytes: self.line.bytes(),
            frames: packets,
            samples,
            lost_samples,
            stale_samples: self.line.unexpected(),
            checksum_errors,
            discarded_bytes,
            repeated_requests: repeated + self.preparation.repeated(),
            connections: self.connections,
            ..SessionCounters::default()
        }
    }

    fn report_noise(&self, before: PacketCounters, events: &mut Vec<Event>) {
        let after = self.line.packets();
        let checksum_errors = after.checksum_errors - before.checksum_errors;
        let bytes = after.discarded_bytes - before.discarded_bytes;
        if checksum_errors > 0 && self.stream.is_on() {
            events.push(Event::Noise { checksum_errors, framing_errors: 0, bytes });
        }
    }

    /// Ends the exchange if it is over, and starts the next one if it is due.
    fn pursue(&mut self, now: Duration, events: &mut Vec<Event>) {
        let before = self.line.packets();
        if let Some(concluded) = self.line.conclude(now, |servo| self.roster.return_delay(servo)) {
            self.report_noise(before, events);
            self.finish(now, concluded, events);
        }
        if self.line.is_busy() {
            return;
        }
        if self.phase != Phase::Ready {
            self.stream.end_if_unwanted(events);
        }
        // Each iteration either sends something or is the last.
        for _ in 0..64 {
            if self.line.is_busy() || !self.proceed(now, events) {
                return;
            }
        }
    }

    fn finish(&mut self, now: Duration, concluded: Concluded, events: &mut Vec<Event>) {
        let Concluded { purpose, answers, silent } = concluded;
        match purpose {
            Purpose::Positions(_) => self.stream.take_positions(now, &answers, &silent, &mut self.roster, events),
            Purpose::Task { task, .. } => {
                let answer = answers.into_iter().next().map(|(_, status)| status);
                let looking_at = if let Phase::Looking { speed } = self.phase { Some(speed) } else { None };
                let prepared = self.preparation.finish(task, answer, looking_at, &mut self.roster, events);
                // A servo that was missing is read again once all its preparation is done.
                if prepared && self.phase == Phase::Ready && self.roster.welcome(task.servo(), events) {
                    self.stream.welcome(task.servo());
                }
            }
        }
    }

    /// Does the next thing; returns whether anything was done.
    fn proceed(&mut self, now: Duration, events: &mut Vec<Event>) -> bool {
        if let Some(task) = self.preparation.next() {
            self.send_task(now, task);
            return true;
        }
        match self.phase {
            Phase::Looking { speed } => self.found_or_next(now, speed, events),
            Phase::Pausing { until } if now >= until => self.look_from(0),
            Phase::Pausing { .. } => return false,
            Phase::Preparing => self.introduce(now, events),
            Phase::Ready => {
                let (baud, epoch) = (self.line.baud(), self.topology.epoch);
                match self.stream.proceed(now, baud, epoch, &mut self.roster, events) {
                    Next::Ask(servos) => self.ask_positions(now, servos),
                    Next::Probe(servo) => self.preparation.add(servo, Step::ReadModel),
                    Next::Search => self.look_from(0),
                    Next::Proceed => {}
                    Next::Wait => return false,
                }
            }
        }
        true
    }

    fn send_task(&mut self, now: Duration, task: Task) {
        let Some((bytes, data_length)) = self.preparation.request(task, &self.roster) else { return };
        let purpose = Purpose::Task { task, is_telling: task.step() == Step::ReadModel };
        self.send(now, purpose, bytes, vec![task.servo()], data_length);
    }

    fn ask_positions(&mut self, now: Duration, servos: Vec<usize>) {
        let (protocol, mode) = (self.roster.protocol(), self.stream.mode());
        let ids: Vec<u8> = servos.iter().map(|&servo| self.roster.id(servo)).collect();
        let data_length = usize::from(protocol.registers().position_length);
        self.send(now, Purpose::Positions(mode), protocol.read_positions(mode, &ids), servos, data_length);
    }

    fn send(&mut self, now: Duration, purpose: Purpose, bytes: Vec<u8>, servos: Vec<usize>, data_length: usize) {
        let return_delays = servos.iter().map(|&servo| self.roster.longest_return_delay(servo)).sum();
        self.line.send(now, Request { purpose, bytes, servos, data_length, return_delays });
    }

    /// Starts looking for the servos at this speed of the list.
    fn look_from(&mut self, speed: usize) {
        let speed = if speed < self.speeds.len() { speed } else { 0 };
        self.phase = Phase::Looking { speed };
        self.line.set_baud(self.speeds[speed]);
        self.stream.begin_search();
        self.roster.forget();
        self.preparation.look_for_all(self.roster.len());
    }

    /// All questions at one speed are answered or given up.
    fn found_or_next(&mut self, now: Duration, speed: usize, events: &mut Vec<Event>) {
        if self.roster.any_usable() {
            if speed > 0 && self.info.is_none() {
                let notice = DeviceNotice::FoundAtBaud { asked: self.speeds[0], found: self.line.baud() };
                events.push(Event::Notice(notice));
            }
            // Next time, this speed is tried first.
            self.speeds.swap(0, speed);
            self.phase = Phase::Preparing;
            return;
        }
        let foreign = self.roster.first_model();
        if foreign.is_none() && speed + 1 < self.speeds.len() {
            return self.look_from(speed + 1);
        }
        self.phase = Phase::Pausing { until: now + self.settings.pause };
        if !std::mem::replace(&mut self.silence_told, true) {
            let bauds: Vec<String> = self.speeds.iter().map(ToString::to_string).collect();
            let (arm, bauds) = (self.roster.arm().title.clone(), bauds.join(", "));
            events.push(Event::Problem(match foreign {
                Some(model) => DeviceProblem::ForeignServos { arm, model },
                None => DeviceProblem::NoServos { arm, bauds },
            }));
        }
    }

    /// Everything is known: reports who the arm is, and what could be better.
    fn introduce(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.phase = Phase::Ready;
        self.silence_told = false;
        self.stream.begin(now);
        self.roster.settle(events);
        if self.info.is_some() {
            return;
        }
        self.connections += 1;
        let arm = self.roster.arm();
        let info = DeviceInfo {
            name: format!("{} ({} {} servos)", arm.title, self.roster.present().len(), arm.protocol),
            uid: arm.part_uid(self.settings.seat, 0),
            protocol: match arm.protocol {
                ServoProtocol::Feetech => [1, 0],
                ServoProtocol::Dynamixel => [2, 0],
            },
            firmware: [0; 3],
            features: if arm.protocol.registers().light.is_some() { features::BLINK } else { 0 },
            max_rate_millihertz: (self.bound_hertz() * 1000.0) as u32,
        };
        self.info = Some(info.clone());
        events.push(Event::Connected(info));
        events.push(Event::Topology(self.topology.clone()));
        self.diagnose(events);
    }

    fn bound_hertz(&self) -> f64 {
        self.roster.bound_hertz(self.stream.mode(), self.line.baud())
    }

    /// Reports what lowers the rate.
    fn diagnose(&self, events: &mut Vec<Event>) {
        let delays = (0..self.roster.len()).map(|servo| self.roster.return_delay(servo));
        let longest = delays.max().unwrap_or_default();
        if longest > WORTHWHILE_DELAY {
            let undelayed = vec![0; self.roster.present().len()];
            let protocol = self.roster.protocol();
            let hertz_without = wire_bound_hertz(protocol, self.stream.mode(), self.line.baud(), &undelayed);
            let (micros, hertz_now) = (longest.as_micros() as u32, self.bound_hertz());
            events.push(Event::Notice(DeviceNotice::ReturnDelay { micros, hertz_now, hertz_without }));
        }
        if let Some(least) = self.line.least_held_back().filter(|least| *least >= SLOW_ADAPTER) {
            let cycle = 1.0 / self.bound_hertz().max(1e-3) + least.as_secs_f64();
            let (millis, hertz) = (least.as_secs_f64() * 1e3, 1.0 / cycle);
            events.push(Event::Notice(DeviceNotice::AdapterLatency { millis, hertz }));
        }
    }
}
