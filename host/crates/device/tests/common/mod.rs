//! A device on virtual time, and a line between it and a session.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::time::Duration;

use armature_device::{Event, Part, PartKind, PartUid, RefusalReason, SensorState, Session, SessionSettings, features};
use firmware_protocol::{
    Acknowledge, Decoder, Encode, FrameBuffer, Hello, HostMessage, Pong, RateSet, Refuse, SampleMessage,
    TopologyChanged, message_type, topology_messages,
};

pub(crate) const UID: PartUid = PartUid([0x55; 12]);

pub(crate) fn part(kind: PartKind, parent: Option<u16>, outlet: u8, number: u8) -> Part {
    let (outlet_count, counts_per_turn) = if kind == PartKind::Splitter { (5, 0) } else { (1, 16_384) };
    let sensor_count = kind.sensor_count().unwrap_or(0);
    Part { kind, sensor_count, outlet, outlet_count, parent, uid: PartUid([number; 12]), counts_per_turn }
}

/// A splitter and this many three-axis joints: five on the splitter, the others in a chain on the last one.
pub(crate) fn puppet(joints: u8) -> Vec<Part> {
    let joint = |number: u8| {
        let (parent, outlet) = if number < 5 { (0, number) } else { (u16::from(number), 0) };
        part(PartKind::TwistBendTwist, Some(parent), outlet, number + 1)
    };
    std::iter::once(part(PartKind::Splitter, None, 0, 0)).chain((0..joints).map(joint)).collect()
}

/// A device that follows the protocol, except where a test makes it deviate.
pub(crate) struct FakeDevice {
    decoder: Decoder<64>,
    out: Vec<u8>,
    pub(crate) uid: PartUid,
    pub(crate) major: u8,
    pub(crate) name: &'static str,
    pub(crate) parts: Vec<Part>,
    pub(crate) epoch: u16,
    pub(crate) booted: Duration,
    pub(crate) rate_millihertz: u32,
    pub(crate) max_rate_millihertz: u32,
    pub(crate) streaming: bool,
    pub(crate) sequence: u32,
    next_sample: Duration,
    /// Message types it does not answer.
    pub(crate) deaf_to: Vec<u8>,
    pub(crate) refuses: Vec<(u8, RefusalReason)>,
    pub(crate) heard: Vec<HostMessage>,
    /// The epoch that its samples claim, where that is another one than its tree's.
    pub(crate) claimed_epoch: Option<u16>,
    /// What its clock shows for a sample of this number at this true time, microseconds.
    pub(crate) clock: fn(u32, u64) -> u64,
    /// Sensors that its samples have beyond those of its tree, in every n-th of them.
    pub(crate) extra_sensor_every: Option<u32>,
    /// Every sequence number it has taken a sample for since the last start.
    pub(crate) taken: u32,
}

impl FakeDevice {
    pub(crate) fn new(parts: Vec<Part>) -> Self {
        Self {
            decoder: Decoder::with_capacity(),
            out: Vec::new(),
            uid: UID,
            major: 1,
            name: "fake",
            parts,
            epoch: 1,
            booted: Duration::ZERO,
            rate_millihertz: 100_000,
            max_rate_millihertz: 1_000_000,
            streaming: false,
            sequence: 0,
            next_sample: Duration::ZERO,
            deaf_to: Vec::new(),
            refuses: Vec::new(),
            heard: Vec::new(),
            claimed_epoch: None,
            clock: |_, micros| micros,
            extra_sensor_every: None,
            taken: 0,
        }
    }

    pub(crate) fn say(&mut self, message: &impl Encode) {
        self.out.extend_from_slice(FrameBuffer::new().encode(message).expect("fits a frame"));
    }

    pub(crate) fn say_bytes(&mut self, bytes: &[u8]) {
        self.out.extend_from_slice(bytes);
    }

    pub(crate) fn take_outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.out)
    }

    pub(crate) fn hello(&mut self) {
        let (protocol_major, max_rate_millihertz, uid, name) =
            (self.major, self.max_rate_millihertz, self.uid, self.name);
        self.say(&Hello {
            protocol_major,
            protocol_minor: 0,
            features: features::BLINK,
            firmware: [1, 2, 3],
            uid,
            max_rate_millihertz,
            name,
        });
    }

    /// Power off and on: the clock and the numbers start over.
    pub(crate) fn restart(&mut self, now: Duration) {
        self.booted = now;
        self.streaming = false;
        self.sequence = 0;
        self.decoder.reset();
        self.hello();
    }

    /// Plugs parts in or out.
    pub(crate) fn change_tree(&mut self, parts: Vec<Part>) {
        self.parts = parts;
        self.epoch = self.epoch.wrapping_add(1);
        let epoch = self.epoch;
        self.say(&TopologyChanged { epoch });
    }

    pub(crate) fn hear(&mut self, now: Duration, mut bytes: &[u8]) {
        let mut decoder = self.decoder.clone();
        while let Some(frame) = decoder.next_frame(&mut bytes) {
            if self.deaf_to.contains(&frame.message_type) {
                continue;
            }
            if let Some(&(request, reason)) = self.refuses.iter().find(|(refused, _)| *refused == frame.message_type) {
                self.say(&Refuse { request, reason });
                continue;
            }
            let message = HostMessage::parse(frame).expect("the host speaks this version");
            self.heard.push(message);
            self.answer(now, message);
        }
        self.decoder = decoder;
    }

    fn answer(&mut self, now: Duration, message: HostMessage) {
        match message {
            HostMessage::HelloRequest { .. } => {
                self.streaming = false;
                self.hello();
            }
            HostMessage::TopologyRequest => {
                let parts = self.parts.clone();
                topology_messages(self.epoch, &parts).for_each(|message| self.say(&message));
            }
            HostMessage::SetRate { rate_millihertz } => {
                self.rate_millihertz = rate_millihertz.min(self.max_rate_millihertz);
                let rate_millihertz = self.rate_millihertz;
                self.say(&RateSet { rate_millihertz });
            }
            HostMessage::Start => {
                if !self.streaming {
                    (self.streaming, self.sequence, self.next_sample) = (true, 0, now);
                }
                self.say(&Acknowledge { request: message_type::START });
            }
            HostMessage::Stop => {
                self.streaming = false;
                self.say(&Acknowledge { request: message_type::STOP });
            }
            HostMessage::Ping { token } => {
                let micros = now.saturating_sub(self.booted).as_micros() as u64;
                self.say(&Pong { token, received_micros: micros, sent_micros: micros });
            }
            HostMessage::Label { .. } => {
                self.say(&Refuse { request: message_type::LABEL, reason: RefusalReason::UnknownRequest });
            }
            HostMessage::Blink { uid, .. } => {
                if self.parts.iter().any(|part| part.uid == uid) {
                    self.say(&Acknowledge { request: message_type::BLINK });
                } else {
                    self.say(&Refuse { request: message_type::BLINK, reason: RefusalReason::NoSuchPart });
                }
            }
        }
    }

    /// Takes the samples that are due.
    pub(crate) fn step(&mut self, now: Duration) {
        while self.streaming && self.next_sample <= now {
            let sequence = self.sequence;
            let extra = self.extra_sensor_every.is_some_and(|every| sequence % every == every - 1);
            let sensors =
                self.parts.iter().map(|part| usize::from(part.sensor_count)).sum::<usize>() + usize::from(extra);
            let counts: Vec<u16> = (0..sensors).map(|sensor| expected_count(sequence, sensor)).collect();
            let clock = self.next_sample.saturating_sub(self.booted).as_micros() as u64;
            let message = SampleMessage {
                device_micros: (self.clock)(sequence, clock),
                sequence,
                epoch: self.claimed_epoch.unwrap_or(self.epoch),
                counts: &counts,
                states: &vec![SensorState::Ok; sensors],
            };
            self.say(&message);
            self.sequence += 1;
            self.taken += 1;
            self.next_sample += Duration::from_micros(1_000_000_000 / u64::from(self.rate_millihertz));
        }
    }
}

pub(crate) fn expected_count(sequence: u32, sensor: usize) -> u16 {
    ((sequence as usize * 31 + sensor * 641) % 16_384) as u16
}

/// A session, a device and the line between them, on one virtual clock.
pub(crate) struct World {
    pub(crate) now: Duration,
    pub(crate) session: Session,
    pub(crate) device: FakeDevice,
    pub(crate) events: Vec<Event>,
}

impl World {
    pub(crate) fn new(parts: Vec<Part>) -> Self {
        Self {
            now: Duration::ZERO,
            session: Session::new(SessionSettings::default()),
            device: FakeDevice::new(parts),
            events: Vec::new(),
        }
    }

    /// A session that has been streaming for a second at 100 Hz, its events forgotten.
    pub(crate) fn streaming(parts: Vec<Part>) -> Self {
        let mut world = Self::new(parts);
        world.session.start(100_000);
        world.run(1_000);
        assert!(world.session.is_streaming());
        world.events.clear();
        world
    }

    pub(crate) fn run(&mut self, millis: u64) {
        self.run_with(millis, |bytes| bytes);
    }

    /// Lets time pass in steps of a millisecond; what the device sends goes through `line`.
    pub(crate) fn run_with(&mut self, millis: u64, mut line: impl FnMut(Vec<u8>) -> Vec<u8>) {
        for _ in 0..millis {
            let to_device = self.session.take_outgoing();
            self.device.hear(self.now, &to_device);
            self.device.step(self.now);
            let to_host = line(self.device.take_outgoing());
            self.session.receive(self.now, &to_host, &mut self.events);
            self.session.tick(self.now, &mut self.events);
            self.now += Duration::from_millis(1);
        }
    }

    pub(crate) fn sample_sequences(&self) -> Vec<u32> {
        let sequence = |event: &Event| if let Event::Sample(sample) = event { Some(sample.sequence) } else { None };
        self.events.iter().filter_map(sequence).collect()
    }

    /// The events without samples and clock estimates.
    pub(crate) fn milestones(&self) -> Vec<&Event> {
        self.events.iter().filter(|event| !matches!(event, Event::Sample(_) | Event::Clock(_))).collect()
    }

    pub(crate) fn lost(&self) -> u64 {
        let lost = |event: &Event| if let Event::Lost { count, .. } = event { u64::from(*count) } else { 0 };
        self.events.iter().map(lost).sum()
    }

    pub(crate) fn problems(&self) -> Vec<&armature_device::DeviceProblem> {
        let mut problems = Vec::new();
        for event in &self.events {
            if let Event::Problem(problem) = event {
                problems.push(problem);
            }
        }
        problems
    }
}

/// Pseudo-random bytes by xorshift64*: the same everywhere for one seed.
pub(crate) struct Noise(pub(crate) u64);

impl Noise {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    pub(crate) fn bytes(&mut self, length: usize) -> Vec<u8> {
        (0..length).map(|_| (self.next() >> 40) as u8).collect()
    }
}
