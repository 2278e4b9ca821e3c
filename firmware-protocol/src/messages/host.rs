//! Messages from the host.

use super::fields::{Fields, ParseError};
use super::numbers::{PROTOCOL_MAJOR, PROTOCOL_MINOR, features, message_type};
use super::part::{PartKind, PartUid};
use crate::framing::{Encode, EncodeError, Frame, FrameWriter};

/// A message from the host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostMessage {
    /// Who is there? The device stops streaming and answers with a hello.
    HelloRequest {
        /// Major protocol version the host speaks.
        host_major: u8,
        /// Minor protocol version the host speaks.
        host_minor: u8,
        /// The [`features`] the host can use.
        host_features: u32,
    },
    /// Describe the tree. The device answers with topology messages.
    TopologyRequest,
    /// Sample this often, in samples per 1,000 seconds. The device answers with the rate granted.
    SetRate {
        /// The requested rate.
        rate_millihertz: u32,
    },
    /// Send samples. Acknowledged.
    Start,
    /// Send no more samples. Acknowledged after the last one.
    Stop,
    /// What time is it? Answered with a pong.
    Ping {
        /// Anything; comes back unchanged.
        token: u64,
    },
    /// Show me this part. Acknowledged or refused.
    Blink {
        /// Which part.
        uid: PartUid,
        /// For how long; 0 stops it.
        duration_millis: u16,
    },
    /// Write into this part's memory what it is. Acknowledged when it has been read back, or refused. Only for devices
    /// with the feature [`features::LABEL`]; the epoch changes with it.
    Label {
        /// Which part.
        uid: PartUid,
        /// What it is.
        kind: PartKind,
        /// How many sensors it has.
        sensor_count: u8,
        /// How many outlets it has.
        outlet_count: u8,
        /// Resolution of its sensors; ignored if it has none.
        counts_per_turn: u32,
    },
}

impl HostMessage {
    /// The hello request of a host that speaks this version of the protocol.
    pub const HELLO_REQUEST: Self = Self::HelloRequest {
        host_major: PROTOCOL_MAJOR,
        host_minor: PROTOCOL_MINOR,
        host_features: features::BLINK | features::HOT_PLUG,
    };

    /// Reads a frame that came from a host.
    pub fn parse(frame: Frame<'_>) -> Result<Self, ParseError> {
        let fields = Fields::new(frame.message_type, frame.payload);
        Ok(match frame.message_type {
            message_type::HELLO_REQUEST => Self::HelloRequest {
                host_major: fields.u8(0)?,
                host_minor: fields.u8(1)?,
                host_features: fields.u32(2)?,
            },
            message_type::TOPOLOGY_REQUEST => Self::TopologyRequest,
            message_type::SET_RATE => Self::SetRate { rate_millihertz: fields.u32(0)? },
            message_type::START => Self::Start,
            message_type::STOP => Self::Stop,
            message_type::PING => Self::Ping { token: fields.u64(0)? },
            message_type::BLINK => Self::Blink { uid: fields.uid(0)?, duration_millis: fields.u16(12)? },
            message_type::LABEL => Self::Label {
                uid: fields.uid(0)?,
                kind: PartKind::from_code(fields.u8(12)?),
                sensor_count: fields.u8(13)?,
                outlet_count: fields.u8(14)?,
                counts_per_turn: fields.u32(15)?,
            },
            unknown => return Err(ParseError::UnknownType(unknown)),
        })
    }
}

impl Encode for HostMessage {
    fn message_type(&self) -> u8 {
        match self {
            Self::HelloRequest { .. } => message_type::HELLO_REQUEST,
            Self::TopologyRequest => message_type::TOPOLOGY_REQUEST,
            Self::SetRate { .. } => message_type::SET_RATE,
            Self::Start => message_type::START,
            Self::Stop => message_type::STOP,
            Self::Ping { .. } => message_type::PING,
            Self::Blink { .. } => message_type::BLINK,
            Self::Label { .. } => message_type::LABEL,
        }
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        match *self {
            Self::HelloRequest { host_major, host_minor, host_features } => {
                writer.put_u8(host_major);
                writer.put_u8(host_minor);
                writer.put_u32(host_features);
            }
            Self::TopologyRequest | Self::Start | Self::Stop => {}
            Self::SetRate { rate_millihertz } => writer.put_u32(rate_millihertz),
            Self::Ping { token } => writer.put_u64(token),
            Self::Blink { uid, duration_millis } => {
                writer.put_bytes(&uid.0);
                writer.put_u16(duration_millis);
            }
            Self::Label { uid, kind, sensor_count, outlet_count, counts_per_turn } => {
                writer.put_bytes(&uid.0);
                writer.put_u8(kind.code());
                writer.put_u8(sensor_count);
                writer.put_u8(outlet_count);
                writer.put_u32(counts_per_turn);
            }
        }
        Ok(())
    }
}
