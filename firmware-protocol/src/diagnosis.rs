//! Why a piece of the stream is no frame: for those who build a device, and for `armature devices --decode`.

use core::fmt;

use crate::checksum::checksum;
use crate::decoder::unstuff;
use crate::frame::{
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
    /// A length is not that of the piece.
    Length {
        /// Which of the two.
        end: FrameEnd,
        /// Where it stands in the piece.
        offset: usize,
        /// As it stands there.
        found: [u8; LENGTH_BYTES],
        /// As it has to be for a piece of this length.
        expected: [u8; LENGTH_BYTES],
    },
    /// The checksum does not hold.
    Checksum {
        /// Where it stands in the piece.
        offset: usize,
        /// As it stands there.
        found: [u8; CHECKSUM_BYTES],
        /// As it has to be.
        expected: [u8; CHECKSUM_BYTES],
        /// The same as a number.
        sum: u32,
    },
    /// A code byte of the stuffing promises more bytes than there are.
    Stuffing {
        /// Where the code byte stands in the piece.
        offset: usize,
        /// The code byte.
        code: u8,
        /// Bytes behind it that could belong to its run.
        left: usize,
    },
}

/// One of the two ends of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameEnd {
    /// Before the stuffed part.
    Front,
    /// Behind it.
    Rear,
}

/// Checks a piece between two delimiters as the [`Decoder`](crate::Decoder) does, and says which rule it breaks first;
/// `None` if it is a frame.
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
    // A single empty run holds not even a message type.
    Some(FrameFault::Stuffing { offset: LENGTH_BYTES, code: stuffed.first().copied().unwrap_or(0), left: 0 })
}

/// Bytes as two digits each.
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
                "{length} bytes between two delimiters are no frame, which has {} at least: a frame cut off, or a zero \
                 byte that was not stuffed",
                MIN_FRAME - 1
            ),
            Self::TooLong { length } => write!(
                f,
                "{length} bytes between two delimiters are no frame, which has {} at most: the delimiter 00 behind a \
                 frame is missing",
                MAX_FRAME - 1
            ),
            Self::Length { end, offset, found, expected } => write_length(f, end, offset, found, expected),
            Self::Checksum { offset, found, expected, sum } => write!(
                f,
                "the checksum at byte {offset} is {}, and {} (0x{sum:08x}) over the {offset} bytes before it: a damaged \
                 byte, or a CRC of other settings or over other bytes (CRC-32/ISO-HDLC over the bytes as they stand on \
                 the wire, both lengths included)",
                Hex(&found),
                Hex(&expected)
            ),
            Self::Stuffing { offset, code, left } => write!(
                f,
                "the stuffing is broken at byte {offset}: code {code:02x} stands for {} bytes and {left} are left",
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
    write!(f, "the {place} length, at byte {offset}, is {}, and ", Hex(&found))?;
    if found.iter().any(|byte| byte & 0x80 == 0) {
        return write!(f, "has to be {}: each of its bytes has its top bit set", Hex(&expected));
    }
    let (says, is) = (value(found), value(expected));
    write!(f, "so says {says} bytes of stuffed part; there are {is} ({}): ", Hex(&expected))?;
    if says == is {
        return write!(f, "the low seven bits come first");
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

    use super::*;
    use crate::{Decoder, FrameBuffer, HostMessage};

    fn frame() -> Vec<u8> {
        let mut buffer = FrameBuffer::new();
        let bytes = buffer.encode(&HostMessage::SetRate { rate_millihertz: 1_000_000 }).expect("fits");
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
        assert!(swapped.to_string().contains("so says"), "{swapped}");
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
