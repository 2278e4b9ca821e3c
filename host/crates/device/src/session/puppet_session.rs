//! The session: bytes and the time in, events and bytes out. No I/O, no clock.

use std::time::Duration;

use firmware_protocol::{Decoder, DecoderCounters, DeviceMessage, Frame, PartUid};

use super::conversation::Conversation;
use super::settings::SessionSettings;
use crate::events::{ClockEstimate, DeviceInfo, DeviceNotice, DeviceProblem, Event, SessionCounters};
use crate::topology::Topology;

/// One connection to one device, from the hello on.
///
/// Times are durations since the session began, from any clock the caller has: a real one, or a virtual one in tests
/// and replays. They must not go back. The same bytes at the same times give the same events.
///
/// The caller moves the bytes: whatever arrives goes into [`receive`](Self::receive), whatever
/// [`take_outgoing`](Self::take_outgoing) returns goes to the device, and [`tick`](Self::tick) is called about every 20
/// ms, so that unanswered requests are repeated. [`Connection`](crate::Connection) does all that over a real line.
///
/// ```
/// use std::time::Duration;
/// use armature_device::{Session, SessionSettings};
///
/// let mut session = Session::new(SessionSettings::default());
/// let mut events = Vec::new();
/// session.start(120_000);
/// session.tick(Duration::ZERO, &mut events);
/// assert!(!session.take_outgoing().is_empty(), "the host speaks first");
/// ```
#[derive(Clone, Debug)]
pub struct Session {
    decoder: Decoder,
    conversation: Conversation,
    opened: Duration,
    waiting_reported: bool,
    last_byte: Duration,
    /// On this line.
    last_frame: Option<Duration>,
    /// Bytes since the last frame, and when the first of them arrived.
    frameless: Option<(u64, Duration)>,
    silence_reported: bool,
    garbage_reported: bool,
}

impl Session {
    /// A session that has not sent or received anything; its time begins at zero.
    pub fn new(settings: SessionSettings) -> Self {
        Self {
            decoder: Decoder::new(),
            conversation: Conversation::new(settings),
            opened: Duration::ZERO,
            waiting_reported: false,
            last_byte: Duration::ZERO,
            last_frame: None,
            frameless: None,
            silence_reported: false,
            garbage_reported: false,
        }
    }

    /// Requests samples at this rate, in samples per 1,000 seconds (120,000 for 120 Hz). Takes effect as soon as the
    /// device is ready, and again automatically after a restart. While streaming, it changes the rate.
    pub fn start(&mut self, rate_millihertz: u32) {
        self.conversation.want_samples(Some(rate_millihertz));
    }

    /// Ends the samples; [`Event::Stopped`] follows the last one.
    pub fn stop(&mut self) {
        self.conversation.want_samples(None);
    }

    /// Makes a part blink; a duration of 0 stops it. A later call replaces one that is not answered yet.
    pub fn blink(&mut self, uid: PartUid, duration_millis: u16) {
        self.conversation.want_blink(uid, duration_millis);
    }

    /// The line was lost and is open again: everything starts over from the hello, immediately. What the host wants is
    /// kept, so samples resume automatically.
    pub fn line_opened(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.decoder.reset();
        self.conversation.line_opened(events);
        self.opened = now;
        self.waiting_reported = false;
        self.last_byte = now;
        self.last_frame = None;
        self.frameless = None;
        self.silence_reported = false;
        self.garbage_reported = false;
        self.pursue(now, events);
    }

    /// Takes bytes that arrived at this time, in portions of any size; appends what they mean to `events`.
    pub fn receive(&mut self, now: Duration, bytes: &[u8], events: &mut Vec<Event>) {
        if bytes.is_empty() {
            return;
        }
        self.last_byte = now;
        self.silence_reported = false;
        self.conversation.count_bytes(bytes.len());
        let (pending, since) = self.frameless.unwrap_or((0, now));
        self.frameless = Some((pending + bytes.len() as u64, since));

        let mut rest = bytes;
        let mut more = true;
        while more {
            let before = self.decoder.counters();
            let noise_goes_to = events.len();
            // The frame borrows the decoder: what was skipped before it is known only once the frame has been handled.
            more = if let Some(frame) = self.decoder.next_frame(&mut rest) {
                hear(&mut self.conversation, now, frame, events);
                self.frameless = None;
                self.last_frame = Some(now);
                self.garbage_reported = false;
                true
            } else {
                false
            };
            if self.conversation.device().is_some() {
                events.splice(noise_goes_to..noise_goes_to, noise_between(before, self.decoder.counters()));
            }
        }
        self.pursue(now, events);
    }

    /// Advances time: repeats requests, sends pings, notices silence.
    pub fn tick(&mut self, now: Duration, events: &mut Vec<Event>) {
        let settings = self.conversation.settings();
        let open_for = now.saturating_sub(self.opened);
        let is_starting = self.last_frame.is_none() && open_for < settings.starting_for;
        if is_starting && open_for >= settings.waits_after && !self.waiting_reported {
            self.waiting_reported = true;
            events.push(Event::Notice(DeviceNotice::WaitsForStart));
        }
        let silent = now.saturating_sub(self.last_byte);
        if silent >= settings.silent_after && !is_starting && !self.silence_reported {
            self.silence_reported = true;
            events.push(Event::Problem(DeviceProblem::Silent { seconds: silent.as_secs() }));
        }
        if let Some((bytes, since)) = self.frameless {
            let lasted = now.saturating_sub(since);
            let still_coming = silent < settings.silent_after && !is_starting;
            if lasted >= settings.garbage_after && still_coming && !self.garbage_reported {
                self.garbage_reported = true;
                events.push(Event::Problem(DeviceProblem::Garbage { bytes, seconds: lasted.as_secs() }));
            }
        }
        self.pursue(now, events);
    }

    /// The bytes to send to the device now.
    pub fn take_outgoing(&mut self) -> Vec<u8> {
        self.conversation.take_outgoing()
    }

    /// Who the device is, once it has said so.
    pub fn device(&self) -> Option<&DeviceInfo> {
        self.conversation.device()
    }

    /// The tree of parts, once it is known.
    pub fn topology(&self) -> Option<&Topology> {
        self.conversation.topology()
    }

    /// The device's clock relative to the session's, once a ping has been answered.
    pub fn clock(&self) -> Option<ClockEstimate> {
        self.conversation.clock()
    }

    /// The median time that bytes travelled to the device and back, over the last minute's pings; `None` until there are a
    /// few.
    pub fn round_trip(&self) -> Option<Duration> {
        self.conversation.round_trip()
    }

    /// Whether samples have been requested or are arriving.
    pub fn is_streaming(&self) -> bool {
        self.conversation.is_streaming()
    }

    /// The counters so far.
    pub fn counters(&self) -> SessionCounters {
        let decoder = self.decoder.counters();
        SessionCounters {
            frames: decoder.frames,
            checksum_errors: decoder.checksum_errors,
            framing_errors: decoder.framing_errors,
            discarded_bytes: decoder.bytes_discarded,
            ..self.conversation.counters()
        }
    }

    fn pursue(&mut self, now: Duration, events: &mut Vec<Event>) {
        let talking = self.last_frame.is_some_and(|last| now < last + self.conversation.settings().answer_after * 4);
        self.conversation.pursue(now, talking, events);
    }
}

/// Counts and skips messages that cannot be read.
fn hear(conversation: &mut Conversation, now: Duration, frame: Frame<'_>, events: &mut Vec<Event>) {
    match DeviceMessage::parse(frame) {
        Ok(message) => conversation.hear(now, &message, events),
        Err(error) => conversation.count_unread(error),
    }
}

fn noise_between(before: DecoderCounters, after: DecoderCounters) -> Option<Event> {
    let checksum_errors = after.checksum_errors - before.checksum_errors;
    let framing_errors = after.framing_errors - before.framing_errors;
    let bytes = after.bytes_discarded - before.bytes_discarded;
    (checksum_errors + framing_errors > 0).then_some(Event::Noise { checksum_errors, framing_errors, bytes })
}
