//! Noise of every kind before, between and inside frames.

mod common;

use common::{Random, expected_count, sample_frame};
use firmware_protocol::{Decoder, DeviceMessage, Frame, HostMessage};

const SENSORS: usize = 12;

/// The sequence number of a frame, which must be one that [`sample_frame`] made.
fn sequence_of(frame: Frame<'_>) -> u32 {
    let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) else {
        panic!("a frame was accepted that was not sent: {frame:?}");
    };
    assert_eq!((sample.sensor_count(), sample.epoch), (SENSORS, 3), "a frame was accepted that was not sent");
    assert!(sample.counts().enumerate().all(|(sensor, count)| count == expected_count(sample.sequence, sensor)));
    sample.sequence
}

#[test]
fn hundred_million_random_bytes_hide_no_frame_and_invent_none() {
    const BYTES: usize = 100_000_000;
    let mut random = Random(0x5EED_0001);
    let mut decoder = Decoder::new();
    let mut noise = vec![0; 1 << 16];
    let (mut fed, mut sent, mut accepted) = (0, 0, 0);
    while fed < BYTES {
        random.fill(&mut noise);
        fed += noise.len();
        // Uniform bytes contain a delimiter about every 256 bytes; with most of those removed, long pieces are tested
        // too.
        if fed.is_multiple_of(1 << 17) {
            let keep_one_in = 1 + random.below(2_000);
            noise.iter_mut().filter(|byte| **byte == 0).for_each(|byte| {
                *byte = u8::from(random.below(keep_one_in) != 0);
            });
        }
        // After noise, a frame needs a delimiter before it, which is the first byte a sender sends.
        let mut burst = [&[0], sample_frame(sent, SENSORS).as_slice(), &sample_frame(sent + 1, SENSORS)].concat();
        burst.extend_from_slice(&noise[..random.below(50)]);
        sent += 2;
        let middle = random.below(noise.len());
        for portion in [&noise[..middle], &burst, &noise[middle..]] {
            let mut bytes = portion;
            while let Some(frame) = decoder.next_frame(&mut bytes) {
                assert_eq!(sequence_of(frame), accepted, "frames come in the order sent");
                accepted += 1;
            }
        }
    }
    assert_eq!(accepted, sent, "every frame sent is accepted");
    assert_eq!(decoder.counters().frames, u64::from(sent));
}

/// Noise that looks almost like frames: bits flipped everywhere, pieces of frames joined.
#[test]
fn a_million_damaged_frames_are_all_refused() {
    let mut random = Random(0x5EED_0002);
    let frames: Vec<Vec<u8>> = (0..64).map(|sequence| sample_frame(sequence, SENSORS)).collect();
    let mut decoder = Decoder::new();
    decoder.next_frame(&mut [0].as_slice());
    for _ in 0..1_000_000 {
        let mut damaged = frames[random.below(frames.len())].clone();
        if random.below(4) == 0 {
            let other = &frames[random.below(frames.len())];
            let cut = random.below(other.len());
            damaged.truncate(cut);
            damaged.extend_from_slice(&other[cut..]);
        }
        for _ in 0..=random.below(6) {
            let bit = random.below(8 * (damaged.len() - 1));
            damaged[bit / 8] ^= 1 << (bit % 8);
        }
        if !frames.contains(&damaged) {
            assert!(decoder.next_frame(&mut damaged.as_slice()).is_none(), "{damaged:02x?}");
        }
    }
    let counters = decoder.counters();
    assert!(counters.checksum_errors > 300_000, "the damage should mostly get as far as the checksum: {counters:?}");
}

#[test]
fn valid_frames_survive_any_portioning() {
    let mut random = Random(77);
    let stream: Vec<u8> = (0..500).flat_map(|sequence| sample_frame(sequence, SENSORS)).collect();
    for longest in [1, 2, 3, 7, 50, 1_000] {
        let mut decoder = Decoder::new();
        let mut expected = 0;
        let mut rest = stream.as_slice();
        while !rest.is_empty() {
            let (mut portion, tail) = rest.split_at(rest.len().min(1 + random.below(longest)));
            rest = tail;
            while let Some(frame) = decoder.next_frame(&mut portion) {
                assert_eq!(sequence_of(frame), expected);
                expected += 1;
            }
        }
        assert_eq!(expected, 500);
        assert_eq!(decoder.counters().bytes_discarded, 0);
    }
}

#[test]
fn after_noise_at_most_one_frame_is_lost() {
    for seed in 1..2_000 {
        let mut random = Random(seed);
        let mut noise = vec![0; random.below(3_000)];
        random.fill(&mut noise);
        let mut stream = sample_frame(0, SENSORS);
        stream.extend_from_slice(&noise);
        (1..4).for_each(|sequence| stream.extend(sample_frame(sequence, SENSORS)));
        let mut decoder = Decoder::new();
        let mut bytes = stream.as_slice();
        let mut found = Vec::new();
        while let Some(frame) = decoder.next_frame(&mut bytes) {
            found.push(sequence_of(frame));
        }
        let without_first_behind_noise = [0, 2, 3];
        assert!(found == [0, 1, 2, 3] || found == without_first_behind_noise, "seed {seed}: {found:?}");
    }
}

#[test]
fn a_listener_who_joins_in_mid_frame_counts_no_error() {
    let stream: Vec<u8> = (0..3).flat_map(|sequence| sample_frame(sequence, SENSORS)).collect();
    for skipped in 1..sample_frame(0, SENSORS).len() - 1 {
        let mut decoder = Decoder::new();
        let mut bytes = &stream[skipped..];
        let mut frames = 0;
        while decoder.next_frame(&mut bytes).is_some() {
            frames += 1;
        }
        let counters = decoder.counters();
        assert_eq!((frames, counters.checksum_errors, counters.framing_errors), (2, 0, 0));
        assert!(counters.bytes_discarded > 0);
    }
}

#[test]
fn decoder_survives_truncated_frame() {
    let whole = sample_frame(9, SENSORS);
    for length in 0..whole.len() - 1 {
        let mut stream = vec![0];
        stream.extend_from_slice(&whole[..length]);
        stream.push(0);
        stream.extend(sample_frame(10, SENSORS));
        let mut decoder = Decoder::new();
        let mut bytes = stream.as_slice();
        assert_eq!(decoder.next_frame(&mut bytes).map(sequence_of), Some(10), "cut to {length} bytes");
        assert_eq!(decoder.counters().framing_errors, u64::from(length > 0));
        assert_eq!(decoder.counters().bytes_discarded, if length > 0 { length as u64 + 1 } else { 0 });
    }
}

#[test]
fn a_frame_longer_than_the_decoder_is_skipped_and_counted() {
    let mut decoder = Decoder::<64>::with_capacity();
    let long = sample_frame(1, 96);
    for portion in [1, 10, long.len()] {
        let before = decoder.counters();
        for mut bytes in long.chunks(portion) {
            assert!(decoder.next_frame(&mut bytes).is_none());
        }
        let after = decoder.counters();
        assert_eq!(after.framing_errors, before.framing_errors + u64::from(before.bytes_discarded > 0));
        assert_eq!(after.bytes_discarded, before.bytes_discarded + long.len() as u64);
    }
    let short = firmware_protocol::FrameBuffer::new().encode(&HostMessage::Start).unwrap().to_vec();
    assert_eq!(decoder.next_frame(&mut short.as_slice()).map(HostMessage::parse), Some(Ok(HostMessage::Start)));
}

#[test]
fn lone_delimiters_mean_nothing() {
    let mut decoder = Decoder::new();
    assert!(decoder.next_frame(&mut [0; 1_000].as_slice()).is_none());
    assert_eq!(decoder.counters(), firmware_protocol::DecoderCounters::default());
}

#[test]
fn reset_forgets_the_frame_begun() {
    let whole = sample_frame(1, SENSORS);
    let mut decoder = Decoder::new();
    assert!(decoder.next_frame(&mut &whole[..20]).is_none());
    decoder.reset();
    assert!(decoder.next_frame(&mut whole.as_slice()).is_some());
    assert_eq!(decoder.counters().bytes_discarded, 0);
}
