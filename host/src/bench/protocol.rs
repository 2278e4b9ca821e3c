//! How fast bytes become messages.

use std::hint::black_box;

use firmware_protocol::{Decoder, DeviceMessage, EncodeError, FrameBuffer, SampleMessage, SensorState};

use super::{Measurement, median, time_runs};
use crate::cli::args::BenchArgs;
use crate::failure::Failure;

pub(super) const NAMES: &[&str] = &["protocol/decode", "protocol/encode", "protocol/line-share-32x3-1000hz"];

const SENSORS: usize = 96;
const FRAMES: u32 = 100_000;
const RUNS: usize = 9;
const BAUD: f64 = 3e6;
const BITS_PER_BYTE: f64 = 10.0;

pub(super) fn run(_: &BenchArgs) -> Result<Vec<Measurement>, Failure> {
    let failed = |error: EncodeError| Failure::not_converged(format!("the sample does not encode: {error}"), "");
    let bytes = encode_samples().map_err(failed)?;
    let megabytes = bytes.len() as f64 / 1e6;

    let encode = time_runs(RUNS, || {
        black_box(encode_samples().map(|b| b.len()).ok());
    });
    let mut accepted = 0;
    let decode = time_runs(RUNS, || accepted = decode_samples(black_box(&bytes)));
    if accepted != u64::from(FRAMES) {
        let what = format!("the decoder accepted {accepted} of {FRAMES} frames");
        return Err(Failure::not_converged(what, "this is a defect; please report it"));
    }
    let share = bytes.len() as f64 / f64::from(FRAMES) * 1000.0 * BITS_PER_BYTE / BAUD;
    Ok(vec![
        Measurement::new("protocol/decode", megabytes / median(&decode), "MB/s", RUNS).at_least(200.0, "at least 200"),
        Measurement::new("protocol/encode", megabytes / median(&encode), "MB/s", RUNS),
        Measurement::new("protocol/line-share-32x3-1000hz", share * 100.0, "%", 1).at_most(90.0, "of 3 Mbaud"),
    ])
}

/// Samples of 32 three-axis joints with counts that change from one to the next.
fn encode_samples() -> Result<Vec<u8>, EncodeError> {
    let mut out = Vec::with_capacity(FRAMES as usize * 260);
    let mut buffer = FrameBuffer::new();
    let mut counts = [0u16; SENSORS];
    let states = [SensorState::Ok; SENSORS];
    for sequence in 0..FRAMES {
        for (sensor, count) in counts.iter_mut().enumerate() {
            *count = (sequence.wrapping_mul(37).wrapping_add(sensor as u32 * 4099) & 0x3fff) as u16;
        }
        let device_micros = u64::from(sequence) * 1000;
        let sample = SampleMessage { device_micros, sequence, epoch: 1, counts: &counts, states: &states };
        out.extend_from_slice(buffer.encode(&sample)?);
    }
    Ok(out)
}

/// Decodes like a session: in portions as read, with every count used.
fn decode_samples(bytes: &[u8]) -> u64 {
    let mut decoder = Decoder::new();
    let mut accepted = 0;
    let mut sum = 0u64;
    for mut portion in bytes.chunks(4096) {
        while let Some(frame) = decoder.next_frame(&mut portion) {
            if let Ok(DeviceMessage::Sample(sample)) = DeviceMessage::parse(frame) {
                accepted += 1;
                sum += sample.counts().map(u64::from).sum::<u64>();
            }
        }
    }
    black_box(sum);
    accepted
}
