//! Measures how fast samples of 32 three-axis joints are encoded and decoded, on one core.
//!
//! `cargo run --release -p firmware-protocol --example throughput`

use std::hint::black_box;
use std::time::Instant;

use firmware_protocol::{Decoder, DeviceMessage, FrameBuffer, SampleMessage, SensorState};

const SENSORS: usize = 96;
const FRAMES: u32 = 20_000;
const ROUNDS: u32 = 10;

fn main() {
    let mut stream = Vec::new();
    let started = Instant::now();
    let mut frame = FrameBuffer::new();
    for sequence in 0..FRAMES {
        let counts: [u16; SENSORS] =
            std::array::from_fn(|sensor| ((sequence as usize * 7 + sensor * 641) % 16_384) as u16);
        let message = SampleMessage {
            device_micros: u64::from(sequence) * 1_000,
            sequence,
            epoch: 1,
            counts: &counts,
            states: &[SensorState::Ok; SENSORS],
        };
        stream.extend_from_slice(frame.encode(&message).expect("96 sensors fit a frame"));
    }
    let seconds = started.elapsed().as_secs_f64();
    println!(
        "encode {:6.0} MB/s, {} bytes per frame",
        stream.len() as f64 / seconds / 1e6,
        stream.len() / FRAMES as usize
    );

    for portion in [stream.len(), 4096, 64] {
        let started = Instant::now();
        let (mut frames, mut sum) = (0, 0u64);
        for _ in 0..ROUNDS {
            let mut decoder = Decoder::new();
            for mut bytes in stream.chunks(portion) {
                while let Some(frame) = decoder.next_frame(&mut bytes) {
                    if let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) {
                        frames += 1;
                        sum += sample.counts().map(u64::from).sum::<u64>();
                        sum += sample.states().map(|state| u64::from(state.code())).sum::<u64>();
                    }
                }
            }
        }
        black_box(sum);
        let seconds = started.elapsed().as_secs_f64();
        let megabytes = f64::from(ROUNDS) * stream.len() as f64 / 1e6;
        assert_eq!(frames, FRAMES * ROUNDS);
        println!("decode {:6.0} MB/s in portions of {portion} bytes", megabytes / seconds);
    }
}
