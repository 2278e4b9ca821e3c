//! Which requests are waiting for their answers, and when to ask again.

use std::fmt;
use std::time::Duration;

use firmware_protocol::message_type;

/// What a host can ask for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestKind {
    /// Who is there?
    Hello,
    /// Describe the tree.
    Topology,
    /// Sample this often.
    SetRate,
    /// Send samples.
    Start,
    /// Send no more samples.
    Stop,
    /// Show a part.
    Blink,
    /// Something this version never asks for.
    Other(u8),
}

impl RequestKind {
    /// The request with this message type.
    pub(crate) fn from_message_type(message_type: u8) -> Self {
        match message_type {
            message_type::HELLO_REQUEST => Self::Hello,
            message_type::TOPOLOGY_REQUEST => Self::Topology,
            message_type::SET_RATE => Self::SetRate,
            message_type::START => Self::Start,
            message_type::STOP => Self::Stop,
            message_type::BLINK => Self::Blink,
            other => Self::Other(other),
        }
    }

    fn slot(self) -> usize {
        match self {
            Self::Hello => 0,
            Self::Topology => 1,
            Self::SetRate => 2,
            Self::Start => 3,
            Self::Stop => 4,
            Self::Blink | Self::Other(_) => 5,
        }
    }
}

impl fmt::Display for RequestKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Hello => f.write_str("hello"),
            Self::Topology => f.write_str("topology"),
            Self::SetRate => f.write_str("rate"),
            Self::Start => f.write_str("start"),
            Self::Stop => f.write_str("stop"),
            Self::Blink => f.write_str("blink"),
            Self::Other(number) => write!(f, "0x{number:02x}"),
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    ask_again: Duration,
    asked: u32,
}

/// The requests that wait for an answer, one of each kind at most.
#[derive(Clone, Debug, Default)]
pub(crate) struct Requests {
    waiting: [Option<Waiting>; 6],
}

impl Requests {
    /// Whether an answer to this is awaited.
    pub(crate) fn is_waiting(&self, kind: RequestKind) -> bool {
        self.waiting[kind.slot()].is_some()
    }

    /// Whether this is to be sent now: for the first time, or again.
    pub(crate) fn is_due(&self, kind: RequestKind, now: Duration) -> bool {
        self.waiting[kind.slot()].is_none_or(|waiting| now >= waiting.ask_again)
    }

    /// How often this has been asked without an answer.
    pub(crate) fn times_asked(&self, kind: RequestKind) -> u32 {
        self.waiting[kind.slot()].map_or(0, |waiting| waiting.asked)
    }

    /// Notes that it is sent; returns how often it has been sent before without an answer.
    pub(crate) fn asked(&mut self, kind: RequestKind, now: Duration, patience: Duration) -> u32 {
        let slot = &mut self.waiting[kind.slot()];
        let before = slot.map_or(0, |waiting| waiting.asked);
        *slot = Some(Waiting { ask_again: now + patience, asked: before + 1 });
        before
    }

    /// Notes that no answer is awaited any more; returns whether one was.
    pub(crate) fn settle(&mut self, kind: RequestKind) -> bool {
        self.waiting[kind.slot()].take().is_some()
    }

    /// Asks again only then; for requests that were refused.
    pub(crate) fn postpone(&mut self, kind: RequestKind, until: Duration) {
        self.waiting[kind.slot()] = Some(Waiting { ask_again: until, asked: 0 });
    }

    /// Awaits nothing any more.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }
}
