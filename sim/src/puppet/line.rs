//! The line from device to host, and what it does to the bytes.

use firmware_protocol::{Encode, FrameBuffer, message_type};

use crate::faults::{Faults, Truth};
use crate::random::Random;

/// Puts frames on the line and damages them as the faults require.
#[derive(Clone, Debug)]
pub(super) struct Line {
    buffer: FrameBuffer,
    damaged: Vec<u8>,
    random: Random,
    bit_flip: f64,
    byte_drop: f64,
    byte_duplicate: f64,
    /// Whether the last byte on the line was a delimiter, so that the next frame begins cleanly.
    clean: bool,
    noisy: bool,
}

impl Line {
    pub(super) fn new(faults: &Faults, random: Random) -> Self {
        Self {
            buffer: FrameBuffer::new(),
            damaged: Vec::new(),
            random,
            bit_flip: faults.bit_flip,
            byte_drop: faults.byte_drop,
            byte_duplicate: faults.byte_duplicate,
            clean: true,
            noisy: false,
        }
    }

    /// Switches noise on the line on or off.
    pub(super) fn set_noisy(&mut self, noisy: bool) {
        self.noisy = noisy;
    }

    pub(super) fn is_noisy(&self) -> bool {
        self.noisy
    }

    /// A lone delimiter, as a device sends it before its first frame.
    pub(super) fn delimiter(&mut self, out: &mut Vec<u8>) {
        if !self.noisy {
            out.push(0);
            self.clean = true;
        }
    }

    /// Sends one frame; our own messages are never too long or inconsistent, so encoding cannot fail.
    pub(super) fn send(&mut self, message: &impl Encode, truth: &mut Truth, out: &mut Vec<u8>) {
        let Ok(frame) = self.buffer.encode(message) else { return };
        let is_sample = u64::from(message.message_type() == message_type::SAMPLE);
        truth.frames_sent += 1;
        truth.samples_sent += is_sample;
        let faultless = self.bit_flip <= 0.0 && self.byte_drop <= 0.0 && self.byte_duplicate <= 0.0;
        let intact = if self.noisy {
            false
        } else if faultless {
            out.extend_from_slice(frame);
            std::mem::replace(&mut self.clean, true)
        } else {
            self.damaged.clear();
            for &byte in frame {
                if self.random.chance(self.byte_drop) {
                    truth.bytes_dropped += 1;
                    continue;
                }
                let mut byte = byte;
                if self.random.chance(self.bit_flip) {
                    truth.bits_flipped += 1;
                    byte ^= 1 << (self.random.next_u64() & 7);
                }
                self.damaged.push(byte);
                if self.random.chance(self.byte_duplicate) {
                    truth.bytes_duplicated += 1;
                    self.damaged.push(byte);
                }
            }
            out.extend_from_slice(&self.damaged);
            let began_clean = self.clean;
            self.clean = self.damaged.last().map_or(self.clean, |byte| *byte == 0);
            // A delimiter that arrives twice does no harm.
            let doubled = self.damaged.len() == frame.len() + 1 && self.damaged.ends_with(&[0, 0]);
            let received = &self.damaged[..self.damaged.len() - usize::from(doubled)];
            began_clean && received == frame
        };
        if !intact {
            truth.frames_damaged += 1;
            truth.samples_damaged += is_sample;
        }
    }

    /// This many bytes of noise.
    pub(super) fn noise(&mut self, count: u64, truth: &mut Truth, out: &mut Vec<u8>) {
        for _ in 0..count {
            let byte = self.random.byte();
            out.push(byte);
            self.clean = byte == 0;
        }
        truth.noise_bytes += count;
    }
}
