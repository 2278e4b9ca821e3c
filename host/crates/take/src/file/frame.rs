//! The container: preamble, records, checksums, and finding the next whole record after damage.

use crc::{CRC_32_ISO_HDLC, Crc, Table};

use super::format::{
    MAGIC, MAJOR_VERSION, MAX_PAYLOAD_BYTES, PREAMBLE_BYTES, RECORD_HEAD_BYTES, RECORD_OVERHEAD_BYTES,
};
use super::record_kind::RecordKind;

static CRC_32: Crc<u32, Table<16>> = Crc::<u32, Table<16>>::new(&CRC_32_ISO_HDLC);

/// `minor`: the lowest version that a reader needs to understand all of the take.
pub(super) fn preamble(minor: u16) -> [u8; PREAMBLE_BYTES] {
    let mut bytes = [0; PREAMBLE_BYTES];
    bytes[..8].copy_from_slice(&MAGIC);
    bytes[8..10].copy_from_slice(&MAJOR_VERSION.to_le_bytes());
    bytes[10..12].copy_from_slice(&minor.to_le_bytes());
    let crc = CRC_32.checksum(&bytes[..12]);
    bytes[12..].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// Major and minor version, or `None` if the preamble's own checksum does not match.
pub(super) fn versions(preamble: &[u8; PREAMBLE_BYTES]) -> Option<(u16, u16)> {
    let [.., a, b, c, d, e, f, g, h] = *preamble;
    let holds = CRC_32.checksum(&preamble[..12]) == u32::from_le_bytes([e, f, g, h]);
    holds.then(|| (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d])))
}

/// Fills in length and checksum of the record in `record`, whose type and payload are already there.
pub(super) fn seal(record: &mut Vec<u8>) -> Result<(), u64> {
    let payload = record.len().saturating_sub(RECORD_HEAD_BYTES);
    if payload > MAX_PAYLOAD_BYTES {
        return Err(payload as u64);
    }
    record[2..RECORD_HEAD_BYTES].copy_from_slice(&(payload as u32).to_le_bytes());
    let crc = CRC_32.checksum(record);
    record.extend_from_slice(&crc.to_le_bytes());
    Ok(())
}

/// A record with a matching checksum.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawRecord<'a> {
    pub(super) kind: u16,
    pub(super) payload: &'a [u8],
}

/// What is found at an offset in the file.
#[derive(Clone, Copy, Debug)]
pub(super) enum Found<'a> {
    Record { record: RawRecord<'a>, end: usize },
    Damage(Damage),
}

/// Bytes that are not a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Damage {
    /// First byte after the damage: a whole record, or the end of the file.
    pub(super) end: usize,
    /// The type the damaged record claims, if enough of it is left.
    pub(super) kind: Option<u16>,
    /// The file ends inside the record.
    pub(super) truncated: bool,
    /// The search for the next whole record was abandoned: too many false starts.
    pub(super) given_up: bool,
}

/// Walks over the records of a file in time proportional to its length, whatever it contains.
#[derive(Debug)]
pub(super) struct Scanner<'a> {
    bytes: &'a [u8],
    /// How many more bytes may be checksummed in vain. Without this limit, a malicious file would cost quadratic time.
    vain_bytes_left: usize,
}

impl<'a> Scanner<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, vain_bytes_left: bytes.len().saturating_mul(8).saturating_add(1 << 20) }
    }

    /// What is at `offset`, which must be inside the file.
    pub(super) fn at(&mut self, offset: usize) -> Found<'a> {
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

/// Type and length at `offset`.
fn head(bytes: &[u8], offset: usize) -> Option<(u16, usize)> {
    let [a, b, c, d, e, f] = *bytes.get(offset..)?.first_chunk::<RECORD_HEAD_BYTES>()?;
    Some((u16::from_le_bytes([a, b]), u32::from_le_bytes([c, d, e, f]) as usize))
}

/// First byte after a record, unless its length is one that no writer produces.
fn record_end(offset: usize, length: usize) -> Option<usize> {
    (length <= MAX_PAYLOAD_BYTES).then(|| offset + RECORD_OVERHEAD_BYTES + length)
}
