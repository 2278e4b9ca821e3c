//! Messages from the device.

use super::fields::{Fields, ParseError};
use super::numbers::{MAX_NAME, PROTOCOL_MAJOR, message_type};
use super::part::PartUid;
use super::sample::Sample;
use super::topology::TopologyChunk;
use crate::framing::{Encode, EncodeError, Frame, FrameWriter};

/// A message from the device, as read from a frame; the longer messages borrow from it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceMessage<'a> {
    /// Who it is.
    Hello(Hello<'a>),
    /// Some parts of the tree.
    Topology(TopologyChunk<'a>),
    /// Parts were plugged in or out.
    TopologyChanged(TopologyChanged),
    /// One reading of every sensor.
    Sample(Sample<'a>),
    /// The rate granted.
    RateSet(RateSet),
    /// The request is done.
    Acknowledge(Acknowledge),
    /// The device's time.
    Pong(Pong),
    /// The request will not be done.
    Refuse(Refuse),
}

impl<'a> DeviceMessage<'a> {
    /// Reads a frame that came from a device.
    pub fn parse(frame: Frame<'a>) -> Result<Self, ParseError> {
        let fields = Fields::new(frame.message_type, frame.payload);
        Ok(match frame.message_type {
            message_type::HELLO => Self::Hello(Hello::parse(&fields)?),
            message_type::TOPOLOGY => Self::Topology(TopologyChunk::parse(&fields)?),
            message_type::TOPOLOGY_CHANGED => Self::TopologyChanged(TopologyChanged { epoch: fields.u16(0)? }),
            message_type::SAMPLE => Self::Sample(Sample::parse(&fields)?),
            message_type::RATE_SET => Self::RateSet(RateSet { rate_millihertz: fields.u32(0)? }),
            message_type::ACKNOWLEDGE => Self::Acknowledge(Acknowledge { request: fields.u8(0)? }),
            message_type::PONG => Self::Pong(Pong {
                token: fields.u64(0)?,
                received_micros: fields.u64(8)?,
                sent_micros: fields.u64(16)?,
            }),
            message_type::REFUSE => {
                Self::Refuse(Refuse { request: fields.u8(0)?, reason: RefusalReason::from_code(fields.u8(1)?) })
            }
            unknown => return Err(ParseError::UnknownType(unknown)),
        })
    }
}

/// Who the device is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hello<'a> {
    /// Major protocol version it speaks.
    pub protocol_major: u8,
    /// Minor protocol version it speaks.
    pub protocol_minor: u8,
    /// The [`features`] it supports.
    pub features: u32,
    /// Version of its firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Number of the part that holds the microcontroller.
    pub uid: PartUid,
    /// Fastest sampling it can sustain on this line, samples per 1,000 seconds.
    pub max_rate_millihertz: u32,
    /// Product name, at most [`MAX_NAME`] bytes.
    pub name: &'a str,
}

impl<'a> Hello<'a> {
    /// A name that is not UTF-8 is cut at the first invalid byte. For a device with another major version only the
    /// version is read: its other fields may have moved.
    fn parse(fields: &Fields<'a>) -> Result<Self, ParseError> {
        let (protocol_major, protocol_minor) = (fields.u8(0)?, fields.u8(1)?);
        if protocol_major != PROTOCOL_MAJOR {
            let uid = PartUid::default();
            let unread = (0, [0; 3], uid, 0, "");
            let (features, firmware, uid, max_rate_millihertz, name) = unread;
            return Ok(Self { protocol_major, protocol_minor, features, firmware, uid, max_rate_millihertz, name });
        }
        let name_length = usize::from(fields.u8(25)?);
        if name_length > MAX_NAME {
            return Err(fields.bad_value("name_length", 25));
        }
        let name = fields.bytes(26, name_length)?;
        let name = name.utf8_chunks().next().map_or("", |chunk| chunk.valid());
        Ok(Self {
            protocol_major,
            protocol_minor,
            features: fields.u32(2)?,
            firmware: fields.array(6)?,
            uid: fields.uid(9)?,
            max_rate_millihertz: fields.u32(21)?,
            name,
        })
    }
}

impl Encode for Hello<'_> {
    fn message_type(&self) -> u8 {
        message_type::HELLO
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        if self.name.len() > MAX_NAME {
            return Err(EncodeError::Inconsistent);
        }
        writer.put_u8(self.protocol_major);
        writer.put_u8(self.protocol_minor);
        writer.put_u32(self.features);
        writer.put_bytes(&self.firmware);
        writer.put_bytes(&self.uid.0);
        writer.put_u32(self.max_rate_millihertz);
        writer.put_u8(self.name.len() as u8);
        writer.put_bytes(self.name.as_bytes());
        Ok(())
    }
}

/// Parts were plugged in or out; the host requests the tree again.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopologyChanged {
    /// The new tree's epoch.
    pub epoch: u16,
}

impl Encode for TopologyChanged {
    fn message_type(&self) -> u8 {
        message_type::TOPOLOGY_CHANGED
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_u16(self.epoch);
        Ok(())
    }
}

/// The rate granted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RateSet {
    /// Samples per 1,000 seconds.
    pub rate_millihertz: u32,
}

impl Encode for RateSet {
    fn message_type(&self) -> u8 {
        message_type::RATE_SET
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_u32(self.rate_millihertz);
        Ok(())
    }
}

/// A request is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Acknowledge {
    /// Its [`message_type`].
    pub request: u8,
}

impl Encode for Acknowledge {
    fn message_type(&self) -> u8 {
        message_type::ACKNOWLEDGE
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_u8(self.request);
        Ok(())
    }
}

/// The device's clock, in answer to a ping.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pong {
    /// As in the ping.
    pub token: u64,
    /// Device clock when the ping's last byte had arrived.
    pub received_micros: u64,
    /// Device clock when this frame goes out.
    pub sent_micros: u64,
}

impl Encode for Pong {
    fn message_type(&self) -> u8 {
        message_type::PONG
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_u64(self.token);
        writer.put_u64(self.received_micros);
        writer.put_u64(self.sent_micros);
        Ok(())
    }
}

/// A request will not be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refuse {
    /// Its [`message_type`].
    pub request: u8,
    /// Why not.
    pub reason: RefusalReason,
}

impl Encode for Refuse {
    fn message_type(&self) -> u8 {
        message_type::REFUSE
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        writer.put_u8(self.request);
        writer.put_u8(self.reason.code());
        Ok(())
    }
}

/// Why a request will not be done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RefusalReason {
    /// The device does not know the request.
    UnknownRequest,
    /// The request is too short or holds an impossible value.
    Malformed,
    /// Not now; ask again.
    Busy,
    /// No part has that number.
    NoSuchPart,
    /// The device cannot reach its sensors.
    SensorBusFailed,
    /// A reason of a later version.
    Other(u8),
}

impl RefusalReason {
    /// Its number on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Self::UnknownRequest => 1,
            Self::Malformed => 2,
            Self::Busy => 3,
            Self::NoSuchPart => 4,
            Self::SensorBusFailed => 5,
            Self::Other(code) => code,
        }
    }

    /// The reason with this number.
    pub const fn from_code(code: u8) -> Self {
        match code {
            1 => Self::UnknownRequest,
            2 => Self::Malformed,
            3 => Self::Busy,
            4 => Self::NoSuchPart,
            5 => Self::SensorBusFailed,
            other => Self::Other(other),
        }
    }
}
