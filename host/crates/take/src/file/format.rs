//! The numbers of the format.

/// First bytes of every take. The first one is not ASCII and the end has both line endings, so a take damaged by a
/// text-mode transfer is not mistaken for a valid one.
pub const MAGIC: [u8; 8] = *b"\x8aTAKE\r\n\n";

/// Readers refuse a take with another major version.
pub const MAJOR_VERSION: u16 = 1;

/// A higher minor version only adds record types and appends fields to payloads.
pub const MINOR_VERSION: u16 = 3;

/// Magic, major, minor and their checksum.
pub const PREAMBLE_BYTES: usize = 16;

/// Type and length.
pub(super) const RECORD_HEAD_BYTES: usize = 6;

/// The size of a record beyond its payload.
pub const RECORD_OVERHEAD_BYTES: usize = RECORD_HEAD_BYTES + 4;

/// The largest payload; a length beyond it is damage.
pub const MAX_PAYLOAD_BYTES: usize = 64 << 20;

/// Most parts in a topology record; far beyond any puppet, and few enough to be checked in no time.
pub const MAX_PARTS: usize = 4096;
