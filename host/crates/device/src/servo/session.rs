//! The conversation with an arm: bytes and the time in, events and bytes out. No I/O, no clock.

use std::collections::VecDeque;
use std::time::Duration;

use super::arm::{ServoArm, is_usable};
use super::bus::{BusDecoder, ReadMode, on_wire};
use super::cycle::Cycle;
use super::exchange::{Echo, Exchange, Purpose, Step, Task};
use super::packet::{PacketCounters, Status};
use crate::{DeviceInfo, DeviceNotice, Event, PartUid, SessionCounters, Topology, TopologyProblem};

/// Whether registers that keep their value without power may be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EepromConsent {
    /// They are left alone.
    #[default]
    Never,
    /// The return delay may be set to 0, once, where it is not.
    ReturnDelayZero,
}

/// The times by which a session with an arm goes, and what it may do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ServoSettings {
    /// How long adapter and system may hold an answer back before the servo counts as silent; FTDI adapters hold it
    /// for 16 ms by default.
    pub patience: Duration,
    /// A servo that missed so many readings in a row is left out until it answers again.
    pub strikes: u32,
    /// A servo that was left out is asked again this often.
    pub probe_every: Duration,
    /// Pause after nothing was found on the bus.
    pub pause: Duration,
    /// Whether the servos' memory may be written.
    pub eeprom: EepromConsent,
    /// Tells two equal arms apart, see [`ServoArm::topology`].
    pub seat: u32,
}

impl Default for ServoSettings {
    fn default() -> Self {
        Self {
            patience: Duration::from_millis(40),
            strikes: 3,
            probe_every: Duration::from_millis(500),
            pause: Duration::from_secs(1),
            eeprom: EepromConsent::Never,
            seat: 0,
        }
    }
}

/// What is known of one servo.
#[derive(Clone, Debug, Default)]
pub(super) struct Servo {
    pub(super) model: Option<u16>,
    /// Whether it is read; one that is missing or of a foreign kind is not.
    pub(super) present: bool,
    pub(super) foreign: bool,
    /// Whether its absence has been told.
    pub(super) missed: bool,
    pub(super) return_delay_units: u8,
    pub(super) strikes: u32,
    pub(super) last: Option<(Duration, u16)>,
    pub(super) unlikely: Option<(Duration, u16)>,
    pub(super) error: u8,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Phase {
    /// Looking for the servos at the n-th of the speeds.
    Looking {
        speed: usize,
    },
    /// Nothing was found; looking again then.
    Pausing {
        until: Duration,
    },
    /// Preparing those that were found.
    Preparing,
    Ready,
}

/// One connection to one arm.
///
/// Times are durations since the session began, as for [`Session`](crate::Session), and the caller moves the bytes in
/// the same way. Two things are different: the line must be put to [`line_baud`](Self::line_baud) before
/// [`take_outgoing`](Self::take_outgoing) is sent, and [`tick`](Self::tick) wants to be called at
/// [`next_due`](Self::next_due), for the bus is silent unless it is asked.
#[derive(Clone, Debug)]
pub struct ServoSession {
    pub(super) arm: ServoArm,
    pub(super) settings: ServoSettings,
    pub(super) decoder: BusDecoder,
    pub(super) counters: SessionCounters,
    pub(super) outgoing: Vec<u8>,
    pub(super) topology: Topology,
    pub(super) info: Option<DeviceInfo>,
    pub(super) speeds: Vec<u32>,
    pub(super) baud: u32,
    pub(super) echo: Echo,
    pub(super) exchange: Option<Exchange>,
    pub(super) phase: Phase,
    pub(super) servos: Vec<Servo>,
    pub(super) tasks: VecDeque<Task>,
    pub(super) mode: ReadMode,
    pub(super) barren: u32,
    pub(super) cycle: Option<Cycle>,
    pub(super) wanted: Option<u32>,
    pub(super) streaming: bool,
    pub(super) granted: Option<u32>,
    pub(super) next_cycle: Duration,
    pub(super) next_probe: Duration,
    pub(super) sequence: u32,
    /// What adapter and system add to an exchange: the least and a slowly forgotten most.
    pub(super) held_back: Option<(Duration, Duration)>,
    pub(super) light_off: Option<(usize, Duration)>,
    pub(super) last_micros: u64,
    pub(super) slower_told: bool,
    silence_told: bool,
}

impl ServoSession {
    /// A session that has not said or heard anything. `baud`: where to look first; without it, the arm's own speed.
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
        let mut session = Self {
            decoder: BusDecoder::new(arm.protocol),
            counters: SessionCounters::default(),
            outgoing: Vec::new(),
            topology,
            info: None,
            baud: first,
            speeds,
            echo: Echo::Unknown,
            exchange: None,
            phase: Phase::Looking { speed: 0 },
            servos: vec![Servo::default(); arm.joints.len()],
            tasks: VecDeque::new(),
            mode: Self::quickest(&arm),
            barren: 0,
            cycle: None,
            wanted: None,
            streaming: false,
            granted: None,
            next_cycle: Duration::ZERO,
            next_probe: Duration::ZERO,
            sequence: 0,
            held_back: None,
            light_off: None,
            last_micros: 0,
            slower_told: false,
            silence_told: false,
            arm,
            settings,
        };
        session.look_from(0);
        Ok(session)
    }

    pub(super) fn quickest(arm: &ServoArm) -> ReadMode {
        match arm.protocol {
            super::ServoProtocol::Feetech => ReadMode::Sync,
            super::ServoProtocol::Dynamixel => ReadMode::Fast,
        }
    }

    /// Wants readings, so many in 1,000 seconds, or as many as the wire allows if that is fewer.
    pub fn start(&mut self, rate_millihertz: u32) {
        self.wanted = Some(rate_millihertz.max(1));
        self.granted = None;
    }

    /// Wants no more readings; [`Event::Stopped`] follows the last one.
    pub fn stop(&mut self) {
        self.wanted = None;
    }

    /// Makes a servo show itself by its light, where it has one.
    pub fn blink(&mut self, now: Duration, uid: PartUid, duration_millis: u16, events: &mut Vec<Event>) {
        let Some(servo) = self.topology.parts.iter().position(|part| part.uid == uid) else { return };
        if self.arm.protocol.registers().light.is_none() {
            let name = self.arm.joints[servo].name.clone();
            events.push(Event::Notice(DeviceNotice::NoLight { name }));
            return;
        }
        let on = duration_millis > 0;
        self.tasks.push_back(Task { servo, step: Step::Light { on }, tried: 0 });
        self.light_off = on.then(|| (servo, now + Duration::from_millis(u64::from(duration_millis))));
        if on {
            events.push(Event::Blinking { uid });
        }
    }

    /// The line was opened anew: everything begins again, at the speed found before.
    pub fn line_opened(&mut self, now: Duration) {
        self.decoder.reset();
        self.outgoing.clear();
        self.exchange = None;
        self.cycle = None;
        self.info = None;
        self.streaming = false;
        self.next_cycle = now;
        let at = self.speeds.iter().position(|&speed| speed == self.baud).unwrap_or(0);
        self.look_from(at);
    }

    /// The speed at which the line has to be, bits a second.
    pub fn line_baud(&self) -> u32 {
        self.baud
    }

    /// Takes bytes that arrived at this time, in whatever portions; appends what they mean to `events`.
    pub fn receive(&mut self, now: Duration, bytes: &[u8], events: &mut Vec<Event>) {
        self.counters.bytes += bytes.len() as u64;
        let before = self.decoder.counters();
        if let Some(exchange) = &mut self.exchange {
            let answer = self.echo.strip(exchange, bytes);
            self.decoder.receive(&answer);
            self.take_statuses();
        } else {
            self.decoder.receive(bytes);
            self.decoder.reset();
        }
        self.tell_noise(before, events);
        self.pursue(now, events);
    }

    /// Lets time pass: gives up what was not answered, and asks for what comes next.
    pub fn tick(&mut self, now: Duration, events: &mut Vec<Event>) {
        if let Some((servo, at)) = self.light_off
            && now >= at
        {
            self.light_off = None;
            self.tasks.push_back(Task { servo, step: Step::Light { on: false }, tried: 0 });
        }
        self.pursue(now, events);
    }

    /// When [`tick`](Self::tick) has something to do; `None` if it only waits for wishes.
    pub fn next_due(&self) -> Option<Duration> {
        if let Some(exchange) = &self.exchange {
            return Some(exchange.deadline);
        }
        match self.phase {
            Phase::Pausing { until } => Some(until),
            Phase::Ready if self.streaming => Some(self.next_cycle),
            _ => self.light_off.map(|(_, at)| at),
        }
    }

    /// The bytes to send to the bus now.
    pub fn take_outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Who the arm is, once its servos are known.
    pub fn device(&self) -> Option<&DeviceInfo> {
        self.info.as_ref()
    }

    /// The arm as a tree of parts.
    pub fn topology(&self) -> &Topology {
        &self.topology
    }

    /// How positions are read at present.
    pub fn read_mode(&self) -> ReadMode {
        self.mode
    }

    /// Whether readings are coming.
    pub fn is_streaming(&self) -> bool {
        self.streaming
    }

    /// What has been counted so far.
    pub fn counters(&self) -> SessionCounters {
        let PacketCounters { packets, checksum_errors, discarded_bytes } = self.decoder.counters();
        SessionCounters { frames: packets, checksum_errors, discarded_bytes, ..self.counters }
    }

    fn tell_noise(&self, before: PacketCounters, events: &mut Vec<Event>) {
        let after = self.decoder.counters();
        let checksum_errors = after.checksum_errors - before.checksum_errors;
        let bytes = after.discarded_bytes - before.discarded_bytes;
        if checksum_errors > 0 && self.streaming {
            events.push(Event::Noise { checksum_errors, framing_errors: 0, bytes });
        }
    }

    fn take_statuses(&mut self) {
        while let Some(status) = self.decoder.next_status() {
            let servo = self.arm.joints.iter().position(|joint| joint.id == status.id);
            self.take_status(servo, status);
        }
    }

    fn take_status(&mut self, servo: Option<usize>, status: Status) {
        let taken = self.exchange.as_mut().is_some_and(|exchange| exchange.take(servo, status));
        self.counters.stale_samples += u64::from(!taken);
    }

    /// Ends the exchange if it is over, and begins the next one if it is time.
    fn pursue(&mut self, now: Duration, events: &mut Vec<Event>) {
        if let Some(exchange) = &self.exchange {
            let answered = exchange.awaited.is_empty();
            if !answered && now < exchange.deadline {
                return;
            }
            if !answered {
                let before = self.decoder.counters();
                while self.decoder.give_up_waiting() {
                    self.take_statuses();
                }
                self.take_statuses();
                self.tell_noise(before, events);
            }
            if let Some(exchange) = self.exchange.take() {
                self.finish(now, exchange, events);
            }
        }
        if self.wanted.is_none() && self.streaming && self.phase != Phase::Ready {
            self.streaming = false;
            events.push(Event::Stopped);
        }
        // Each turn either sends something or is the last.
        for _ in 0..64 {
            if self.exchange.is_some() || !self.proceed(now, events) {
                return;
            }
        }
    }

    fn finish(&mut self, now: Duration, exchange: Exchange, events: &mut Vec<Event>) {
        if exchange.awaited.is_empty() && !exchange.answers.is_empty() {
            self.measure(now, &exchange);
        }
        match exchange.purpose {
            Purpose::Task(task) => {
                let answer = exchange.answers.into_iter().next().map(|(_, status)| status);
                self.finish_task(now, task, answer, events);
            }
            Purpose::Positions => self.finish_positions(now, &exchange, events),
        }
    }

    /// Learns what adapter and system add to the time on the wire.
    fn measure(&mut self, now: Duration, exchange: &Exchange) {
        let delays: u64 = exchange.answers.iter().map(|(servo, _)| self.return_delay_micros(*servo)).sum();
        let expected = exchange.on_wire + Duration::from_micros(delays);
        let added = now.saturating_sub(exchange.sent).saturating_sub(expected);
        self.held_back = Some(match self.held_back {
            None => (added, added),
            Some((least, most)) => (least.min(added), added.max(most.mul_f64(63.0 / 64.0))),
        });
    }

    pub(super) fn return_delay_micros(&self, servo: usize) -> u64 {
        u64::from(self.servos[servo].return_delay_units) * u64::from(super::bus::RETURN_DELAY_UNIT_MICROS)
    }

    /// Sends a request and awaits its answers, data of this length from each of these servos.
    pub(super) fn send(
        &mut self,
        now: Duration,
        purpose: Purpose,
        servos: &[usize],
        data_length: usize,
        request: &[u8],
    ) {
        let mode = if purpose == Purpose::Positions { self.mode } else { ReadMode::Single };
        let bytes = request.len() + self.arm.protocol.answer_length(mode, servos.len(), data_length);
        let wire = on_wire(bytes, self.baud);
        // An unread return delay may be at its longest.
        let unread = |servo: &usize| self.servos[*servo].model.is_none();
        let delays: u64 = servos.iter().map(|s| if unread(s) { 510 } else { self.return_delay_micros(*s) }).sum();
        let patience = match (purpose, self.held_back) {
            (Purpose::Positions, Some((_, most))) => (most * 3 + Duration::from_millis(3)).min(self.settings.patience),
            _ => self.settings.patience,
        };
        let deadline = now + wire + Duration::from_micros(delays) + patience;
        let mut exchange = Exchange::new(purpose, servos, data_length, (now, wire, deadline));
        self.echo.watch(self.arm.protocol, &mut exchange, request);
        self.decoder.reset();
        self.decoder.expect(mode, servos.len(), data_length);
        self.exchange = Some(exchange);
        self.outgoing.extend_from_slice(request);
    }

    /// Does the next thing; whether anything was done.
    fn proceed(&mut self, now: Duration, events: &mut Vec<Event>) -> bool {
        if let Some(task) = self.tasks.pop_front() {
            self.send_task(now, task);
            return true;
        }
        match self.phase {
            Phase::Looking { speed } => {
                self.found_or_next(now, speed, events);
                true
            }
            Phase::Pausing { until } if now >= until => {
                self.look_from(0);
                true
            }
            Phase::Pausing { .. } => false,
            Phase::Preparing => {
                self.introduce(now, events);
                true
            }
            Phase::Ready => self.proceed_stream(now, events),
        }
    }

    pub(super) fn usable(&self, model: u16) -> bool {
        is_usable(self.arm.protocol, model)
    }

    pub(super) fn tell_silence(&mut self, silent: bool) -> bool {
        silent && !std::mem::replace(&mut self.silence_told, silent)
    }

    pub(super) fn forget_silence(&mut self) {
        self.silence_told = false;
    }
}
