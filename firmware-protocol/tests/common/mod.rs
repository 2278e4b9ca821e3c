//! Shared by several tests.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use firmware_protocol::{FrameBuffer, SampleMessage, SensorState};

/// Pseudo-random numbers by xorshift64*: the same everywhere for one seed.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.next() >> 33) as usize % limit
    }

    pub(crate) fn fill(&mut self, bytes: &mut [u8]) {
        bytes.chunks_mut(8).for_each(|chunk| chunk.copy_from_slice(&self.next().to_le_bytes()[..chunk.len()]));
    }
}

/// A sample whose counts follow from its sequence number.
pub(crate) fn sample_frame(sequence: u32, sensors: usize) -> Vec<u8> {
    let counts: Vec<u16> = (0..sensors).map(|sensor| expected_count(sequence, sensor)).collect();
    let message = SampleMessage {
        device_micros: u64::from(sequence) * 1_000,
        sequence,
        epoch: 3,
        counts: &counts,
        states: &vec![SensorState::Ok; sensors],
    };
    FrameBuffer::new().encode(&message).expect("a frame holds this many sensors").to_vec()
}

/// The count [`sample_frame`] gives a sensor.
pub(crate) fn expected_count(sequence: u32, sensor: usize) -> u16 {
    (sequence.wrapping_mul(7) as usize + sensor * 641) as u16 % 16_384
}
