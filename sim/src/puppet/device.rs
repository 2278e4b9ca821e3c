//! The device: requests in, answers and samples out, on a clock that the caller advances.

use firmware_protocol::{
    Acknowledge, Decoder, Hello, HostMessage, MAX_RECORDS, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParseError, PartRecord,
    PartUid, Pong, RateSet, RefusalReason, Refuse, SampleMessage, SensorState, TopologyChanged, TopologyMessage,
    features, frame_length, message_type, sample_payload_length, topology_messages,
};

use super::line::Line;
use super::sensors::Sensors;
use super::settings::{PuppetSettings, SettingsError};
use super::timeline::{Event, Timeline};
use crate::body::Body;
use crate::faults::{ClockFaultKind, Truth};
use crate::random::Random;

const FIRMWARE: [u8; 3] = [0, 1, 0];
const NAME: &str = "Simulated puppet";
/// The sample rate until a host sets one.
const FIRST_RATE_MILLIHERTZ: u32 = 120_000;
/// Most samples made in one step; older ones are skipped, as by a device that cannot keep up.
const MAX_SAMPLES_PER_STEP: u64 = 100_000;
/// Noise bytes per second on a line without a speed of its own.
const NOISE_BYTES_PER_SECOND: u32 = 100_000;
/// Most noise made in one step, bytes.
const MAX_NOISE_PER_STEP: u64 = 1 << 20;
/// The share of the line that samples may use; the rest is for answers.
const LINE_SHARE: f64 = 0.95;
const NANOS: f64 = 1e9;

/// A running stream.
#[derive(Clone, Copy, Debug)]
struct Stream {
    /// Device time of tick 0 at the current rate.
    base_device_micros: u64,
    ticks: u64,
    sequence: u32,
}

/// An emulated puppet.
///
/// It has no clock: the caller passes the time to [`step`](Self::step). The same settings and the same calls give the
/// same bytes, everywhere.
#[derive(Clone, Debug)]
pub struct Puppet {
    settings: PuppetSettings,
    sensors: Sensors,
    line: Line,
    timeline: Timeline,
    decoder: Decoder,
    truth: Truth,
    /// Time of the first step, of the latest, and of the latest power-up.
    origin_micros: Option<u64>,
    now_micros: u64,
    boot_micros: u64,
    rate_millihertz: u32,
    stream: Option<Stream>,
    /// When the motion begins; `None` while the puppet is held at rest.
    motion_micros: Option<u64>,
    epoch: u16,
    pulled: Vec<u32>,
    records: Vec<PartRecord>,
    /// For every sensor of a sample, its number in the whole puppet.
    layout: Vec<usize>,
    noise_since: u64,
    noise_sent: u64,
    blinking: Option<(PartUid, u64)>,
    counts: Vec<u16>,
    states: Vec<SensorState>,
}

impl Puppet {
    /// A puppet that is switched on by its first [`step`](Self::step).
    pub fn new(settings: PuppetSettings) -> Result<Self, SettingsError> {
        settings.check()?;
        let mut puppet = Self {
            sensors: Sensors::new(&settings),
            line: Line::new(&settings.faults, Random::new(settings.seed, 2)),
            timeline: Timeline::new(&settings.faults),
            decoder: Decoder::new(),
            truth: Truth::default(),
            origin_micros: None,
            now_micros: 0,
            boot_micros: 0,
            rate_millihertz: 0,
            stream: None,
            motion_micros: None,
            epoch: 0,
            pulled: vec![0; settings.body.parts().len()],
            records: Vec::new(),
            layout: Vec::new(),
            noise_since: 0,
            noise_sent: 0,
            blinking: None,
            counts: Vec::new(),
            states: Vec::new(),
            settings,
        };
        puppet.lay_out();
        puppet.rate_millihertz = FIRST_RATE_MILLIHERTZ.min(puppet.max_rate_millihertz());
        Ok(puppet)
    }

    /// Advances the clock to `now_micros`, reads what the host has sent since the previous step, and appends everything
    /// the device has to say to `bytes_out`: the samples due up to now, in order, then answers, then samples due after
    /// them. The first step switches the device on. A time before the latest step counts as that step's time.
    pub fn step(&mut self, now_micros: u64, bytes_in: &[u8], bytes_out: &mut Vec<u8>) {
        if self.origin_micros.is_none() {
            self.origin_micros = Some(now_micros);
            self.now_micros = now_micros;
            self.power_up(now_micros, bytes_out);
        }
        self.now_micros = self.now_micros.max(now_micros);
        self.run_until(self.now_micros, bytes_out);
        self.hear(bytes_in, bytes_out);
        self.run_until(self.now_micros, bytes_out);
    }

    /// The next time at which the device sends something unprompted; `None` if it only waits for the host.
    pub fn next_due_micros(&self) -> Option<u64> {
        let noise = self.line.is_noisy().then(|| self.now_micros.saturating_add(1_000));
        let event = self.timeline.next_micros().zip(self.origin_micros).map(|(at, origin)| at.saturating_add(origin));
        [self.next_sample().map(|(at, _)| at), event, noise].into_iter().flatten().min()
    }

    /// All the parts, plugged in or not.
    pub fn body(&self) -> &Body {
        &self.settings.body
    }

    /// What really happened, to compare with what a host believes.
    pub fn truth(&self) -> Truth {
        let mut truth = self.truth;
        self.sensors.add_to(&mut truth);
        truth
    }

    /// Whether samples are being sent.
    pub fn is_streaming(&self) -> bool {
        self.stream.is_some()
    }

    /// The part that is showing itself, if any.
    pub fn blinking_part(&self) -> Option<PartUid> {
        self.blinking.filter(|(_, until)| self.now_micros < *until).map(|(uid, _)| uid)
    }

    /// The true angle of every sensor of the whole puppet at a time, radians, away from rest.
    pub fn true_angles(&self, at_micros: u64) -> Vec<f64> {
        let mut angles = Vec::new();
        self.sensors.true_angles(&self.settings.body, self.motion_seconds(at_micros as f64), &mut angles);
        angles
    }

    /// How long after the rest pose a track shows its first frame, seconds; see [`PuppetSettings::leads`].
    pub fn lead_in_seconds(&self) -> f64 {
        self.sensors.lead_in_seconds()
    }

    /// Leaves the rest pose now, however long it was to be held.
    pub fn begin_motion(&mut self) {
        self.motion_micros = Some(self.now_micros);
    }

    /// Returns to the rest pose and stays there until [`begin_motion`](Self::begin_motion) or a new start.
    pub fn hold_rest(&mut self) {
        self.motion_micros = None;
    }

    /// The fastest rate it grants, limited by sensors and line.
    pub fn max_rate_millihertz(&self) -> u32 {
        let frame_bits = 10.0 * frame_length(sample_payload_length(self.settings.body.sensor_count())) as f64;
        let line = self.settings.line_baud.map_or(f64::INFINITY, |b| LINE_SHARE * f64::from(b) * 1000.0 / frame_bits);
        (f64::from(self.settings.max_rate_millihertz).min(line) as u32).max(1)
    }

    fn power_up(&mut self, at_micros: u64, out: &mut Vec<u8>) {
        self.boot_micros = at_micros;
        self.stream = None;
        self.motion_micros = None;
        self.blinking = None;
        self.epoch = 0;
        self.rate_millihertz = FIRST_RATE_MILLIHERTZ.min(self.max_rate_millihertz());
        self.decoder.reset();
        self.line.delimiter(out);
        self.say_hello(out);
    }

    /// Plays everything that happens unprompted up to a time, in order.
    fn run_until(&mut self, until: u64, out: &mut Vec<u8>) {
        self.skip_what_is_too_much(until);
        loop {
            let origin = self.origin_micros.unwrap_or(until);
            let event = self.timeline.next_micros().map(|at| at.saturating_add(origin)).filter(|at| *at <= until);
            let sample = self.next_sample().filter(|(at, _)| *at <= until);
            match (event, sample) {
                (Some(at), sample) if sample.is_none_or(|(due, _)| at <= due) => {
                    self.make_noise(at, out);
                    if let Some(event) = self.timeline.take() {
                        self.happen(event, at, out);
                    }
                }
                (_, Some((at, device_micros))) => {
                    self.make_noise(at, out);
                    self.sample(device_micros, out);
                }
                (_, None) => break,
            }
        }
        self.make_noise(until, out);
    }

    fn happen(&mut self, event: Event, at_micros: u64, out: &mut Vec<u8>) {
        match event {
            Event::NoiseBegins => {
                self.line.set_noisy(true);
                self.noise_since = at_micros;
                self.noise_sent = 0;
            }
            Event::NoiseEnds => self.line.set_noisy(false),
            Event::Unplug(part) | Event::PlugIn(part) => {
                if let Some(pulled) = self.pulled.get_mut(part) {
                    let out_now = matches!(event, Event::Unplug(_));
                    *pulled = if out_now { pulled.saturating_add(1) } else { pulled.saturating_sub(1) };
                }
                if self.lay_out() {
                    self.truth.topology_changes += 1;
                    self.epoch = self.epoch.wrapping_add(1);
                    let message = TopologyChanged { epoch: self.epoch };
                    self.line.send(&message, &mut self.truth, out);
                }
            }
            Event::Restart => {
                self.truth.restarts += 1;
                self.power_up(at_micros, out);
            }
        }
    }

    /// Finds out what is plugged in; returns whether that changed.
    fn lay_out(&mut self) -> bool {
        let body = &self.settings.body;
        let mut index_of = vec![None; body.parts().len()];
        let mut records: Vec<PartRecord> = Vec::new();
        self.layout.clear();
        for (index, part) in body.parts().iter().enumerate() {
            let parent = part.parent.map(|p| index_of[p]);
            if self.pulled[index] > 0 || parent == Some(None) {
                continue;
            }
            index_of[index] = u16::try_from(records.len()).ok();
            let sensors = body.sensors(index);
            records.push(PartRecord {
                kind: part.kind,
                sensor_count: sensors.len() as u8,
                outlet: part.outlet,
                outlet_count: part.outlets,
                parent: parent.flatten(),
                uid: part.uid,
                counts_per_turn: if sensors.is_empty() { 0 } else { self.settings.counts_per_turn },
            });
            self.layout.extend(sensors);
        }
        let changed = records != self.records;
        self.records = records;
        changed
    }

    fn hear(&mut self, mut bytes: &[u8], out: &mut Vec<u8>) {
        // Frames borrow the decoder, so their contents are copied out right away.
        while let Some(heard) = self.decoder.next_frame(&mut bytes).map(|f| (f.message_type, HostMessage::parse(f))) {
            match heard {
                (_, Ok(request)) => {
                    self.truth.requests += 1;
                    self.answer(request, out);
                }
                // A message that only devices send is an echo; answering it could go on forever.
                (message_type, Err(_)) if message_type >= 0x80 => {}
                (message_type, Err(ParseError::UnknownType(_))) => {
                    self.refuse(message_type, RefusalReason::UnknownRequest, out);
                }
                (message_type, Err(_)) => self.refuse(message_type, RefusalReason::Malformed, out),
            }
        }
    }

    fn answer(&mut self, request: HostMessage, out: &mut Vec<u8>) {
        match request {
            HostMessage::HelloRequest { .. } => {
                self.stream = None;
                self.say_hello(out);
            }
            HostMessage::TopologyRequest => {
                let (epoch, records) = (self.epoch, self.settings.topology_records.clamp(1, MAX_RECORDS));
                let part_count = self.records.len() as u16;
                let at_once = topology_messages(epoch, &self.records).map(|message| message.records);
                let pieces = at_once.flat_map(|part| part.chunks(records).chain(part.is_empty().then_some(part)));
                let mut first_index = 0;
                for records in pieces {
                    let message = TopologyMessage { epoch, part_count, first_index, records };
                    self.line.send(&message, &mut self.truth, out);
                    first_index += records.len() as u16;
                }
            }
            HostMessage::SetRate { rate_millihertz } => {
                self.set_rate(rate_millihertz);
                self.line.send(&RateSet { rate_millihertz: self.rate_millihertz }, &mut self.truth, out);
            }
            HostMessage::Start => {
                if self.stream.is_none() {
                    let base_device_micros = self.device_micros(self.now_micros);
                    self.stream = Some(Stream { base_device_micros, ticks: 0, sequence: 0 });
                    let rest = self.settings.rest_micros;
                    self.motion_micros = (rest < u64::MAX).then(|| self.now_micros.saturating_add(rest));
                }
                self.acknowledge(message_type::START, out);
            }
            HostMessage::Stop => {
                self.stream = None;
                self.acknowledge(message_type::STOP, out);
            }
            HostMessage::Ping { token } => {
                let now = self.shown_micros(self.device_micros(self.now_micros));
                self.line.send(&Pong { token, received_micros: now, sent_micros: now }, &mut self.truth, out);
            }
            // Its parts have no memory.
            HostMessage::Label { .. } => self.refuse(message_type::LABEL, RefusalReason::UnknownRequest, out),
            HostMessage::Blink { uid, duration_millis } => {
                if self.records.iter().any(|record| record.uid == uid) {
                    let until = self.now_micros.saturating_add(u64::from(duration_millis) * 1000);
                    self.blinking = Some((uid, until));
                    self.acknowledge(message_type::BLINK, out);
                } else {
                    self.refuse(message_type::BLINK, RefusalReason::NoSuchPart, out);
                }
            }
        }
    }

    fn set_rate(&mut self, wanted: u32) {
        let granted = wanted.clamp(1, self.max_rate_millihertz());
        if let Some(stream) = &mut self.stream
            && granted != self.rate_millihertz
        {
            // The next sample comes one new interval after the latest.
            if let Some(latest) = stream.ticks.checked_sub(1) {
                stream.base_device_micros = tick_micros(stream.base_device_micros, latest, self.rate_millihertz);
                stream.ticks = 1;
            }
        }
        self.rate_millihertz = granted;
    }

    fn say_hello(&mut self, out: &mut Vec<u8>) {
        let hello = Hello {
            protocol_major: PROTOCOL_MAJOR,
            protocol_minor: PROTOCOL_MINOR,
            features: features::BLINK | features::HOT_PLUG,
            firmware: FIRMWARE,
            uid: self.settings.body.parts().first().map(|part| part.uid).unwrap_or_default(),
            max_rate_millihertz: self.max_rate_millihertz(),
            name: NAME,
        };
        self.line.send(&hello, &mut self.truth, out);
    }

    fn acknowledge(&mut self, request: u8, out: &mut Vec<u8>) {
        self.line.send(&Acknowledge { request }, &mut self.truth, out);
    }

    fn refuse(&mut self, request: u8, reason: RefusalReason, out: &mut Vec<u8>) {
        self.truth.requests_refused += 1;
        self.line.send(&Refuse { request, reason }, &mut self.truth, out);
    }

    /// Device nanoseconds in a second of true time.
    fn device_nanos_per_second(&self) -> u128 {
        (NANOS + self.settings.faults.clock_drift_ppm * 1000.0) as u128
    }

    fn device_micros(&self, at_micros: u64) -> u64 {
        let running = u128::from(at_micros.saturating_sub(self.boot_micros));
        (running * self.device_nanos_per_second() / NANOS as u128) as u64
    }

    /// What the device's clock says when it should show this.
    fn shown_micros(&self, device_micros: u64) -> u64 {
        let since_origin = self.true_micros(device_micros) - self.origin_micros.unwrap_or(0) as f64;
        let mut shown = device_micros;
        for fault in &self.settings.faults.clock {
            let since = since_origin - fault.at_micros as f64;
            let over = fault.for_micros.is_some_and(|micros| since >= micros as f64);
            if since < 0.0 || over {
                continue;
            }
            shown = match fault.kind {
                ClockFaultKind::Steps(by_micros) => shown.saturating_add_signed(by_micros),
                ClockFaultKind::Stands => shown.saturating_sub(since as u64),
            };
        }
        shown
    }

    /// True time, with fractions of a microsecond, at which the device's clock shows a value.
    fn true_micros(&self, device_micros: u64) -> f64 {
        self.boot_micros as f64 + device_micros as f64 * (NANOS / self.device_nanos_per_second() as f64)
    }

    /// True and device time of the next sample.
    fn next_sample(&self) -> Option<(u64, u64)> {
        let stream = self.stream?;
        let device = tick_micros(stream.base_device_micros, stream.ticks, self.rate_millihertz);
        let running = (u128::from(device) * NANOS as u128).div_ceil(self.device_nanos_per_second());
        Some((self.boot_micros.saturating_add(u64::try_from(running).unwrap_or(u64::MAX)), device))
    }

    fn skip_what_is_too_much(&mut self, until: u64) {
        let device_now = self.device_micros(until);
        let Some(stream) = &mut self.stream else { return };
        let elapsed = u128::from(device_now.saturating_sub(stream.base_device_micros));
        let ticks_by_now = (elapsed * u128::from(self.rate_millihertz) / 1_000_000_000) as u64;
        let skipped = ticks_by_now.saturating_sub(stream.ticks).saturating_sub(MAX_SAMPLES_PER_STEP);
        stream.ticks += skipped;
        stream.sequence = stream.sequence.wrapping_add(skipped as u32);
        self.truth.samples_taken += skipped;
        self.truth.samples_skipped += skipped;
    }

    fn motion_seconds(&self, true_micros: f64) -> Option<f64> {
        self.motion_micros.map(|begin| (true_micros - begin as f64) * 1e-6).filter(|seconds| *seconds >= 0.0)
    }

    fn sample(&mut self, device_micros: u64, out: &mut Vec<u8>) {
        let true_micros = self.true_micros(device_micros);
        let since_origin = true_micros - self.origin_micros.unwrap_or(0) as f64;
        let seconds = self.motion_seconds(true_micros);
        self.sensors.read(&self.settings, &self.layout, seconds, since_origin, &mut self.counts, &mut self.states);
        let Some(stream) = &mut self.stream else { return };
        let sequence = stream.sequence;
        stream.sequence = sequence.wrapping_add(1);
        stream.ticks += 1;
        self.truth.samples_taken += 1;
        let (epoch, counts, states) = (self.epoch, self.counts.as_slice(), self.states.as_slice());
        let device_micros = self.shown_micros(device_micros);
        let message = SampleMessage { device_micros, sequence, epoch, counts, states };
        self.line.send(&message, &mut self.truth, out);
    }

    fn make_noise(&mut self, until: u64, out: &mut Vec<u8>) {
        if !self.line.is_noisy() {
            return;
        }
        let per_second = self.settings.line_baud.map_or(NOISE_BYTES_PER_SECOND, |baud| (baud / 10).max(1));
        let elapsed = u128::from(until.saturating_sub(self.noise_since));
        let total = (elapsed * u128::from(per_second) / 1_000_000) as u64;
        let due = total.saturating_sub(self.noise_sent);
        self.noise_sent = total;
        self.line.noise(due.min(MAX_NOISE_PER_STEP), &mut self.truth, out);
    }
}

/// Device time of a tick: exact, without summing rounded intervals.
fn tick_micros(base: u64, tick: u64, rate_millihertz: u32) -> u64 {
    let after = u128::from(tick) * 1_000_000_000 / u128::from(rate_millihertz.max(1));
    base.saturating_add(u64::try_from(after).unwrap_or(u64::MAX))
}
