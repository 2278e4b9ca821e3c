//! From a message to the bytes of its frame. The layout is in the [crate documentation](crate#frames).

use super::checksum::checksum;

/// The longest payload a frame may carry, bytes.
pub const MAX_PAYLOAD: usize = 1024;
/// Bytes of the length at either end of a frame.
pub(super) const LENGTH_BYTES: usize = 2;
/// Bytes of the checksum on the wire.
pub(super) const CHECKSUM_BYTES: usize = 5;
/// Bytes before and after the stuffed part, without the delimiter.
pub(super) const AROUND_STUFFED: usize = 2 * LENGTH_BYTES + CHECKSUM_BYTES;
/// The longest run of bytes after one code byte.
pub(super) const MAX_RUN: usize = 254;
/// The longest frame on the wire, including its delimiter, bytes.
pub const MAX_FRAME: usize = frame_length(MAX_PAYLOAD);
/// The shortest frame on the wire, including its delimiter, bytes.
pub const MIN_FRAME: usize = frame_length(0);

/// The most bytes a frame with a payload of this length takes on the wire, including its delimiter.
///
/// The count is exact for payloads of fewer than 254 bytes; longer ones may save a code byte or two where zeros end the
/// runs early.
pub const fn frame_length(payload_length: usize) -> usize {
    let raw = 1 + payload_length;
    AROUND_STUFFED + raw + raw.div_ceil(MAX_RUN) + 1
}

/// Why a message could not be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EncodeError {
    /// The caller's buffer is shorter than the frame; [`frame_length`] gives the length it needs.
    BufferTooSmall,
    /// The payload would be longer than [`MAX_PAYLOAD`].
    PayloadTooLong,
    /// The message contradicts itself, such as a sample with fewer states than counts.
    Inconsistent,
}

impl core::fmt::Display for EncodeError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::BufferTooSmall => "the frame does not fit in the buffer, which needs frame_length(payload) bytes",
            Self::PayloadTooLong => "the payload is longer than 1024 bytes; split it into several messages",
            Self::Inconsistent => "the lists in the message have lengths that do not match",
        })
    }
}

impl core::error::Error for EncodeError {}

/// A message that can be written into a frame.
pub trait Encode {
    /// Its number in the table.
    fn message_type(&self) -> u8;
    /// Writes its fields in the order of the table.
    fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError>;
}

/// Writes a message as one frame, including the delimiter, and returns how many bytes that took.
pub fn encode_into(message: &(impl Encode + ?Sized), buffer: &mut [u8]) -> Result<usize, EncodeError> {
    let mut writer = FrameWriter::new(buffer, message.message_type());
    message.write_payload(&mut writer)?;
    writer.finish()
}

/// A buffer for one frame, for senders without a heap.
#[derive(Clone, Debug)]
pub struct FrameBuffer {
    bytes: [u8; MAX_FRAME],
}

impl Default for FrameBuffer {
    fn default() -> Self {
        Self::new()
    }
}

impl FrameBuffer {
    /// An empty buffer.
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_FRAME] }
    }

    /// Writes a message and returns its frame, ready to send.
    pub fn encode(&mut self, message: &(impl Encode + ?Sized)) -> Result<&[u8], EncodeError> {
        let length = encode_into(message, &mut self.bytes)?;
        Ok(&self.bytes[..length])
    }
}

/// Stuffs the bytes of one message straight into the wire buffer.
///
/// Errors are kept until [`finish`](Self::finish), so that messages can be written without a check at every field.
#[derive(Debug)]
pub struct FrameWriter<'a> {
    buffer: &'a mut [u8],
    /// Where the next byte goes.
    end: usize,
    /// Where the code byte of the open run goes.
    code_at: usize,
    /// Whether the open run follows a full one; if so, it is omitted when nothing more comes.
    follows_full_run: bool,
    /// Message type and payload, before stuffing.
    raw_length: usize,
}

impl<'a> FrameWriter<'a> {
    /// Begins a frame of this message type.
    pub fn new(buffer: &'a mut [u8], message_type: u8) -> Self {
        let code_at = LENGTH_BYTES;
        let mut writer = Self { buffer, end: code_at + 1, code_at, follows_full_run: false, raw_length: 0 };
        writer.put_u8(message_type);
        writer
    }

    /// One byte.
    pub fn put_u8(&mut self, byte: u8) {
        self.raw_length += 1;
        if byte == 0 {
            self.close_run();
            self.follows_full_run = false;
        } else {
            if let Some(place) = self.buffer.get_mut(self.end) {
                *place = byte;
            }
            self.end += 1;
            self.close_full_run();
        }
    }

    /// Two bytes, low byte first.
    pub fn put_u16(&mut self, value: u16) {
        value.to_le_bytes().into_iter().for_each(|byte| self.put_u8(byte));
    }

    /// Four bytes, lowest first.
    pub fn put_u32(&mut self, value: u32) {
        self.put_bytes(&value.to_le_bytes());
    }

    /// Eight bytes, lowest first.
    pub fn put_u64(&mut self, value: u64) {
        self.put_bytes(&value.to_le_bytes());
    }

    /// These bytes as they are.
    pub fn put_bytes(&mut self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            let room = MAX_RUN + 1 - (self.end - self.code_at);
            let window = &bytes[..bytes.len().min(room)];
            let run = memchr::memchr(0, window).unwrap_or(window.len());
            if let Some(place) = self.buffer.get_mut(self.end..self.end + run) {
                place.copy_from_slice(&bytes[..run]);
            }
            self.raw_length += run;
            self.end += run;
            self.close_full_run();
            bytes = &bytes[run..];
            if run < window.len() {
                self.put_u8(0);
                bytes = &bytes[1..];
            }
        }
    }

    /// Closes the frame: lengths, checksum, delimiter. Returns the frame's length on the wire.
    pub fn finish(mut self) -> Result<usize, EncodeError> {
        if self.raw_length > 1 + MAX_PAYLOAD {
            return Err(EncodeError::PayloadTooLong);
        }
        let opened_for_nothing = self.follows_full_run && self.end == self.code_at + 1;
        if opened_for_nothing {
            self.end = self.code_at;
        } else {
            self.close_run();
            self.end -= 1;
        }
        let stuffed_end = self.end;
        let frame_end = stuffed_end + LENGTH_BYTES + CHECKSUM_BYTES + 1;
        let Some(frame) = self.buffer.get_mut(..frame_end) else {
            return Err(EncodeError::BufferTooSmall);
        };
        let length = length_on_wire(stuffed_end - LENGTH_BYTES);
        frame[..LENGTH_BYTES].copy_from_slice(&length);
        let checksum_at = stuffed_end + LENGTH_BYTES;
        frame[stuffed_end..checksum_at].copy_from_slice(&length);
        let sum = checksum_on_wire(checksum(&frame[..checksum_at]));
        frame[checksum_at..checksum_at + CHECKSUM_BYTES].copy_from_slice(&sum);
        frame[frame_end - 1] = 0;
        Ok(frame_end)
    }

    fn close_full_run(&mut self) {
        if self.end - self.code_at > MAX_RUN {
            self.close_run();
            self.follows_full_run = true;
        }
    }

    fn close_run(&mut self) {
        if let Some(place) = self.buffer.get_mut(self.code_at) {
            *place = (self.end - self.code_at) as u8;
        }
        self.code_at = self.end;
        self.end += 1;
    }
}

/// The length of the stuffed part as sent: 7 bits a byte, the low ones first, the top bit set.
pub(super) const fn length_on_wire(stuffed_length: usize) -> [u8; LENGTH_BYTES] {
    [0x80 | (stuffed_length & 0x7F) as u8, 0x80 | ((stuffed_length >> 7) & 0x7F) as u8]
}

/// A checksum as sent: 7 bits a byte, the low ones first, the top bit set.
pub(super) const fn checksum_on_wire(sum: u32) -> [u8; CHECKSUM_BYTES] {
    [
        0x80 | (sum & 0x7F) as u8,
        0x80 | ((sum >> 7) & 0x7F) as u8,
        0x80 | ((sum >> 14) & 0x7F) as u8,
        0x80 | ((sum >> 21) & 0x7F) as u8,
        0x80 | (sum >> 28) as u8,
    ]
}
