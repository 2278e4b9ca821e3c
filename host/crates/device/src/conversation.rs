//! What is said and heard: the host's side of the protocol's conversation, message by message.

use std::collections::VecDeque;
use std::time::Duration;

use firmware_protocol::{
    Acknowledge, DeviceMessage, Encode, FrameBuffer, Hello, HostMessage, PROTOCOL_MAJOR, Pong, Refuse, TopologyChunk,
};

use crate::clock::ClockFilter;
use crate::requests::Requests;
use crate::sequence::{Followed, SequenceFollower};
use crate::topology::Assembly;
use crate::{
    DeviceInfo, DeviceNotice, DeviceProblem, Event, PartUid, RequestKind, Sample, SessionCounters, SessionSettings,
    Topology,
};

/// Samples kept while their topology is on its way; at 1,000 Hz the last two seconds.
const MAX_WITHHELD: usize = 2_000;

/// How often, and how quickly one after the other, a running stream asks for a new tree before it takes its time. A tree
/// of 46 parts takes 3.5 ms on a line of 3 Mbaud.
const QUICK_ATTEMPTS: u32 = 8;
const QUICKLY: Duration = Duration::from_millis(25);

/// A device whose samples fitted none of so many of its answers will not be understood.
const MISFITS: u32 = 4;
/// A clock that goes back so often within this time is no device that starts anew.
const BACKWARDS: usize = 4;
const BACKWARDS_WITHIN: Duration = Duration::from_secs(20);
/// More samples a second than 12 Mbaud carry of the smallest kind, in 1,000 seconds.
const IMPOSSIBLE_RATE: u32 = 50_000_000;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Stream {
    #[default]
    Stopped,
    /// Start is asked for, nothing heard yet.
    Starting,
    Running,
}

#[derive(Clone, Copy, Debug)]
struct RateAnswer {
    asked: u32,
    granted: u32,
}

/// What is known of the parts, and what waits for more.
#[derive(Clone, Debug, Default)]
struct Tree {
    known: Option<Topology>,
    assembly: Assembly,
    wanted: bool,
    /// Whether the present trouble with the tree has been reported.
    complained: bool,
    /// Samples of an epoch whose topology is on its way.
    withheld: VecDeque<Sample>,
    /// Answers in a row that fitted none of the samples that waited for them.
    misfits: u32,
}

/// The state of the conversation. [`hear`](Self::hear) takes what the device says; [`pursue`](Self::pursue) asks for
/// whatever is still missing on the way to what the host wants.
#[derive(Clone, Debug)]
pub(crate) struct Conversation {
    pub(crate) settings: SessionSettings,
    pub(crate) counters: SessionCounters,
    pub(crate) outgoing: Vec<u8>,
    pub(crate) clock: ClockFilter,
    pub(crate) device: Option<DeviceInfo>,
    tree: Tree,
    frame: FrameBuffer,
    requests: Requests,
    wrong_major: bool,
    hello_asked: Duration,
    sampled_since_hello: bool,
    /// The rate at which the host wants samples; `None` for no samples.
    wanted: Option<u32>,
    rate_asked: u32,
    rate: Option<RateAnswer>,
    stream: Stream,
    sequence: SequenceFollower,
    last_sample: Duration,
    refused: Option<(RequestKind, u8)>,
    blink: Option<(PartUid, u16)>,
    next_ping: Duration,
    /// When the clock of the samples last went back, and whether that was told.
    backwards: VecDeque<Duration>,
    backwards_told: bool,
}

impl Conversation {
    pub(crate) fn new(settings: SessionSettings) -> Self {
        Self {
            settings,
            counters: SessionCounters::default(),
            outgoing: vec![0],
            clock: ClockFilter::default(),
            device: None,
            tree: Tree::default(),
            frame: FrameBuffer::new(),
            requests: Requests::default(),
            wrong_major: false,
            hello_asked: Duration::ZERO,
            sampled_since_hello: false,
            wanted: None,
            rate_asked: 0,
            rate: None,
            stream: Stream::Stopped,
            sequence: SequenceFollower::default(),
            last_sample: Duration::ZERO,
            refused: None,
            blink: None,
            next_ping: Duration::ZERO,
            backwards: VecDeque::new(),
            backwards_told: false,
        }
    }

    pub(crate) fn want_samples(&mut self, rate_millihertz: Option<u32>) {
        self.wanted = rate_millihertz;
        if rate_millihertz.is_none() {
            self.requests.settle(RequestKind::Start);
        }
    }

    pub(crate) fn want_blink(&mut self, uid: PartUid, duration_millis: u16) {
        self.blink = Some((uid, duration_millis));
        self.requests.settle(RequestKind::Blink);
    }

    pub(crate) fn topology(&self) -> Option<&Topology> {
        self.tree.known.as_ref()
    }

    pub(crate) fn is_streaming(&self) -> bool {
        self.stream != Stream::Stopped
    }

    /// Goes back to the hello, as with a device that has started anew.
    fn begin_again(&mut self) {
        self.device = None;
        self.requests.forget();
        self.rate = None;
        self.stream = Stream::Stopped;
        self.refused = None;
        self.clock.forget();
        self.drop_withheld();
        self.tree = Tree::default();
    }

    /// The line is a new one: what was on its way is lost, and the device may be too.
    pub(crate) fn line_opened(&mut self, events: &mut Vec<Event>) {
        if self.device.is_some() {
            events.push(Event::Restarted);
        }
        self.begin_again();
        self.wrong_major = false;
        // As at the beginning: a delimiter cuts off whatever the line held.
        self.outgoing = vec![0];
    }

    fn drop_withheld(&mut self) {
        let dropped = self.tree.withheld.len() as u64;
        self.tree.withheld.clear();
        self.counters.unusable_samples += dropped;
        self.counters.lost_samples += dropped;
    }

    /// Takes one message.
    pub(crate) fn hear(&mut self, now: Duration, message: &DeviceMessage<'_>, events: &mut Vec<Event>) {
        match message {
            DeviceMessage::Hello(hello) => self.hear_hello(now, hello, events),
            _ if self.device.is_none() => {
                self.counters.stale_samples += u64::from(matches!(message, DeviceMessage::Sample(_)));
            }
            DeviceMessage::Topology(chunk) => self.hear_topology(now, chunk, events),
            DeviceMessage::TopologyChanged(changed) => {
                self.tree.wanted |= self.tree.known.as_ref().is_none_or(|known| known.epoch != changed.epoch);
            }
            DeviceMessage::Sample(sample) => self.hear_sample(now, sample, events),
            DeviceMessage::RateSet(answer) => {
                if self.requests.settle(RequestKind::SetRate) {
                    let (asked, granted) = (self.rate_asked, answer.rate_millihertz);
                    self.rate = Some(RateAnswer { asked, granted });
                    events.push(Event::RateGranted { asked_millihertz: asked, granted_millihertz: granted });
                    if granted > IMPOSSIBLE_RATE {
                        let hertz = f64::from(granted) / 1_000.0;
                        events.push(Event::Notice(DeviceNotice::ImpossibleRate { hertz }));
                    }
                }
            }
            DeviceMessage::Acknowledge(acknowledge) => self.hear_acknowledge(now, *acknowledge, events),
            DeviceMessage::Pong(Pong { token, received_micros, sent_micros }) => {
                events.extend(self.clock.pong(now, *token, *received_micros, *sent_micros).map(Event::Clock));
            }
            DeviceMessage::Refuse(refuse) => self.hear_refusal(now, *refuse, events),
        }
    }

    fn hear_hello(&mut self, now: Duration, hello: &Hello<'_>, events: &mut Vec<Event>) {
        if hello.protocol_major != PROTOCOL_MAJOR {
            if !self.wrong_major {
                let problem = DeviceProblem::WrongMajor { theirs: hello.protocol_major, ours: PROTOCOL_MAJOR };
                events.push(Event::Problem(problem));
            }
            self.begin_again();
            self.wrong_major = true;
            return;
        }
        self.wrong_major = false;
        let info = DeviceInfo {
            name: hello.name.to_owned(),
            uid: hello.uid,
            protocol: [hello.protocol_major, hello.protocol_minor],
            firmware: hello.firmware,
            features: hello.features,
            max_rate_millihertz: hello.max_rate_millihertz,
        };
        if self.requests.is_waiting(RequestKind::Hello) {
            self.begin_again();
            self.counters.connections += 1;
            self.sampled_since_hello = false;
            self.tree.wanted = true;
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
        self.begin_again();
    }

    fn hear_topology(&mut self, now: Duration, chunk: &TopologyChunk<'_>, events: &mut Vec<Event>) {
        let Some(finished) = self.tree.assembly.take(chunk) else { return };
        match finished {
            Ok(topology) => {
                self.tree.wanted = false;
                self.tree.complained = false;
                self.requests.settle(RequestKind::Topology);
                if self.tree.known.as_ref() != Some(&topology) {
                    events.push(Event::Topology(topology.clone()));
                    self.tree.known = Some(topology);
                }
                let withheld = std::mem::take(&mut self.tree.withheld);
                let latest = withheld.back().map(|sample| sample.epoch);
                let before = self.counters.samples;
                for sample in withheld {
                    self.lay_out(sample, events);
                }
                if let Some(epoch) = latest {
                    self.count_misfits(now, epoch, self.counters.samples == before, events);
                }
            }
            Err(problem) => {
                self.requests.postpone(RequestKind::Topology, now + self.settings.refused_pause);
                if !std::mem::replace(&mut self.tree.complained, true) {
                    events.push(Event::Problem(problem.into()));
                }
            }
        }
    }

    /// Samples of this epoch have waited for the tree that has come now. Where again and again none of them fits it, the
    /// tree is asked for less often.
    fn count_misfits(&mut self, now: Duration, sample: u16, none_fits: bool, events: &mut Vec<Event>) {
        let tree = self.tree.known.as_ref().map_or(sample, |known| known.epoch);
        self.tree.misfits = if none_fits && tree != sample { self.tree.misfits.saturating_add(1) } else { 0 };
        if self.tree.misfits == MISFITS {
            events.push(Event::Problem(DeviceProblem::UnknownEpoch { sample, tree }));
        }
        if self.tree.misfits >= MISFITS {
            self.requests.postpone(RequestKind::Topology, now + self.settings.refused_pause);
        }
    }

    /// A sample's clock went back: once it is a device that has started anew.
    fn clock_went_back(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.backwards.retain(|&at| now < at + BACKWARDS_WITHIN);
        self.backwards_told &= !self.backwards.is_empty();
        self.backwards.push_back(now);
        let (times, since) = (self.backwards.len(), self.backwards.front().copied().unwrap_or(now));
        if times >= BACKWARDS && !std::mem::replace(&mut self.backwards_told, true) {
            let seconds = now.saturating_sub(since).as_secs();
            events.push(Event::Problem(DeviceProblem::ClockRunsBackwards { times, seconds }));
        }
        self.restarted(events);
    }

    fn hear_acknowledge(&mut self, now: Duration, acknowledge: Acknowledge, events: &mut Vec<Event>) {
        let kind = RequestKind::from_message_type(acknowledge.request);
        let awaited = self.requests.settle(kind);
        if self.refused.is_some_and(|(refused, _)| refused == kind) {
            self.refused = None;
        }
        match kind {
            RequestKind::Start if awaited => self.running(now, events),
            RequestKind::Stop if awaited => {
                self.stream = Stream::Stopped;
                self.drop_withheld();
                events.push(Event::Stopped);
            }
            RequestKind::Blink => events.extend(self.blink.take().map(|(uid, _)| Event::Blinking { uid })),
            _ => {}
        }
    }

    /// A refused blink is given up; anything else is asked for again after a pause.
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

    fn running(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.last_sample = now;
        if self.stream == Stream::Starting {
            self.stream = Stream::Running;
            events.push(Event::Started);
        }
    }

    fn hear_sample(&mut self, now: Duration, sample: &firmware_protocol::Sample<'_>, events: &mut Vec<Event>) {
        if self.stream == Stream::Stopped {
            self.counters.stale_samples += 1;
            return;
        }
        self.requests.settle(RequestKind::Start);
        self.running(now, events);
        self.sampled_since_hello = true;
        match self.sequence.follow(sample.sequence, sample.device_micros) {
            Followed::Next => {}
            Followed::After(count) => {
                self.counters.lost_samples += u64::from(count);
                events.push(Event::Lost { count, next_sequence: sample.sequence });
            }
            Followed::Duplicate => {
                self.counters.duplicate_samples += 1;
                return;
            }
            Followed::Restarted => return self.clock_went_back(now, events),
        }
        let sample = Sample {
            device_micros: sample.device_micros,
            sequence: sample.sequence,
            epoch: sample.epoch,
            received: now,
            counts: sample.counts().collect(),
            states: sample.states().collect(),
        };
        if self.tree.known.as_ref().is_some_and(|known| known.epoch == sample.epoch) {
            self.lay_out(sample, events);
        } else {
            self.tree.wanted = true;
            if self.tree.withheld.len() == MAX_WITHHELD {
                self.tree.withheld.pop_front();
                self.counters.unusable_samples += 1;
                self.counters.lost_samples += 1;
            }
            self.tree.withheld.push_back(sample);
        }
    }

    /// Hands a sample on if it fits the tree.
    fn lay_out(&mut self, sample: Sample, events: &mut Vec<Event>) {
        let Some(topology) = &self.tree.known else { return };
        if topology.epoch == sample.epoch && topology.sensor_count == sample.counts.len() {
            self.counters.samples += 1;
            self.tree.misfits = 0;
            events.push(Event::Sample(sample));
            return;
        }
        self.counters.unusable_samples += 1;
        self.counters.lost_samples += 1;
        self.tree.wanted = true;
        if topology.epoch == sample.epoch && !std::mem::replace(&mut self.tree.complained, true) {
            let (expected, found) = (topology.sensor_count, sample.counts.len());
            let problem = DeviceProblem::SampleDoesNotFit { epoch: sample.epoch, expected, found };
            events.push(Event::Problem(problem));
        }
    }

    /// Asks for what is missing. `talking`: whether frames have come lately.
    pub(crate) fn pursue(&mut self, now: Duration, talking: bool, events: &mut Vec<Event>) {
        if self.wrong_major {
            return;
        }
        if self.device.is_none() {
            if self.ask(RequestKind::Hello, HostMessage::HELLO_REQUEST, now, talking, events) {
                self.hello_asked = now;
            }
            return;
        }
        if self.tree.wanted {
            self.ask(RequestKind::Topology, HostMessage::TopologyRequest, now, talking, events);
        }
        let stopping = self.requests.is_waiting(RequestKind::Stop) || self.wanted.is_none();
        match self.wanted {
            _ if stopping && self.is_streaming() => {
                self.ask(RequestKind::Stop, HostMessage::Stop, now, talking, events);
            }
            Some(rate) if self.tree.known.is_some() => self.pursue_stream(rate, now, talking, events),
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
        let granted = match self.rate {
            Some(answer) if answer.asked == rate => answer.granted,
            _ => {
                let request = HostMessage::SetRate { rate_millihertz: rate };
                if self.ask(RequestKind::SetRate, request, now, talking, events) {
                    self.rate_asked = rate;
                }
                return;
            }
        };
        let four_periods = Duration::from_millis(4_000_000 / u64::from(granted.max(1)));
        let stalled = now > self.last_sample + self.settings.stalled_after.max(four_periods);
        if self.stream == Stream::Stopped {
            self.stream = Stream::Starting;
            self.sequence = SequenceFollower::default();
        } else if self.stream == Stream::Running && !stalled && !self.requests.is_waiting(RequestKind::Start) {
            return;
        }
        // While samples should come but do not, start is repeated: it changes nothing for a device that streams.
        self.ask(RequestKind::Start, HostMessage::Start, now, talking, events);
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
        // Samples of an unknown tree wait for it, so a stream asks quickly for a while: a long answer is easily damaged.
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
                self.begin_again();
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
