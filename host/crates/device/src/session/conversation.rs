//! The host's side of the protocol's conversation, message by message.

use std::time::Duration;

use firmware_protocol::{
    Acknowledge, DeviceMessage, Encode, FrameBuffer, Hello, HostMessage, PROTOCOL_MAJOR, ParseError, PartUid, Pong,
    Refuse, TopologyChunk,
};

use super::clock::ClockFilter;
use super::requests::Requests;
use super::settings::SessionSettings;
use super::stream::{Arrival, Missing, Stream};
use super::tree::{Description, Tree};
use crate::events::{ClockEstimate, DeviceInfo, DeviceProblem, Event, RequestKind, Sample, SessionCounters, printable};
use crate::topology::Topology;

/// How often, and at what interval, a running stream requests a new tree before it slows down. A tree of 46 parts takes
/// 3.5 ms on a line of 3 Mbaud.
const QUICK_ATTEMPTS: u32 = 8;
const QUICKLY: Duration = Duration::from_millis(25);

/// The state of the conversation. [`hear`](Self::hear) takes the device's messages; [`pursue`](Self::pursue) requests
/// whatever is still missing for what the host wants.
#[derive(Clone, Debug)]
pub(super) struct Conversation {
    settings: SessionSettings,
    counters: SessionCounters,
    outgoing: Vec<u8>,
    clock: ClockFilter,
    device: Option<DeviceInfo>,
    tree: Tree,
    stream: Stream,
    frame: FrameBuffer,
    requests: Requests,
    wrong_major: bool,
    hello_asked: Duration,
    sampled_since_hello: bool,
    /// The rate at which the host wants samples; `None` for no samples.
    wanted: Option<u32>,
    refused: Option<(RequestKind, u8)>,
    blink: Option<(PartUid, u16)>,
    next_ping: Duration,
}

impl Conversation {
    pub(super) fn new(settings: SessionSettings) -> Self {
        Self {
            settings,
            counters: SessionCounters::default(),
            outgoing: vec![0],
            clock: ClockFilter::default(),
            device: None,
            tree: Tree::default(),
            stream: Stream::default(),
            frame: FrameBuffer::new(),
            requests: Requests::default(),
            wrong_major: false,
            hello_asked: Duration::ZERO,
            sampled_since_hello: false,
            wanted: None,
            refused: None,
            blink: None,
            next_ping: Duration::ZERO,
        }
    }

    pub(super) fn want_samples(&mut self, rate_millihertz: Option<u32>) {
        self.wanted = rate_millihertz;
        if rate_millihertz.is_none() {
            self.requests.settle(RequestKind::Start);
        }
    }

    pub(super) fn want_blink(&mut self, uid: PartUid, duration_millis: u16) {
        self.blink = Some((uid, duration_millis));
        self.requests.settle(RequestKind::Blink);
    }

    pub(super) fn topology(&self) -> Option<&Topology> {
        self.tree.known()
    }

    pub(super) fn is_streaming(&self) -> bool {
        self.stream.is_on()
    }

    pub(super) fn settings(&self) -> SessionSettings {
        self.settings
    }

    /// Who the device is, once it has said so.
    pub(super) fn device(&self) -> Option<&DeviceInfo> {
        self.device.as_ref()
    }

    /// The device's clock, once a ping has been answered.
    pub(super) fn clock(&self) -> Option<ClockEstimate> {
        self.clock.best()
    }

    /// The median round trip of the last pings, once there are a few.
    pub(super) fn round_trip(&self) -> Option<Duration> {
        self.clock.median_round_trip()
    }

    /// The counters above the frame level.
    pub(super) fn counters(&self) -> SessionCounters {
        self.counters
    }

    /// The bytes to send now.
    pub(super) fn take_outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// Counts received bytes.
    pub(super) fn count_bytes(&mut self, bytes: usize) {
        self.counters.bytes += bytes as u64;
    }

    /// Counts and skips a message that cannot be read.
    pub(super) fn count_unread(&mut self, error: ParseError) {
        match error {
            ParseError::UnknownType(_) => self.counters.unknown_messages += 1,
            ParseError::TooShort { .. } | ParseError::BadValue { .. } => self.counters.malformed_messages += 1,
        }
    }

    /// Goes back to the hello, as for a device that has restarted.
    fn begin_again(&mut self, events: &mut Vec<Event>) {
        self.device = None;
        self.requests.forget();
        self.stream.forget();
        self.refused = None;
        self.clock.forget();
        self.tree.drop_withheld(&mut self.counters, events);
        self.tree = Tree::default();
    }

    /// The line is new: anything in transit is lost, and the device may be another.
    pub(super) fn line_opened(&mut self, events: &mut Vec<Event>) {
        if self.device.is_some() {
            events.push(Event::Restarted);
        }
        self.begin_again(events);
        self.wrong_major = false;
        // As at the beginning: a delimiter cuts off whatever was on the line.
        self.outgoing = vec![0];
    }

    /// Takes one message.
    pub(super) fn hear(&mut self, now: Duration, message: &DeviceMessage<'_>, events: &mut Vec<Event>) {
        match message {
            DeviceMessage::Hello(hello) => self.hear_hello(now, hello, events),
            // Even the hello can be refused.
            DeviceMessage::Refuse(refuse) => self.hear_refusal(now, *refuse, events),
            _ if self.device.is_none() => {
                self.counters.stale_samples += u64::from(matches!(message, DeviceMessage::Sample(_)));
            }
            DeviceMessage::Topology(chunk) => self.hear_topology(now, chunk, events),
            DeviceMessage::TopologyChanged(changed) => {
                self.tree.changed(changed.epoch);
            }
            DeviceMessage::Sample(sample) => self.hear_sample(now, sample, events),
            DeviceMessage::RateSet(answer) => {
                if self.requests.settle(RequestKind::SetRate) {
                    self.stream.granted(answer.rate_millihertz, events);
                }
            }
            DeviceMessage::Acknowledge(acknowledge) => self.hear_acknowledge(now, *acknowledge, events),
            DeviceMessage::Pong(Pong { token, received_micros, sent_micros }) => {
                events.extend(self.clock.pong(now, *token, *received_micros, *sent_micros).map(Event::Clock));
            }
        }
    }

    fn hear_hello(&mut self, now: Duration, hello: &Hello<'_>, events: &mut Vec<Event>) {
        if hello.protocol_major != PROTOCOL_MAJOR {
            if !self.wrong_major {
                let problem = DeviceProblem::WrongMajor { theirs: hello.protocol_major, ours: PROTOCOL_MAJOR };
                events.push(Event::Problem(problem));
            }
            self.begin_again(events);
            self.wrong_major = true;
            return;
        }
        self.wrong_major = false;
        let info = DeviceInfo {
            name: printable(hello.name),
            uid: hello.uid,
            protocol: [hello.protocol_major, hello.protocol_minor],
            firmware: hello.firmware,
            features: hello.features,
            max_rate_millihertz: hello.max_rate_millihertz,
        };
        if self.requests.is_waiting(RequestKind::Hello) {
            self.begin_again(events);
            self.counters.connections += 1;
            self.sampled_since_hello = false;
            self.tree.want();
            self.next_ping = now;
            self.device = Some(info.clone());
            events.push(Event::Connected(info));
            return;
        }
        // A request sent twice is answered twice.
        let late_answer = self.device.as_ref() == Some(&info)
            && !self.sampled_since_hello
            && now < self.hello_asked + self.settings.answer_after * 4;
        if self.device.is_some() && !late_answer {
            self.restarted(events);
        }
    }

    fn restarted(&mut self, events: &mut Vec<Event>) {
        self.counters.restarts += 1;
        events.push(Event::Restarted);
        self.begin_again(events);
    }

    fn hear_topology(&mut self, now: Duration, chunk: &TopologyChunk<'_>, events: &mut Vec<Event>) {
        let Some(description) = self.tree.describe(chunk, &mut self.counters, events) else { return };
        if description != Description::Impossible {
            self.requests.settle(RequestKind::Topology);
        }
        if description != Description::Taken {
            self.requests.postpone(RequestKind::Topology, now + self.settings.refused_pause);
        }
    }

    fn hear_acknowledge(&mut self, now: Duration, acknowledge: Acknowledge, events: &mut Vec<Event>) {
        let kind = RequestKind::from_message_type(acknowledge.request);
        let awaited = self.requests.settle(kind);
        if self.refused.is_some_and(|(refused, _)| refused == kind) {
            self.refused = None;
        }
        match kind {
            RequestKind::Start if awaited => self.stream.running(now, events),
            RequestKind::Stop if awaited => {
                self.stream.stopped();
                self.tree.drop_withheld(&mut self.counters, events);
                events.push(Event::Stopped);
            }
            RequestKind::Blink => events.extend(self.blink.take().map(|(uid, _)| Event::Blinking { uid })),
            _ => {}
        }
    }

    /// A refused blink is given up; anything else is requested again after a pause.
    fn hear_refusal(&mut self, now: Duration, refuse: Refuse, events: &mut Vec<Event>) {
        let request = RequestKind::from_message_type(refuse.request);
        if !self.requests.is_waiting(request) {
            return;
        }
        if request == RequestKind::Blink {
            self.blink = None;
            self.requests.settle(request);
        } else {
            self.requests.postpone(request, now + self.settings.refused_pause);
            let said = Some((request, refuse.reason.code()));
            if std::mem::replace(&mut self.refused, said) == said {
                return;
            }
        }
        events.push(Event::Problem(DeviceProblem::Refused { request, reason: refuse.reason }));
    }

    fn hear_sample(&mut self, now: Duration, sample: &firmware_protocol::Sample<'_>, events: &mut Vec<Event>) {
        if !self.stream.is_on() {
            self.counters.stale_samples += 1;
            return;
        }
        self.requests.settle(RequestKind::Start);
        self.stream.running(now, events);
        self.sampled_since_hello = true;
        let arrival = self.stream.follow(now, sample.sequence, sample.device_micros, &mut self.counters, events);
        let device_micros = match arrival {
            Arrival::Use(device_micros) => device_micros,
            Arrival::Drop => return,
            Arrival::Restarted => return self.restarted(events),
        };
        let sample = Sample {
            device_micros,
            sequence: sample.sequence,
            epoch: sample.epoch,
            received: now,
            counts: sample.counts().collect(),
            states: sample.states().collect(),
        };
        self.tree.sample(sample, &mut self.counters, events);
    }

    /// Requests what is missing. `talking`: whether frames have arrived lately.
    pub(super) fn pursue(&mut self, now: Duration, talking: bool, events: &mut Vec<Event>) {
        if self.wrong_major {
            return;
        }
        if self.device.is_none() {
            if self.ask(RequestKind::Hello, HostMessage::HELLO_REQUEST, now, talking, events) {
                self.hello_asked = now;
            }
            return;
        }
        if self.tree.is_wanted() {
            self.ask(RequestKind::Topology, HostMessage::TopologyRequest, now, talking, events);
        }
        let stopping = self.requests.is_waiting(RequestKind::Stop) || self.wanted.is_none();
        match self.wanted {
            _ if stopping && self.is_streaming() => {
                self.ask(RequestKind::Stop, HostMessage::Stop, now, talking, events);
            }
            Some(rate) if self.tree.known().is_some() => self.pursue_stream(rate, now, talking, events),
            _ => {}
        }
        if let Some((uid, duration_millis)) = self.blink {
            self.ask(RequestKind::Blink, HostMessage::Blink { uid, duration_millis }, now, talking, events);
        }
        if self.device.is_some() && now >= self.next_ping {
            let token = self.clock.ping(now);
            self.say(&HostMessage::Ping { token });
            self.next_ping = now + self.settings.ping_every;
        }
    }

    fn pursue_stream(&mut self, rate: u32, now: Duration, talking: bool, events: &mut Vec<Event>) {
        let start_awaited = self.requests.is_waiting(RequestKind::Start);
        match self.stream.pursue(rate, now, self.settings.stalled_after, start_awaited) {
            Missing::Rate => {
                let request = HostMessage::SetRate { rate_millihertz: rate };
                if self.ask(RequestKind::SetRate, request, now, talking, events) {
                    self.stream.asked_rate(rate);
                }
            }
            Missing::Start => {
                self.ask(RequestKind::Start, HostMessage::Start, now, talking, events);
            }
            Missing::Nothing => {}
        }
    }

    /// Sends a request if it is due; returns whether it was sent.
    fn ask(
        &mut self,
        kind: RequestKind,
        message: HostMessage,
        now: Duration,
        talking: bool,
        events: &mut Vec<Event>,
    ) -> bool {
        if !self.requests.is_due(kind, now) {
            return false;
        }
        // Samples of an unknown tree wait for it, so a stream repeats its request quickly at first: a long answer is
        // easily damaged.
        let asked_quickly = if kind == RequestKind::Topology && self.is_streaming() { QUICK_ATTEMPTS } else { 0 };
        let hurry = self.requests.times_asked(kind) < asked_quickly;
        let patience = match kind {
            RequestKind::Topology if hurry => QUICKLY.min(self.settings.answer_after),
            RequestKind::Topology => self.settings.answer_after * 2,
            _ => self.settings.answer_after,
        };
        let asked_before = self.requests.asked(kind, now, patience);
        self.counters.repeated_requests += u64::from(asked_before > 0);
        if asked_before >= self.settings.attempts + asked_quickly {
            if talking {
                events.push(Event::Problem(DeviceProblem::NoAnswer { request: kind }));
            }
            if kind == RequestKind::Blink {
                self.blink = None;
                self.requests.settle(kind);
            } else {
                self.begin_again(events);
            }
            return false;
        }
        self.say(&message);
        true
    }

    fn say(&mut self, message: &impl Encode) {
        // None of the host's messages can fail to fit a frame.
        if let Ok(bytes) = self.frame.encode(message) {
            self.outgoing.extend_from_slice(bytes);
        }
    }
}
