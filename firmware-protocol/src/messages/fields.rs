//! Reading a payload's fields at their offsets.

use super::part::PartUid;

/// Why the payload of a frame is not a valid message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParseError {
    /// A type this version does not know: skip it and count it.
    UnknownType(u8),
    /// A known message whose payload ends before its fields do.
    TooShort {
        /// The message's type.
        message_type: u8,
        /// Bytes its fields take, as far as known.
        needed: usize,
        /// Bytes there are.
        found: usize,
    },
    /// A known message with an impossible value.
    BadValue {
        /// The message's type.
        message_type: u8,
        /// The field, by its name in the table.
        field: &'static str,
        /// Offset of the field in the payload, bytes.
        offset: usize,
    },
}

impl core::fmt::Display for ParseError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match *self {
            Self::UnknownType(message_type) => write!(f, "message type 0x{message_type:02x} is unknown here"),
            Self::TooShort { message_type, needed, found } => {
                write!(f, "message 0x{message_type:02x} needs {needed} bytes of payload but has {found}")
            }
            Self::BadValue { message_type, field, offset } => {
                write!(f, "message 0x{message_type:02x} has an impossible {field} at byte {offset} of its payload")
            }
        }
    }
}

impl core::error::Error for ParseError {}

/// The fields of one payload. Construct it with the number of bytes they take; every read then stays in bounds.
#[derive(Clone, Copy)]
pub(super) struct Fields<'a> {
    message_type: u8,
    payload: &'a [u8],
}

impl<'a> Fields<'a> {
    pub(super) const fn new(message_type: u8, payload: &'a [u8]) -> Self {
        Self { message_type, payload }
    }

    /// The `N` bytes from `offset` on.
    pub(super) fn array<const N: usize>(&self, offset: usize) -> Result<[u8; N], ParseError> {
        self.bytes(offset, N)?.try_into().map_err(|_| self.too_short(offset + N))
    }

    pub(super) fn bytes(&self, offset: usize, length: usize) -> Result<&'a [u8], ParseError> {
        self.payload.get(offset..offset + length).ok_or_else(|| self.too_short(offset + length))
    }

    pub(super) fn u8(&self, offset: usize) -> Result<u8, ParseError> {
        self.array::<1>(offset).map(|[byte]| byte)
    }

    pub(super) fn u16(&self, offset: usize) -> Result<u16, ParseError> {
        self.array(offset).map(u16::from_le_bytes)
    }

    pub(super) fn u32(&self, offset: usize) -> Result<u32, ParseError> {
        self.array(offset).map(u32::from_le_bytes)
    }

    pub(super) fn u64(&self, offset: usize) -> Result<u64, ParseError> {
        self.array(offset).map(u64::from_le_bytes)
    }

    pub(super) fn uid(&self, offset: usize) -> Result<PartUid, ParseError> {
        self.array(offset).map(PartUid)
    }

    pub(super) const fn bad_value(&self, field: &'static str, offset: usize) -> ParseError {
        ParseError::BadValue { message_type: self.message_type, field, offset }
    }

    const fn too_short(&self, needed: usize) -> ParseError {
        ParseError::TooShort { message_type: self.message_type, needed, found: self.payload.len() }
    }
}
