//! What a host can request from a puppet.

use std::fmt;

use firmware_protocol::message_type;

/// What a host can request.
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
    /// Blink a part.
    Blink,
    /// A request that this version never makes.
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
