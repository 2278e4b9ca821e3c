//! The session: bytes and the time in, events and bytes out. No I/O, no clock.

use std::time::Duration;

use firmware_protocol::{Decoder, DecoderCounters, DeviceMessage, Frame, ParseError};

use crate::conversation::Conversation;
use crate::{ClockEstimate, DeviceInfo, DeviceProblem, Event, PartUid, SessionCounters, Topology};

/// The times by which a session goes. The defaults suit every device that keeps to the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SessionSettings {
    /// An unanswered request is sent again after this; a topology request after twice this.
    pub answer_after: Duration,
    /// A request sent so often without an answer takes the session back to the hello.
    pub attempts: u32,
    /// Without a byte for so long, the device is reported as silent.
    pub silent_after: Duration,
    /// With bytes but no frame for so long, the device is reported as sending garbage.
    pub garbage_after: Duration,
    /// Without a sample for so long while samples should come, start is sent again. Four sample periods at least.
    pub stalled_after: Duration,
    /// Pause before a refused request is sent again.
    pub refused_pause: Duration,
    /// Time between two pings.
    pub ping_every: Duration,
}

impl Default for SessionSettings {
    fn default() -> Self {
        Self {
            answer_after: Duration::from_millis(250),
            attempts: 8,
            silent_after: Duration::from_secs(2),
            garbage_after: Duration::from_secs(2),
            stalled_after: Duration::from_secs(1),
            refused_pause: Duration::from_secs(1),
            ping_every: Duration::from_secs(1),
        }
    }
}

/// One connection to one device, from the hello on.
///
/// Times are durations since the session began, from whatever clock the caller has: a real one, or a virtual one in
/// tests and replays. They must not go back. The same bytes at the same times give the same events.
///
/// The caller moves the bytes: whatever arrives goes into [`receive`](Self::receive), whatever
/// [`take_outgoing`](Self::take_outgoing) holds goes to the device, and [`tick`](Self::tick) is called every 20 ms or
/// so, so that unanswered requests are repeated. [`Connection`](crate::Connection) does all that over a real line.
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
    last_byte: Duration,
    last_frame: Option<Duration>,
    /// Bytes since the last frame, and when the first of them came.
    frameless: Option<(u64, Duration)>,
    silence_reported: bool,
    garbage_reported: bool,
}

impl Session {
    /// A session that has not said or heard anything; its time begins at zero.
    pub fn new(settings: SessionSettings) -> Self {
        Self {
            decoder: Decoder::new(),
            conversation: Conversation::new(settings),
            last_byte: Duration::ZERO,
            last_frame: None,
            frameless: None,
            silence_reported: false,
            garbage_reported: false,
        }
    }

    /// Wants samples, so many in 1,000 seconds (120,000 for 120 Hz). Takes effect as soon as the device is ready, and
    /// again by itself after a restart. While streaming it changes the rate.
    pub fn start(&mut self, rate_millihertz: u32) {
        self.conversation.want_samples(Some(rate_millihertz));
    }

    /// Wants no more samples; [`Event::Stopped`] follows the last one.
    pub fn stop(&mut self) {
        self.conversation.want_samples(None);
    }

    /// Makes a part show itself; a duration of 0 ends that. A later wish replaces one that is not answered yet.
    pub fn blink(&mut self, uid: PartUid, duration_millis: u16) {
        self.conversation.want_blink(uid, duration_millis);
    }

    /// The line was lost and is open again: everything begins anew from the hello, at once. What the host wants stays,
    /// so samples come again by themselves.
    pub fn line_opened(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.decoder.reset();
        self.conversation.line_opened(events);
        self.last_byte = now;
        self.last_frame = None;
        self.frameless = None;
        self.silence_reported = false;
        self.garbage_reported = false;
        self.pursue(now, events);
    }

    /// Takes bytes that arrived at this time, in whatever portions; appends what they mean to `events`.
    pub fn receive(&mut self, now: Duration, bytes: &[u8], events: &mut Vec<Event>) {
        if bytes.is_empty() {
            return;
        }
        self.last_byte = now;
        self.silence_reported = false;
        self.conversation.counters.bytes += bytes.len() as u64;
        let (pending, since) = self.frameless.unwrap_or((0, now));
        self.frameless = Some((pending + bytes.len() as u64, since));

        let mut rest = bytes;
        let mut more = true;
        while more {
            let before = self.decoder.counters();
            let noise_goes_to = events.len();
            // The frame borrows the decoder: what was skipped in front of it is known only once it has been heard.
            more = if let Some(frame) = self.decoder.next_frame(&mut rest) {
                hear(&mut self.conversation, now, frame, events);
                self.frameless = None;
                self.last_frame = Some(now);
                self.garbage_reported = false;
                true
            } else {
                false
            };
            if self.conversation.device.is_some() {
                events.splice(noise_goes_to..noise_goes_to, noise_between(before, self.decoder.counters()));
            }
        }
        self.pursue(now, events);
    }

    /// Lets time pass: repeats requests, sends pings, notices silence.
    pub fn tick(&mut self, now: Duration, events: &mut Vec<Event>) {
        let settings = self.conversation.settings;
        let silent = now.saturating_sub(self.last_byte);
        if silent >= settings.silent_after && !self.silence_reported {
            self.silence_reported = true;
            events.push(Event::Problem(DeviceProblem::Silent { seconds: silent.as_secs() }));
        }
        if let Some((bytes, since)) = self.frameless {
            let lasted = now.saturating_sub(since);
            let still_coming = silent < settings.silent_after;
            if lasted >= settings.garbage_after && still_coming && !self.garbage_reported {
                self.garbage_reported = true;
                events.push(Event::Problem(DeviceProblem::Garbage { bytes, seconds: lasted.as_secs() }));
            }
        }
        self.pursue(now, events);
    }

    /// The bytes to send to the device now.
    pub fn take_outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.conversation.outgoing)
    }

    /// Who the device is, once it has said so.
    pub fn device(&self) -> Option<&DeviceInfo> {
        self.conversation.device.as_ref()
    }

    /// The tree of parts, once it is known.
    pub fn topology(&self) -> Option<&Topology> {
        self.conversation.topology()
    }

    /// How the device's clock stands to the session's, once a ping has been answered.
    pub fn clock(&self) -> Option<ClockEstimate> {
        self.conversation.clock.best()
    }

    /// Whether samples are asked for or coming.
    pub fn is_streaming(&self) -> bool {
        self.conversation.is_streaming()
    }

    /// What has been counted so far.
    pub fn counters(&self) -> SessionCounters {
        let decoder = self.decoder.counters();
        SessionCounters {
            frames: decoder.frames,
            checksum_errors: decoder.checksum_errors,
            framing_errors: decoder.framing_errors,
            discarded_bytes: decoder.bytes_discarded,
            ..self.conversation.counters
        }
    }

    fn pursue(&mut self, now: Duration, events: &mut Vec<Event>) {
        let talking = self.last_frame.is_some_and(|last| now < last + self.conversation.settings.answer_after * 4);
        self.conversation.pursue(now, talking, events);
    }
}

/// Messages that cannot be read are counted and skipped.
fn hear(conversation: &mut Conversation, now: Duration, frame: Frame<'_>, events: &mut Vec<Event>) {
    match DeviceMessage::parse(frame) {
        Ok(message) => conversation.hear(now, &message, events),
        Err(ParseError::UnknownType(_)) => conversation.counters.unknown_messages += 1,
        Err(ParseError::TooShort { .. } | ParseError::BadValue { .. }) => {
            conversation.counters.malformed_messages += 1;
        }
    }
}

fn noise_between(before: DecoderCounters, after: DecoderCounters) -> Option<Event> {
    let checksum_errors = after.checksum_errors - before.checksum_errors;
    let framing_errors = after.framing_errors - before.framing_errors;
    let bytes = after.bytes_discarded - before.bytes_discarded;
    (checksum_errors + framing_errors > 0).then_some(Event::Noise { checksum_errors, framing_errors, bytes })
}
