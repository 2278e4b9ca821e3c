//! The tree of parts: how its records are read from and written to topology messages.

use crate::fields::{Fields, ParseError};
use crate::frame::{EncodeError, FrameWriter, MAX_PAYLOAD};
use crate::messages::{Encode, PartUid, message_type};

/// Bytes of a part's record in this version.
pub const RECORD_LENGTH: usize = 22;
/// The most parts one topology message describes.
pub const MAX_RECORDS: usize = (MAX_PAYLOAD - HEADER_LENGTH) / RECORD_LENGTH;
const HEADER_LENGTH: usize = 8;
const NO_PARENT: u16 = u16::MAX;

/// What a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartKind {
    /// One sensor, bending.
    Bend,
    /// One sensor, twisting.
    Twist,
    /// Three sensors: twist, bend, twist, from the inlet outwards.
    TwistBendTwist,
    /// No sensor, 1 to 5 outlets.
    Splitter,
    /// A kind of a later version, with its number.
    Other(u8),
}

impl PartKind {
    /// Its number on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Self::Bend => 1,
            Self::Twist => 2,
            Self::TwistBendTwist => 3,
            Self::Splitter => 4,
            Self::Other(code) => code,
        }
    }

    /// The kind with this number.
    pub const fn from_code(code: u8) -> Self {
        match code {
            1 => Self::Bend,
            2 => Self::Twist,
            3 => Self::TwistBendTwist,
            4 => Self::Splitter,
            other => Self::Other(other),
        }
    }

    /// How many sensors such a part has, where this version knows.
    pub const fn sensor_count(self) -> Option<u8> {
        match self {
            Self::Bend | Self::Twist => Some(1),
            Self::TwistBendTwist => Some(3),
            Self::Splitter => Some(0),
            Self::Other(_) => None,
        }
    }
}

/// One part of the puppet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartRecord {
    /// What it is.
    pub kind: PartKind,
    /// How many sensors it adds to a sample.
    pub sensor_count: u8,
    /// The parent's outlet it sits in, from 0; 0 for the root.
    pub outlet: u8,
    /// How many outlets it has.
    pub outlet_count: u8,
    /// Index of the part it is plugged into; `None` for the root.
    pub parent: Option<u16>,
    /// Its own number.
    pub uid: PartUid,
    /// Counts in one full turn of its sensors; 0 without sensors.
    pub counts_per_turn: u32,
}

impl PartRecord {
    fn parse(fields: &Fields<'_>) -> Result<Self, ParseError> {
        let parent = fields.u16(4)?;
        Ok(Self {
            kind: PartKind::from_code(fields.u8(0)?),
            sensor_count: fields.u8(1)?,
            outlet: fields.u8(2)?,
            outlet_count: fields.u8(3)?,
            parent: (parent != NO_PARENT).then_some(parent),
            uid: fields.uid(6)?,
            counts_per_turn: fields.u32(18)?,
        })
    }

    fn write(&self, writer: &mut FrameWriter<'_>) {
        writer.put_u8(self.kind.code());
        writer.put_u8(self.sensor_count);
        writer.put_u8(self.outlet);
        writer.put_u8(self.outlet_count);
        writer.put_u16(self.parent.unwrap_or(NO_PARENT));
        writer.put_bytes(&self.uid.0);
        writer.put_u32(self.counts_per_turn);
    }
}

/// A topology message as received: a view of its payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TopologyChunk<'a> {
    /// The tree these records belong to.
    pub epoch: u16,
    /// Parts of the whole tree.
    pub part_count: u16,
    /// Index of the first part in this message.
    pub first_index: u16,
    record_length: usize,
    records: &'a [u8],
}

impl<'a> TopologyChunk<'a> {
    pub(crate) fn parse(fields: &Fields<'a>) -> Result<Self, ParseError> {
        let (epoch, part_count, first_index) = (fields.u16(0)?, fields.u16(2)?, fields.u16(4)?);
        let (record_count, record_length) = (usize::from(fields.u8(6)?), usize::from(fields.u8(7)?));
        if record_length < RECORD_LENGTH {
            return Err(fields.bad_value("record_length", 7));
        }
        if usize::from(first_index) + record_count > usize::from(part_count) {
            return Err(fields.bad_value("record_count", 6));
        }
        let records = fields.bytes(HEADER_LENGTH, record_count * record_length)?;
        Ok(Self { epoch, part_count, first_index, record_length, records })
    }

    /// How many parts this message describes.
    pub fn len(&self) -> usize {
        self.records.len() / self.record_length
    }

    /// Whether it describes none, as for a puppet without parts.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// The parts, the one with `first_index` first.
    pub fn records(&self) -> impl Iterator<Item = PartRecord> + 'a {
        let records = self.records.chunks_exact(self.record_length);
        records.filter_map(|record| PartRecord::parse(&Fields::new(message_type::TOPOLOGY, record)).ok())
    }
}

/// A topology message to send: some parts of a tree.
#[derive(Clone, Copy, Debug)]
pub struct TopologyMessage<'a> {
    /// The tree's epoch.
    pub epoch: u16,
    /// Parts of the whole tree.
    pub part_count: u16,
    /// Index of the first part in this message.
    pub first_index: u16,
    /// The parts, at most [`MAX_RECORDS`].
    pub records: &'a [PartRecord],
}

impl Encode for TopologyMessage<'_> {
    fn message_type(&self) -> u8 {
        message_type::TOPOLOGY
    }

    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
        if self.records.len() > MAX_RECORDS {
            return Err(EncodeError::PayloadTooLong);
        }
        if usize::from(self.first_index) + self.records.len() > usize::from(self.part_count) {
            return Err(EncodeError::Inconsistent);
        }
        writer.put_u16(self.epoch);
        writer.put_u16(self.part_count);
        writer.put_u16(self.first_index);
        writer.put_u8(self.records.len() as u8);
        writer.put_u8(RECORD_LENGTH as u8);
        self.records.iter().for_each(|record| record.write(writer));
        Ok(())
    }
}

/// The messages that describe a whole tree, in order; one without records for a tree without parts.
///
/// Parts beyond the 65,534 that indices can name are left out.
pub fn topology_messages(epoch: u16, parts: &[PartRecord]) -> impl Iterator<Item = TopologyMessage<'_>> {
    let parts = &parts[..parts.len().min(usize::from(NO_PARENT) - 1)];
    let part_count = parts.len() as u16;
    let nothing = parts.is_empty().then_some(TopologyMessage { epoch, part_count, first_index: 0, records: &[] });
    let chunks = parts.chunks(MAX_RECORDS).enumerate().map(move |(chunk, records)| TopologyMessage {
        epoch,
        part_count,
        first_index: (chunk * MAX_RECORDS) as u16,
        records,
    });
    nothing.into_iter().chain(chunks)
}
