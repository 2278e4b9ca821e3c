//! The documentation's firm promise: no burst of up to 32 bits on the wire goes unnoticed, wherever it is, delimiters
//! included; nor does any run of bytes removed from or inserted into one frame.
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

/// Three frames, two short ones and a sample, with the bytes at which each begins.
fn stream_of(middle: &[u8], random: &mut Random) -> (Vec<u8>, [usize; 4]) {
    let first = FrameBuffer::new().encode(&HostMessage::Ping { token: random.next() }).expect("fits").to_vec();
    let last = FrameBuffer::new().encode(&Acknowledge { request: 4 }).expect("fits").to_vec();
    let starts = [1, 1 + first.len(), 1 + first.len() + middle.len(), 1 + first.len() + middle.len() + last.len()];
    ([&[0], first.as_slice(), middle, &last].concat(), starts)
}

/// Damages the stream and checks that exactly those frames survive whose bytes (delimiter included) were not touched.
/// The delimiter before a frame belongs to the previous frame.
fn check(stream: &[u8], starts: [usize; 4], whole: &[(u8, Vec<u8>)], position: usize, pattern: u32) {
    let mut struck = stream.to_vec();
    strike(&mut struck, position, pattern);
    let untouched: Vec<&(u8, Vec<u8>)> = (0..3)
        .filter(|&frame| struck[starts[frame]..starts[frame + 1]] == stream[starts[frame]..starts[frame + 1]])
        .map(|frame| &whole[frame])
        .collect();
    // A frame after a destroyed delimiter may be lost with the frame before it, never the other way round; what is
    // found must be whole and in order, and never a damaged frame.
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
            // One forged delimiter, with or without damage in the three bytes after or before it.
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

/// One step of the checksum's register, from its definition.
fn step(register: u32, byte: u8) -> u32 {
    (0..8).fold(register ^ u32::from(byte), |value, _| (value >> 1) ^ if value & 1 == 1 { 0xEDB8_8320 } else { 0 })
}

/// The four bytes that take the register from one state to another.
fn bytes_between(mut from: u32, mut to: u32) -> [u8; 4] {
    let mut indices = [0; 4];
    for index in indices.iter_mut().rev() {
        let found = (0..=255).find(|&byte| step(0, byte) >> 24 == to >> 24).expect("the high bytes are all different");
        *index = found;
        to = (to ^ step(0, found)) << 8;
    }
    indices.map(|index| {
        let byte = index ^ from as u8;
        from = step(from, byte);
        byte
    })
}

fn wire(stuffed: &[u8]) -> Vec<u8> {
    let length = seven_bits::<2>(stuffed.len() as u32);
    let covered = [&length, stuffed, &length].concat();
    let sum = !covered.iter().fold(u32::MAX, |register, &byte| step(register, byte));
    [covered.as_slice(), &seven_bits::<5>(sum), &[0]].concat()
}

fn seven_bits<const N: usize>(value: u32) -> [u8; N] {
    std::array::from_fn(|at| 0x80 | (value >> (7 * at)) as u8 & 0x7F)
}

fn checksum_errors_and_frames(stream: &[u8]) -> (u64, u64) {
    let mut decoder = Decoder::new();
    let mut bytes = stream;
    while decoder.next_frame(&mut bytes).is_some() {}
    (decoder.counters().checksum_errors, decoder.counters().frames)
}

/// The worst case of a forged delimiter: what follows it begins with its own length, and the checksum of the whole
/// frame is also right for it, because the register before it is in its initial state.
#[test]
fn a_rear_piece_with_a_right_checksum_is_caught_by_its_rear_length() {
    let tail_stuffed: Vec<u8> = std::iter::once(31).chain(1..31).collect();
    let tail = [&seven_bits::<2>(31), tail_stuffed.as_slice()].concat();
    let mut caught = 0;
    for filler in 1..=255 {
        let raw_length = 1 + 1 + 4 + 1 + tail.len();
        let head = [raw_length as u8 + 1, 0x84, filler];
        let length = seven_bits::<2>(raw_length as u32 + 1);
        let register = length.iter().chain(&head).fold(u32::MAX, |register, &byte| step(register, byte));
        let before_struck = (0..=u8::MAX).find(|&byte| step(0, byte) >> 24 == 0xFF).expect("a byte for it");
        // After the struck byte (value 7) the register must be all ones.
        let wanted = (u32::MAX ^ step(0, before_struck)) << 8 | u32::from(before_struck ^ 7);
        let forcing = bytes_between(register, wanted);
        if forcing.contains(&0) {
            continue;
        }
        let whole = wire(&[&head, forcing.as_slice(), &[7], &tail].concat());
        assert_eq!(checksum_errors_and_frames(&[&[0], whole.as_slice()].concat()), (0, 1), "a good frame");
        let struck_at = 2 + head.len() + 4;
        let rear = &whole[struck_at + 1..];
        let (covered, sum) = rear[..rear.len() - 1].split_at(rear.len() - 6);
        let own_sum = !covered.iter().fold(u32::MAX, |register, &byte| step(register, byte));
        assert_eq!(seven_bits::<5>(own_sum), sum, "the rear piece has a right checksum");
        let mut struck = [&[0], whole.as_slice()].concat();
        struck[1 + struck_at] ^= 7;
        assert_eq!(checksum_errors_and_frames(&struck), (0, 0), "and is rejected by its length");
        caught += 1;
    }
    assert!(caught > 200);
}

/// The same for the piece before a forged delimiter: it ends with its own length and checksum.
#[test]
fn a_front_piece_with_a_right_checksum_is_caught_by_its_front_length() {
    let front_stuffed = [4, 0x84, 1, 2];
    let front_rear_length = seven_bits::<2>(front_stuffed.len() as u32);
    // The first byte of the rear length is also the code byte of the run that it starts.
    let run_length = usize::from(front_rear_length[0]) - 1;
    let stuffed_length = front_stuffed.len() + 1 + run_length;
    let length = seven_bits::<2>(stuffed_length as u32);
    let covered = [&length, front_stuffed.as_slice(), &front_rear_length].concat();
    let sum = seven_bits::<5>(!covered.iter().fold(u32::MAX, |register, &byte| step(register, byte)));
    let mut stuffed = [front_stuffed.as_slice(), &front_rear_length, &sum, &[7]].concat();
    stuffed.resize(stuffed_length, 9);
    let whole = wire(&stuffed);
    assert_eq!(checksum_errors_and_frames(&[&[0], whole.as_slice()].concat()), (0, 1), "a good frame");
    let mut struck = [&[0], whole.as_slice()].concat();
    struck[1 + 2 + front_stuffed.len() + 2 + 5] ^= 7;
    assert_eq!(checksum_errors_and_frames(&struck), (0, 0));
}
