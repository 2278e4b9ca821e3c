#![no_std]
#![forbid(unsafe_code)]
//! The wire contract between a puppet and its host.

mod checksum;
mod decoder;
mod fields;
mod frame;
pub mod messages;
mod sample;
mod topology;

pub use decoder::{Decoder, DecoderCounters, Frame};
pub use frame::{EncodeError, FrameBuffer, FrameWriter, MAX_FRAME, MAX_PAYLOAD, MIN_FRAME, encode_into, frame_length};
pub use messages::{
    Acknowledge, DeviceMessage, Encode, Hello, HostMessage, MAX_NAME, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParseError,
    PartUid, Pong, RateSet, RefusalReason, Refuse, TopologyChanged, features, message_type,
};
pub use sample::{MAX_SENSORS, Sample, SampleMessage, SensorState, sample_payload_length};
pub use topology::{
    MAX_RECORDS, PartKind, PartRecord, RECORD_LENGTH, TopologyChunk, TopologyMessage, topology_messages,
};
