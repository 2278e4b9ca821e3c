//! From bytes, in portions of any size, to frames.

use super::checksum::checksum;
use super::frame::{
    AROUND_STUFFED, CHECKSUM_BYTES, LENGTH_BYTES, MAX_FRAME, MIN_FRAME, checksum_on_wire, length_on_wire,
};

/// A frame that passed every check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Frame<'a> {
    /// What the payload means; see [`message_type`](crate::message_type).
    pub message_type: u8,
    /// The message's fields.
    pub payload: &'a [u8],
}

/// What a decoder has seen so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DecoderCounters {
    /// Frames that passed every check.
    pub frames: u64,
    /// Pieces of the right length whose checksum was wrong.
    pub checksum_errors: u64,
    /// Pieces that are not frames: too short, too long, wrong length, wrong stuffing.
    pub framing_errors: u64,
    /// Bytes of all rejected pieces, including their delimiters.
    pub bytes_discarded: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rejection {
    Checksum,
    Framing,
}

/// Takes bytes in portions of any size and finds the frames in them.
///
/// A frame that is complete within one portion is unstuffed straight from it (one copy); a frame cut by the end of a
/// portion is kept until the rest arrives. Any bytes may be fed in: they never cause a panic, and anything that is not
/// a frame is counted and skipped up to the next delimiter.
///
/// `CAPACITY` is the longest accepted frame, in bytes on the wire with the delimiter; longer ones are counted as
/// framing errors. The default accepts every frame of the protocol and occupies 2 KiB; for a device, which only
/// receives short requests, `Decoder::<64>::with_capacity()` is enough.
///
/// ```
/// use firmware_protocol::{Decoder, FrameBuffer, HostMessage};
///
/// let mut wire = FrameBuffer::new();
/// let mut bytes = wire.encode(&HostMessage::Start)?;
/// let mut decoder = Decoder::new();
/// while let Some(frame) = decoder.next_frame(&mut bytes) {
///     assert_eq!(HostMessage::parse(frame), Ok(HostMessage::Start));
/// }
/// # Ok::<(), firmware_protocol::EncodeError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Decoder<const CAPACITY: usize = MAX_FRAME> {
    /// The beginning of a frame whose end has not arrived yet.
    partial: [u8; CAPACITY],
    partial_length: usize,
    /// Bytes of the current piece beyond what `partial` holds; if there are any, the piece is not a frame.
    overflow: u64,
    /// Whether a delimiter has been seen: a first piece without one before it may be the tail of a frame and is no
    /// error.
    synchronised: bool,
    unstuffed: [u8; CAPACITY],
    counters: DecoderCounters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// A decoder for every frame of the protocol.
    pub const fn new() -> Self {
        Self::with_capacity()
    }
}

impl<const CAPACITY: usize> Decoder<CAPACITY> {
    /// A decoder for frames of at most `CAPACITY` bytes on the wire.
    pub const fn with_capacity() -> Self {
        Self {
            partial: [0; CAPACITY],
            partial_length: 0,
            overflow: 0,
            synchronised: false,
            unstuffed: [0; CAPACITY],
            counters: DecoderCounters { frames: 0, checksum_errors: 0, framing_errors: 0, bytes_discarded: 0 },
        }
    }

    /// What has been seen so far.
    pub const fn counters(&self) -> DecoderCounters {
        self.counters
    }

    /// Discards a partly received frame, as after a reconnect; the counters stay.
    pub fn reset(&mut self) {
        self.partial_length = 0;
        self.overflow = 0;
        self.synchronised = false;
    }

    /// The next frame in `input`, which is advanced past the bytes used; `None` when `input` is used up.
    pub fn next_frame<'a>(&'a mut self, input: &mut &[u8]) -> Option<Frame<'a>> {
        let length = self.advance(input)?;
        let (&message_type, payload) = self.unstuffed.get(..length)?.split_first()?;
        Some(Frame { message_type, payload })
    }

    /// Advances to the end of the next good frame and returns how many bytes of it are in `unstuffed`.
    fn advance(&mut self, input: &mut &[u8]) -> Option<usize> {
        loop {
            let Some(end) = memchr::memchr(0, input) else {
                self.keep(input);
                *input = &[];
                return None;
            };
            let piece = &input[..end];
            *input = &input[end + 1..];
            let after_delimiter = core::mem::replace(&mut self.synchronised, true);
            let (outcome, piece_length) = if self.partial_length == 0 && self.overflow == 0 {
                if piece.is_empty() {
                    continue;
                }
                (unframe(piece, &mut self.unstuffed), piece.len() as u64)
            } else {
                self.keep(piece);
                let kept = self.partial_length;
                let overflow = core::mem::take(&mut self.overflow);
                self.partial_length = 0;
                let outcome = if overflow == 0 {
                    unframe(&self.partial[..kept], &mut self.unstuffed)
                } else {
                    Err(Rejection::Framing)
                };
                (outcome, kept as u64 + overflow)
            };
            match outcome {
                Ok(length) => {
                    self.counters.frames += 1;
                    return Some(length);
                }
                Err(rejection) => self.reject(rejection, piece_length + 1, after_delimiter),
            }
        }
    }

    fn keep(&mut self, bytes: &[u8]) {
        let room = CAPACITY - self.partial_length;
        let kept = bytes.len().min(room);
        self.partial[self.partial_length..self.partial_length + kept].copy_from_slice(&bytes[..kept]);
        self.partial_length += kept;
        self.overflow += (bytes.len() - kept) as u64;
    }

    fn reject(&mut self, rejection: Rejection, bytes: u64, after_delimiter: bool) {
        self.counters.bytes_discarded += bytes;
        match rejection {
            _ if !after_delimiter => {}
            Rejection::Checksum => self.counters.checksum_errors += 1,
            Rejection::Framing => self.counters.framing_errors += 1,
        }
    }
}

/// Checks a piece between two delimiters and unstuffs it; returns the length of message type and payload.
fn unframe(piece: &[u8], output: &mut [u8]) -> Result<usize, Rejection> {
    if piece.len() + 1 < MIN_FRAME || piece.len() + 1 > MAX_FRAME {
        return Err(Rejection::Framing);
    }
    let length = length_on_wire(piece.len() - AROUND_STUFFED);
    let (covered, sum) = piece.split_at(piece.len() - CHECKSUM_BYTES);
    let (front, stuffed_and_rear) = covered.split_at(LENGTH_BYTES);
    let (stuffed, rear) = stuffed_and_rear.split_at(stuffed_and_rear.len() - LENGTH_BYTES);
    if front != length || rear != length {
        return Err(Rejection::Framing);
    }
    if sum != checksum_on_wire(checksum(covered)) {
        return Err(Rejection::Checksum);
    }
    unstuff(stuffed, output).ok_or(Rejection::Framing)
}

/// Undoes the stuffing; `None` if it is invalid. The redundant empty run that some encoders write after a last full run
/// is accepted: the lengths at both ends of the frame already settle where it stops.
pub(super) fn unstuff(stuffed: &[u8], output: &mut [u8]) -> Option<usize> {
    let mut rest = stuffed;
    let mut length = 0;
    while let Some((&code, tail)) = rest.split_first() {
        let run = usize::from(code).checked_sub(1)?;
        if run > 0 {
            output.get_mut(length..length + run)?.copy_from_slice(tail.get(..run)?);
            length += run;
        }
        rest = &tail[run..];
        if code != u8::MAX && !rest.is_empty() {
            *output.get_mut(length)? = 0;
            length += 1;
        }
    }
    (length > 0).then_some(length)
}
