//! What the documentation promises for certain: no burst of up to 32 bits on the wire goes unnoticed, wherever it
//! falls, delimiters included; nor does any run of bytes lost from or put into one frame.
//!
//! A burst is an error pattern whose first and last wrong bits are at most 31 apart, counted in the order in which a
//! UART sends them (lowest bit of a byte first).

mod common;

use common::{Random, sample_frame};
use firmware_protocol::{Acknowledge, Decoder, FrameBuffer, HostMessage};

/// Flips `pattern` from bit `position` on.
fn strike(bytes: &mut [u8], position: usize, pattern: u32) {
    let spread = u64::from(pattern) << (position % 8);
    for (byte, error) in bytes[position / 8..].iter_mut().zip(spread.to_le_bytes()) {
        *byte ^= error;
    }
}

/// Frames found in a stream that starts and ends with a delimiter.
fn frames(stream: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let mut decoder = Decoder::new();
    let mut bytes = stream;
    let mut found = Vec::new();
    while let Some(frame) = decoder.next_frame(&mut bytes) {
        found.push((frame.message_type, frame.payload.to_vec()));
    }
    found
}

/// Three frames, short ones and a sample, with the bytes at which each begins.
fn stream_of(middle: &[u8], random: &mut Random) -> (Vec<u8>, [usize; 4]) {
    let first = FrameBuffer::new().encode(&HostMessage::Ping { token: random.next() }).expect("fits").to_vec();
    let last = FrameBuffer::new().encode(&Acknowledge { request: 4 }).expect("fits").to_vec();
    let starts = [1, 1 + first.len(), 1 + first.len() + middle.len(), 1 + first.len() + middle.len() + last.len()];
    ([&[0], first.as_slice(), middle, &last].concat(), starts)
}

/// Strikes the stream and checks that just the frames stay whose bytes (delimiter included) were not touched. The
/// delimiter in front of a frame belongs to the frame before.
fn check(stream: &[u8], starts: [usize; 4], whole: &[(u8, Vec<u8>)], position: usize, pattern: u32) {
    let mut struck = stream.to_vec();
    strike(&mut struck, position, pattern);
    let untouched: Vec<&(u8, Vec<u8>)> = (0..3)
        .filter(|&frame| struck[starts[frame]..starts[frame + 1]] == stream[starts[frame]..starts[frame + 1]])
        .map(|frame| &whole[frame])
        .collect();
    // A frame behind a destroyed delimiter may be lost with the frame before, never the other way round; what is found
    // must be found whole and in order, and a damaged frame never.
    let found = frames(&struck);
    let mut expected = untouched.iter();
    for frame in &found {
        assert!(
            expected.any(|sent| *sent == frame),
            "burst {pattern:#034b} at bit {position}: {frame:02x?} was not sent"
        );
    }
    assert!(
        found.len() + 1 >= untouched.len(),
        "burst {pattern:#034b} at bit {position} cost more than one more frame"
    );
}

#[test]
fn every_burst_of_up_to_13_bits_is_caught_at_every_position() {
    let mut random = Random(5);
    let middle = FrameBuffer::new().encode(&HostMessage::SetRate { rate_millihertz: 120_000 }).unwrap().to_vec();
    let (stream, starts) = stream_of(&middle, &mut random);
    let whole = frames(&stream);
    assert_eq!(whole.len(), 3);
    let begin = 8 * (starts[1] - 2);
    for position in begin..begin + 8 * (middle.len() + 3) {
        (0..1u32 << 12).for_each(|inner| check(&stream, starts, &whole, position, inner << 1 | 1));
    }
}

#[test]
fn bursts_of_up_to_32_bits_are_caught_at_every_position_of_a_sample() {
    let mut random = Random(6);
    let (stream, starts) = stream_of(&sample_frame(1_000, 20), &mut random);
    let whole = frames(&stream);
    for position in 8..8 * (stream.len() - 4) {
        for length in 1..=32 {
            let pattern = match length {
                1 => 1,
                _ => 1 | 1 << (length - 1) | (random.next() as u32 & ((1u64 << length) - 1) as u32),
            };
            (0..3).for_each(|shake| {
                check(&stream, starts, &whole, position, pattern ^ inner(&mut random, length, shake));
            });
        }
    }
}

/// Other bits between the first and the last wrong one.
fn inner(random: &mut Random, length: u32, shake: u32) -> u32 {
    if shake == 0 || length < 3 { 0 } else { (random.next() as u32 >> (34 - length)) << 1 }
}

#[test]
fn bursts_that_forge_a_delimiter_are_caught() {
    let mut random = Random(7);
    for sequence in 0..40 {
        let (stream, starts) = stream_of(&sample_frame(sequence, 30), &mut random);
        let whole = frames(&stream);
        for at in starts[0]..stream.len() - 5 {
            // One forged delimiter, with or without damage in the three bytes behind it or before it.
            for _ in 0..8 {
                let random_bits = random.next() as u32;
                let ahead = u32::from(stream[at]) | random_bits << 8;
                check(&stream, starts, &whole, 8 * at, ahead);
                if at >= starts[0] + 3 {
                    let behind = u32::from(stream[at]) << 24 | random_bits >> 8;
                    check(&stream, starts, &whole, 8 * (at - 3), behind);
                }
            }
            // All four bytes become delimiters.
            let four = u32::from_le_bytes(stream[at..at + 4].try_into().unwrap());
            check(&stream, starts, &whole, 8 * at, four);
        }
    }
}

#[test]
fn bytes_lost_from_or_put_into_one_frame_are_caught() {
    let mut random = Random(8);
    let (stream, starts) = stream_of(&sample_frame(1, 12), &mut random);
    let whole = frames(&stream);
    let expected = [whole[0].clone(), whole[2].clone()];
    for at in starts[1]..starts[2] - 1 {
        for length in 1..starts[2] - at {
            let shorter = [&stream[..at], &stream[at + length..]].concat();
            assert_eq!(frames(&shorter), expected, "{length} bytes lost at byte {at}");
        }
        for length in 1..40 {
            let doubled = [&stream[..=at], &stream[at..(at + length).min(starts[2] - 1)], &stream[at + 1..]].concat();
            assert_eq!(frames(&doubled), expected, "bytes doubled at byte {at}");
            let mut noise = vec![0; length];
            random.fill(&mut noise);
            for byte in &mut noise {
                *byte |= 1;
            }
            let longer = [&stream[..at], &noise, &stream[at..]].concat();
            assert_eq!(frames(&longer), expected, "{length} bytes put in at byte {at}");
        }
    }
}
