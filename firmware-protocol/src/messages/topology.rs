//! The tree of parts: reading and writing its records in topology messages.

use super::fields::{Fields, ParseError};
use super::numbers::message_type;
use super::part::{PartKind, PartUid};
use crate::framing::{Encode, EncodeError, FrameWriter, MAX_PAYLOAD};

/// Bytes of a part's record in this version.
pub const RECORD_LENGTH: usize = 22;
/// The most parts one topology message describes.
pub const MAX_RECORDS: usize = (MAX_PAYLOAD - HEADER_LENGTH) / RECORD_LENGTH;
const HEADER_LENGTH: usize = 8;
const NO_PARENT: u16 = u16::MAX;

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
    /// Its unique number.
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
    pub(super) fn parse(fields: &Fields<'a>) -> Result<Self, ParseError> {
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

/// The messages that describe a whole tree, in order; one message without records for an empty tree.
///
/// Parts beyond the 65,534 that an index can address are omitted.
///
/// ```
/// use firmware_protocol::{DeviceMessage, FrameBuffer, Decoder, PartKind, PartRecord, PartUid, topology_messages};
///
/// let root = PartRecord {
///     kind: PartKind::Bend,
///     sensor_count: 1,
///     outlet: 0,
///     outlet_count: 1,
///     parent: None,
///     uid: PartUid(*b"first part  "),
///     counts_per_turn: 16_384,
/// };
/// let (mut wire, mut decoder) = (FrameBuffer::new(), Decoder::new());
/// for message in topology_messages(7, &[root]) {
///     let mut bytes = wire.encode(&message)?;
///     let frame = decoder.next_frame(&mut bytes).expect("one frame");
///     let Ok(DeviceMessage::Topology(chunk)) = DeviceMessage::parse(frame) else { panic!("a topology") };
///     assert_eq!((chunk.epoch, chunk.records().next()), (7, Some(root)));
/// }
/// # Ok::<(), firmware_protocol::EncodeError>(())
/// ```
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
