//! The messages: the one table, and a type for each.
//!
//! All numbers are unsigned and little-endian. Offsets are bytes from the start of the payload. `R` marks who sends:
//! `>` host to device, `<` device to host.
//!
//! ```text
//! type R  message            offset  field                 meaning
//! 0x01 >  hello request           0  host_major u8         protocol the host speaks
//!                                 1  host_minor u8
//!                                 2  host_features u32     features the host can use, see `features`
//! 0x02 >  topology request                                 (no fields)
//! 0x03 >  set rate                0  rate_millihertz u32   samples in 1,000 seconds: 120 Hz is 120,000
//! 0x04 >  start                                            (no fields)
//! 0x05 >  stop                                             (no fields)
//! 0x06 >  ping                    0  token u64             anything; comes back unchanged
//! 0x07 >  blink                   0  uid 12 bytes          the part that is to show itself
//!                                12  duration_millis u16   for how long; 0 stops it
//!
//! 0x81 <  hello                   0  protocol_major u8     these two fields stay here in every version
//!                                 1  protocol_minor u8
//!                                 2  features u32          features the device has, see `features`
//!                                 6  firmware_major u8
//!                                 7  firmware_minor u8
//!                                 8  firmware_patch u8
//!                                 9  uid 12 bytes          of the part that holds the microcontroller
//!                                21  max_rate_millihertz u32  fastest sampling it can keep up on this line
//!                                25  name_length u8        0 to 32
//!                                26  name                  product name, UTF-8, name_length bytes
//! 0x82 <  topology                0  epoch u16             the tree these records belong to
//!                                 2  part_count u16        parts of the whole tree, at most 65,534
//!                                 4  first_index u16       index of the first part in this message
//!                                 6  record_count u8       parts in this message, at most 46
//!                                 7  record_length u8      bytes of each record: 22, in later versions more
//!                                 8  records               record_count of them:
//!           in each record        0  kind u8               1 bend, 2 twist, 3 twist-bend-twist, 4 splitter
//!                                 1  sensor_count u8       sensors it adds to a sample: 1, 1, 3, 0
//!                                 2  outlet u8             the parent's outlet it sits in, from 0; root 0
//!                                 3  outlet_count u8       outlets it has: joints 1, splitters 1 to 5
//!                                 4  parent u16            index of the part it is plugged into; root 0xFFFF
//!                                 6  uid 12 bytes          its own number, wherever it is plugged in
//!                                18  counts_per_turn u32   resolution of its sensors, 2 to 65,536; 0 without
//! 0x83 <  topology changed        0  epoch u16             the new tree's
//! 0x84 <  sample                  0  device_micros u64     when the sensors were read, since power-up
//!                                 8  sequence u32          0 after start; one more for each sample taken
//!                                12  epoch u16             the tree the sensors are numbered by
//!                                14  sensor_count u16      n, at most 448
//!                                16  counts u16 x n        part by part as the records, inlet to outlet
//!                              16+2n states 2 bits x n     sensor i: bits 2(i mod 4) and up of byte i div 4
//!                                                          0 ok, 1 no data, 2 magnet weak, 3 outlier
//!                                                          unused bits of the last byte are 0
//! 0x85 <  rate set                0  rate_millihertz u32   granted: the nearest to the one asked for
//! 0x86 <  acknowledge             0  request u8            type of the request now done: start, stop, blink
//! 0x87 <  pong                    0  token u64             as in the ping
//!                                 8  received_micros u64   device clock when the ping's last byte had come
//!                                16  sent_micros u64       device clock when this frame's first byte goes out
//! 0x88 <  refuse                  0  request u8            type of the request that will not be done
//!                                 1  reason u8             1 unknown request, 2 malformed, 3 busy,
//!                                                          4 no such part, 5 sensor bus failed
//! ```
//!
//! A receiver ignores bytes after the fields it knows (later minor versions add some there) and skips types it does
//! not know. A known message that is too short is an error ([`ParseError::TooShort`]) and is not acted upon.

use core::fmt;

use crate::decoder::Frame;
use crate::fields::Fields;
pub use crate::fields::ParseError;
use crate::frame::{EncodeError, FrameWriter};
use crate::sample::Sample;
use crate::topology::TopologyChunk;

/// Incompatible changes of the protocol raise this number.
pub const PROTOCOL_MAJOR: u8 = 1;
/// Additions that older peers can ignore raise this number.
pub const PROTOCOL_MINOR: u8 = 0;
/// The longest product name in a hello, bytes.
pub const MAX_NAME: usize = 32;

/// The numbers of the messages: the first field of every frame.
pub mod message_type {
    /// Host: who is there?
    pub const HELLO_REQUEST: u8 = 0x01;
    /// Host: describe the tree.
    pub const TOPOLOGY_REQUEST: u8 = 0x02;
    /// Host: sample this often.
    pub const SET_RATE: u8 = 0x03;
    /// Host: send samples.
    pub const START: u8 = 0x04;
    /// Host: send no more samples.
    pub const STOP: u8 = 0x05;
    /// Host: what time is it there?
    pub const PING: u8 = 0x06;
    /// Host: show me this part.
    pub const BLINK: u8 = 0x07;
    /// Device: who it is.
    pub const HELLO: u8 = 0x81;
    /// Device: some parts of the tree.
    pub const TOPOLOGY: u8 = 0x82;
    /// Device: parts were plugged in or out.
    pub const TOPOLOGY_CHANGED: u8 = 0x83;
    /// Device: one reading of every sensor.
    pub const SAMPLE: u8 = 0x84;
    /// Device: the rate granted.
    pub const RATE_SET: u8 = 0x85;
    /// Device: done.
    pub const ACKNOWLEDGE: u8 = 0x86;
    /// Device: the time there.
    pub const PONG: u8 = 0x87;
    /// Device: will not be done.
    pub const REFUSE: u8 = 0x88;
}

/// Abilities that not every device or host has; bits not listed are 0 when sent and ignored when received.
pub mod features {
    /// The device can make a part show itself.
    pub const BLINK: u32 = 1 << 0;
    /// Parts may be plugged in and out while the device runs.
    pub const HOT_PLUG: u32 = 1 << 1;
}

/// A part's own 96-bit number, in the order of the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartUid(pub [u8; 12]);

impl fmt::Display for PartUid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// A message that can be written into a frame.
pub trait Encode {
    /// Its number in the table.
    fn message_type(&self) -> u8;
    /// Writes its fields in the order of the table.
    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError>;
}

/// What the host says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostMessage {
    /// Who is there? The device stops streaming and answers with a hello.
    HelloRequest {
        /// Protocol the host speaks.
        host_major: u8,
        /// Protocol the host speaks.
        host_minor: u8,
        /// The [`features`] the host can use.
        host_features: u32,
    },
    /// Describe the tree. The device answers with topology messages.
    TopologyRequest,
    /// Sample this often, in samples per 1,000 seconds. The device answers with the rate granted.
    SetRate {
        /// The rate wanted.
        rate_millihertz: u32,
    },
    /// Send samples. Acknowledged.
    Start,
    /// Send no more samples. Acknowledged after the last one.
    Stop,
    /// What time is it there? Answered with a pong.
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
}

impl HostMessage {
    /// The hello request of a host that speaks this version.
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
        }
        Ok(())
    }
}

/// What the device says, as read from a frame; the longer messages stay in it.
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
    /// Done.
    Acknowledge(Acknowledge),
    /// The time there.
    Pong(Pong),
    /// Will not be done.
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
    /// Protocol it speaks.
    pub protocol_major: u8,
    /// Protocol it speaks.
    pub protocol_minor: u8,
    /// The [`features`] it has.
    pub features: u32,
    /// Version of its firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Number of the part that holds the microcontroller.
    pub uid: PartUid,
    /// Fastest sampling it can keep up on this line, samples in 1,000 seconds.
    pub max_rate_millihertz: u32,
    /// Product name, at most [`MAX_NAME`] bytes.
    pub name: &'a str,
}

impl<'a> Hello<'a> {
    /// A name that is not UTF-8 is cut where it stops being so. A device of another major version is only asked for
    /// its version: its other fields may have moved.
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

/// Parts were plugged in or out; the host asks for the tree anew.
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
    /// Samples in 1,000 seconds.
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
    /// Device clock when the ping's last byte had come.
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
