//! The container: preamble, records, checksums, and finding the next whole record after damage.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

use crate::RecordKind;

/// First bytes of every take. The first one is not ASCII and the end has both line endings, so a take
/// that went through a text-mode transfer is not mistaken for one.
pub const MAGIC: [u8; 8] = *b"\x8aTAKE\r\n\n";

/// Readers refuse a take with another major version.
pub const MAJOR_VERSION: u16 = 1;

/// A higher minor version only adds record types and appends fields to payloads.
pub const MINOR_VERSION: u16 = 1;

/// Magic, major, minor and their checksum.
pub const PREAMBLE_BYTES: usize = 16;

/// Type and length.
pub(crate) const RECORD_HEAD_BYTES: usize = 6;

/// What a record costs on top of its payload.
pub const RECORD_OVERHEAD_BYTES: usize = RECORD_HEAD_BYTES + 4;

/// The largest payload; a length beyond it is damage.
pub const MAX_PAYLOAD_BYTES: usize = 64 << 20;

static CRC_32: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// `minor`: the lowest version that a reader needs to understand all of the take.
pub(crate) fn preamble(minor: u16) -> [u8; PREAMBLE_BYTES] {
    let mut bytes = [0; PREAMBLE_BYTES];
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..10].copy_from_slice(&MAJOR_VERSION.to_le_bytes());
    bytes[10..12].copy_from_slice(&minor.to_le_bytes());
    let crc = CRC_32.checksum(&bytes[..12]);
    bytes[12..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// Major and minor version, or `None` when the preamble's own checksum does not hold.
pub(crate) fn versions(preamble: &[u8; PREAMBLE_BYTES]) -> Option<(u16, u16)> {
    let [.., a, b, c, d, e, f, g, h] = *preamble;
    let holds = CRC_32.checksum(&preamble[..12]) == u32::from_le_bytes([e, f, g, h]);
    holds.then(|| (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])))
}

/// Writes length and checksum of the record that fills `record`, whose type and payload are already there.
pub(crate) fn seal(record: &mut Vec<u8>) -> Result<(), u64> {
    let payload = record.len().saturating_sub(RECORD_HEAD_BYTES);
    if payload > MAX_PAYLOAD_BYTES {
        return Err(payload as u64);
    }
    record[2..RECORD_HEAD_BYTES].copy_from_slice(&(payload as u32).to_le_bytes());
    let crc = CRC_32.checksum(record);
    record.extend_from_slice(&crc.to_le_bytes());
    Ok(())
}

/// A record whose checksum holds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RawRecord<'a> {
    pub(crate) kind: u16,
    pub(crate) payload: &'a [u8],
}

/// What stands at a place in the file.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Found<'a> {
    Record { record: RawRecord<'a>, end: usize },
    Damage(Damage),
}

/// Bytes that are no record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Damage {
    /// First byte after the damage: a whole record, or the end of the file.
    pub(crate) end: usize,
    /// The type the damaged record claims, where enough of it is left.
    pub(crate) kind: Option<u16>,
    /// The file ends inside the record.
    pub(crate) truncated: bool,
    /// The search for the next whole record was given up: too many false starts.
    pub(crate) given_up: bool,
}

/// Walks over the records of a file in time proportional to its length, whatever it holds.
#[derive(Debug)]
pub(crate) struct Scanner<'a> {
    bytes: &'a [u8],
    /// Bytes that may still be checksummed in vain. Without this bound a file made for it would cost
    /// quadratic time.
    vain_bytes_left: usize,
}

impl<'a> Scanner<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, vain_bytes_left: bytes.len().saturating_mul(8).saturating_add(1 << 20) }
    }

    /// What stands at `offset`, which has to lie inside the file.
    pub(crate) fn at(&mut self, offset: usize) -> Found<'a> {
        if let Some((record, end)) = self.whole_record(offset) {
            return Found::Record { record, end };
        }
        let claimed = head(self.bytes, offset);
        let claimed_end = claimed.and_then(|(_, length)| record_end(offset, length));
        let truncated = claimed_end.is_none_or(|end| end > self.bytes.len());
        let kind = claimed.map(|(kind, _)| kind);
        let framing_holds = claimed_end.filter(|&end| end < self.bytes.len() && self.whole_record(end).is_some());
        let end = framing_holds.or_else(|| self.next_record(offset + 1));
        let given_up = end.is_none() && self.vain_bytes_left == 0;
        Found::Damage(Damage {
            end: end.unwrap_or(self.bytes.len()),
            kind,
            truncated: end.is_none() && truncated && !given_up,
            given_up,
        })
    }

    fn whole_record(&mut self, offset: usize) -> Option<(RawRecord<'a>, usize)> {
        let (kind, length) = head(self.bytes, offset)?;
        let end = record_end(offset, length).filter(|&end| end <= self.bytes.len())?;
        let (content, crc) = self.bytes[offset..end].split_last_chunk::<4>()?;
        if content.len() > self.vain_bytes_left {
            self.vain_bytes_left = 0;
            return None;
        }
        if CRC_32.checksum(content) != u32::from_le_bytes(*crc) {
            self.vain_bytes_left -= content.len();
            return None;
        }
        Some((RawRecord { kind, payload: &content[RECORD_HEAD_BYTES..] }, end))
    }

    /// Start of the first whole record of a known type at or after `from`.
    fn next_record(&mut self, from: usize) -> Option<usize> {
        let last = self.bytes.len().checked_sub(RECORD_OVERHEAD_BYTES)?;
        for offset in from..=last {
            if self.vain_bytes_left == 0 {
                return None;
            }
            let plausible = head(self.bytes, offset).is_some_and(|(kind, length)| {
                RecordKind::from_code(kind).is_some_and(|kind| length <= kind.plausible_payload_bytes())
            });
            if plausible && self.whole_record(offset).is_some() {
                return Some(offset);
            }
        }
        None
    }
}

/// Type and length that stand at `offset`.
fn head(bytes: &[u8], offset: usize) -> Option<(u16, usize)> {
    let [a, b, c, d, e, f] = *bytes.get(offset..)?.first_chunk::<RECORD_HEAD_BYTES>()?;
    Some((u16::from_le_bytes([a, b]), u32::from_le_bytes([c, d, e, f]) as usize))
}

/// First byte after a record, unless its length is one no writer produces.
fn record_end(offset: usize, length: usize) -> Option<usize> {
    (length <= MAX_PAYLOAD_BYTES).then(|| offset + RECORD_OVERHEAD_BYTES + length)
}
