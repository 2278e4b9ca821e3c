//! Why a piece of the stream is not a frame: for device builders, and for `armature devices --decode`.

use core::fmt;

use super::checksum::checksum;
use super::decoder::unstuff;
use super::frame::{
    AROUND_STUFFED, CHECKSUM_BYTES, LENGTH_BYTES, MAX_FRAME, MIN_FRAME, checksum_on_wire, length_on_wire,
};

/// The first rule that a piece between two delimiters breaks, in the order in which the decoder checks them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameFault {
    /// Too short for any frame.
    TooShort {
        /// Its bytes, without the delimiter.
        length: usize,
    },
    /// Longer than any frame.
    TooLong {
        /// Its bytes, without the delimiter.
        length: usize,
    },
    /// A length does not match the piece.
    Length {
        /// Which of the two.
        end: FrameEnd,
        /// Its position in the piece.
        offset: usize,
        /// The bytes found there.
        found: [u8; LENGTH_BYTES],
        /// The bytes that a piece of this length needs.
        expected: [u8; LENGTH_BYTES],
    },
    /// The checksum does not match.
    Checksum {
        /// Its position in the piece.
        offset: usize,
        /// The bytes found there.
        found: [u8; CHECKSUM_BYTES],
        /// The bytes that would be right.
        expected: [u8; CHECKSUM_BYTES],
        /// The same as a number.
        sum: u32,
    },
    /// A code byte of the stuffing promises more bytes than there are.
    Stuffing {
        /// Position of the code byte in the piece.
        offset: usize,
        /// The code byte.
        code: u8,
        /// Bytes after it that could belong to its run.
        left: usize,
    },
}

/// One of the two ends of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameEnd {
    /// Before the stuffed part.
    Front,
    /// After it.
    Rear,
}

/// Checks a piece between two delimiters as the [`Decoder`](super::Decoder) does, and returns the first rule it breaks;
/// `None` if it is a frame.
///
/// ```
/// use firmware_protocol::{FrameBuffer, FrameFault, HostMessage, diagnose};
///
/// let mut wire = FrameBuffer::new();
/// let frame = wire.encode(&HostMessage::Start)?;
/// let piece = &frame[..frame.len() - 1];
/// assert_eq!(diagnose(piece), None);
/// assert_eq!(diagnose(&piece[..4]), Some(FrameFault::TooShort { length: 4 }));
/// # Ok::<(), firmware_protocol::EncodeError>(())
/// ```
pub fn diagnose(piece: &[u8]) -> Option<FrameFault> {
    let length = piece.len();
    if length + 1 < MIN_FRAME {
        return Some(FrameFault::TooShort { length });
    }
    if length + 1 > MAX_FRAME {
        return Some(FrameFault::TooLong { length });
    }
    let expected = length_on_wire(length - AROUND_STUFFED);
    let rear_at = length - CHECKSUM_BYTES - LENGTH_BYTES;
    for (end, offset) in [(FrameEnd::Front, 0), (FrameEnd::Rear, rear_at)] {
        let found = [piece[offset], piece[offset + 1]];
        if found != expected {
            return Some(FrameFault::Length { end, offset, found, expected });
        }
    }
    let offset = rear_at + LENGTH_BYTES;
    let sum = checksum(&piece[..offset]);
    let expected = checksum_on_wire(sum);
    let mut found = [0; CHECKSUM_BYTES];
    found.copy_from_slice(&piece[offset..]);
    if found != expected {
        return Some(FrameFault::Checksum { offset, found, expected, sum });
    }
    let stuffed = &piece[LENGTH_BYTES..rear_at];
    let mut output = [0; MAX_FRAME];
    if unstuff(stuffed, &mut output).is_some() {
        return None;
    }
    let mut at = 0;
    while let Some(&code) = stuffed.get(at) {
        let run = usize::from(code);
        if code == 0 || at + run > stuffed.len() {
            return Some(FrameFault::Stuffing { offset: LENGTH_BYTES + at, code, left: stuffed.len() - at - 1 });
        }
        at += run;
    }
    // A single empty run does not even hold a message type.
    Some(FrameFault::Stuffing { offset: LENGTH_BYTES, code: stuffed.first().copied().unwrap_or(0), left: 0 })
}

/// Bytes, two hex digits each.
struct Hex<'a>(&'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, byte) in self.0.iter().enumerate() {
            let gap = if index == 0 { "" } else { " " };
            write!(f, "{gap}{byte:02x}")?;
        }
        Ok(())
    }
}

impl fmt::Display for FrameFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { length } => write!(
                f,
                "{length} bytes between two delimiters are too few for a frame, which has at least {}: a frame was cut \
                 off, or a zero byte was not stuffed",
                MIN_FRAME - 1
            ),
            Self::TooLong { length } => write!(
                f,
                "{length} bytes between two delimiters are too many for a frame, which has at most {}: the delimiter 00 \
                 after a frame is missing",
                MAX_FRAME - 1
            ),
            Self::Length { end, offset, found, expected } => write_length(f, end, offset, found, expected),
            Self::Checksum { offset, found, expected, sum } => write!(
                f,
                "the checksum at byte {offset} is {}, but should be {} (0x{sum:08x}) over the {offset} bytes before it: \
                 a damaged byte, or a CRC with the wrong settings or over the wrong bytes (CRC-32/ISO-HDLC over the \
                 bytes as sent on the wire, both lengths included)",
                Hex(&found),
                Hex(&expected)
            ),
            Self::Stuffing { offset, code, left } => write!(
                f,
                "the stuffing is broken at byte {offset}: code {code:02x} announces {} bytes, but only {left} are left",
                code.saturating_sub(1)
            ),
        }
    }
}

fn write_length(
    f: &mut fmt::Formatter<'_>,
    end: FrameEnd,
    offset: usize,
    found: [u8; LENGTH_BYTES],
    expected: [u8; LENGTH_BYTES],
) -> fmt::Result {
    let value = |bytes: [u8; LENGTH_BYTES]| usize::from(bytes[0] & 0x7F) | usize::from(bytes[1] & 0x7F) << 7;
    let place = match end {
        FrameEnd::Front => "first",
        FrameEnd::Rear => "second",
    };
    write!(f, "the {place} length, at byte {offset}, is {}, ", Hex(&found))?;
    if found.iter().any(|byte| byte & 0x80 == 0) {
        return write!(f, "but has to be {}: each byte must have its top bit set", Hex(&expected));
    }
    let (says, is) = (value(found), value(expected));
    write!(f, "which says the stuffed part has {says} bytes; it has {is} ({}): ", Hex(&expected))?;
    if says == is {
        return write!(f, "the low seven bits must come first");
    }
    if says > is {
        write!(f, "bytes were lost, or a zero byte was not stuffed")
    } else {
        write!(f, "bytes were added, or the delimiter before it was lost")
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::string::ToString;
    use std::vec::Vec;

    use super::super::{Decoder, Encode, EncodeError, FrameBuffer, FrameWriter};
    use super::*;

    /// A message of five bytes; 1,000,000 has a zero byte among its four.
    struct SetRate;

    impl Encode for SetRate {
        fn message_type(&self) -> u8 {
            0x03
        }

        fn write_payload(&self, writer: &mut FrameWriter<'_>) -> Result<(), EncodeError> {
            writer.put_u32(1_000_000);
            Ok(())
        }
    }

    fn frame() -> Vec<u8> {
        let mut buffer = FrameBuffer::new();
        let bytes = buffer.encode(&SetRate).expect("fits");
        bytes[..bytes.len() - 1].to_vec()
    }

    fn spoilt(spoil: impl FnOnce(&mut Vec<u8>)) -> FrameFault {
        let mut piece = frame();
        spoil(&mut piece);
        diagnose(&piece).expect("it is spoilt")
    }

    fn with_checksum(piece: &mut [u8]) {
        let at = piece.len() - CHECKSUM_BYTES;
        let sum = checksum_on_wire(checksum(&piece[..at]));
        piece[at..].copy_from_slice(&sum);
    }

    #[test]
    fn each_rule_that_is_broken_is_named_with_its_place() {
        assert_eq!(diagnose(&frame()), None);
        assert_eq!(spoilt(|piece| piece.truncate(10)), FrameFault::TooShort { length: 10 });
        assert_eq!(spoilt(|piece| piece.resize(1_040, 1)), FrameFault::TooLong { length: 1_040 });
        let lost = spoilt(|piece| piece.truncate(piece.len() - 1));
        assert!(matches!(lost, FrameFault::Length { end: FrameEnd::Front, offset: 0, .. }), "{lost}");
        assert!(lost.to_string().contains("bytes were lost"), "{lost}");
        let added = spoilt(|piece| piece.insert(4, 7));
        assert!(added.to_string().contains("bytes were added"), "{added}");
        let plain = spoilt(|piece| piece[0] = 6);
        assert!(plain.to_string().contains("top bit"), "{plain}");
        let swapped = spoilt(|piece| piece.swap(0, 1));
        assert!(swapped.to_string().contains("which says"), "{swapped}");
        let rear = spoilt(|piece| piece[8] ^= 1);
        assert!(matches!(rear, FrameFault::Length { end: FrameEnd::Rear, offset: 8, .. }), "{rear}");
        let damaged = spoilt(|piece| piece[4] ^= 1);
        assert!(matches!(damaged, FrameFault::Checksum { offset: 10, .. }), "{damaged}");
        assert!(damaged.to_string().contains("CRC-32/ISO-HDLC"), "{damaged}");
        let stuffing = spoilt(|piece| {
            piece[2] = 99;
            with_checksum(piece);
        });
        assert_eq!(stuffing, FrameFault::Stuffing { offset: 2, code: 99, left: 5 });
    }

    #[test]
    fn it_agrees_with_the_decoder_on_anything() {
        let mut state = 1_u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize
        };
        for _ in 0..200_000 {
            let mut piece = frame();
            for _ in 0..next() % 3 {
                let at = next() % piece.len();
                match next() % 4 {
                    0 => piece[at] = 1 + (next() % 255) as u8,
                    1 => piece.insert(at, 1 + (next() % 255) as u8),
                    2 => {
                        piece.remove(at);
                    }
                    _ if piece.len() > CHECKSUM_BYTES => with_checksum(&mut piece),
                    _ => {}
                }
            }
            let mut decoder: Decoder = Decoder::new();
            let stream = [&[0], piece.as_slice(), &[0]].concat();
            let is_frame = decoder.next_frame(&mut stream.as_slice()).is_some();
            assert_eq!(diagnose(&piece).is_none(), is_frame, "{piece:02x?}");
        }
    }
}
