//! Both kinds of bus behind one interface: requests, answers, registers and the time that bytes take.

use std::time::Duration;

use super::packet::{PacketCounters, Status};
use super::{dynamixel, feetech};
use crate::arm::{COUNTS_PER_TURN, ServoProtocol};

/// How the positions of several servos are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadMode {
    /// One request, one combined answer (Dynamixel only).
    Fast,
    /// One request, one answer from each.
    Sync,
    /// One request and one answer for each.
    Single,
}

impl ReadMode {
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Fast => "fast sync reads",
            Self::Sync => "sync reads",
            Self::Single => "single reads",
        }
    }
}

/// Where things are in a servo's memory.
#[derive(Clone, Copy, Debug)]
pub(super) struct Registers {
    pub(super) model: u16,
    pub(super) return_delay: u16,
    pub(super) torque: u16,
    pub(super) position: u16,
    pub(super) position_length: u16,
    /// Registers below this keep their value without power and wear out.
    pub(super) ram_begins: u16,
    /// Must be 0 before those registers can be written.
    pub(super) lock: Option<u16>,
    pub(super) light: Option<u16>,
}

/// Microseconds per unit of return delay, on both buses.
pub(super) const RETURN_DELAY_UNIT_MICROS: u32 = 2;

impl ServoProtocol {
    pub(super) const fn registers(self) -> Registers {
        match self {
            Self::Feetech => Registers {
                model: 3,
                return_delay: 7,
                torque: 40,
                position: 56,
                position_length: 2,
                ram_begins: 40,
                lock: Some(55),
                light: None,
            },
            Self::Dynamixel => Registers {
                model: 0,
                return_delay: 9,
                torque: 64,
                position: 132,
                position_length: 4,
                ram_begins: 64,
                lock: None,
                light: Some(65),
            },
        }
    }

    pub(super) fn read(self, id: u8, address: u16, length: u16) -> Vec<u8> {
        match self {
            Self::Feetech => feetech::read(id, address as u8, length as u8),
            Self::Dynamixel => dynamixel::read(id, address, length),
        }
    }

    pub(super) fn write(self, id: u8, address: u16, data: &[u8]) -> Vec<u8> {
        match self {
            Self::Feetech => feetech::write(id, address as u8, data),
            Self::Dynamixel => dynamixel::write(id, address, data),
        }
    }

    /// Reads the positions of these servos.
    pub(super) fn read_positions(self, mode: ReadMode, ids: &[u8]) -> Vec<u8> {
        let Registers { position, position_length, .. } = self.registers();
        match (self, mode, ids) {
            (_, ReadMode::Single, &[id, ..]) => self.read(id, position, position_length),
            (Self::Feetech, ..) => feetech::sync_read(ids, position as u8, position_length as u8),
            (Self::Dynamixel, ReadMode::Fast, _) => dynamixel::fast_sync_read(ids, position, position_length),
            (Self::Dynamixel, ..) => dynamixel::sync_read(ids, position, position_length),
        }
    }

    /// Bytes of the answers to a read of this much data from this many servos.
    pub(super) const fn answer_length(self, mode: ReadMode, servos: usize, data_length: usize) -> usize {
        match (self, mode) {
            (Self::Feetech, _) => servos * (feetech::STATUS_OVERHEAD + data_length),
            (Self::Dynamixel, ReadMode::Fast) => {
                dynamixel::FAST_FRONT + servos * (dynamixel::PIECE_OVERHEAD + data_length)
            }
            (Self::Dynamixel, _) => servos * (dynamixel::STATUS_OVERHEAD + data_length),
        }
    }

    /// A servo's position within its turn, from the status of a position read.
    pub(super) fn counts(self, status: &Status) -> Option<u16> {
        let position = match self {
            Self::Feetech => feetech::signed_magnitude(status.word()?),
            Self::Dynamixel => status.double_word()?,
        };
        Some(position.rem_euclid(COUNTS_PER_TURN as i32) as u16)
    }

    /// Whether a status reports that the request failed, so that its data mean nothing.
    pub(super) const fn failed(self, error: u8) -> bool {
        match self {
            Self::Feetech => false,
            Self::Dynamixel => error & 0x7F != 0,
        }
    }

    /// A servo's error in words; `None` if there is none.
    pub(super) fn complaint(self, error: u8) -> Option<String> {
        let bits: &[(u8, &str)] = match self {
            Self::Feetech => &[
                (0x01, "a supply voltage out of range"),
                (0x02, "a failing angle sensor"),
                (0x04, "overheating"),
                (0x08, "too much current"),
                (0x20, "an overload"),
            ],
            Self::Dynamixel => &[(0x80, "a hardware error (voltage, heat, load or encoder)")],
        };
        let said: Vec<&str> = bits.iter().filter(|(bit, _)| error & bit != 0).map(|(_, text)| *text).collect();
        (!said.is_empty()).then(|| said.join(", "))
    }
}

/// The time that bytes take on the wire: ten bits each.
pub(super) fn on_wire(bytes: usize, baud: u32) -> Duration {
    Duration::from_nanos(bytes as u64 * 10_000_000_000 / u64::from(baud.max(1)))
}

/// The most readings of all servos per second that the wire allows: request and answers follow each other without a
/// pause, except for the time, µs, that each servo waits before it answers.
pub fn wire_bound_hertz(protocol: ServoProtocol, mode: ReadMode, baud: u32, return_delays_micros: &[u32]) -> f64 {
    let count = return_delays_micros.len();
    if count == 0 {
        return 0.0;
    }
    let data = usize::from(protocol.registers().position_length);
    let ids: Vec<u8> = (0..count.min(200) as u8).collect();
    let request = match mode {
        ReadMode::Single => count * protocol.read_positions(mode, &[1]).len(),
        ReadMode::Fast | ReadMode::Sync => protocol.read_positions(mode, &ids).len(),
    };
    let bytes = request + protocol.answer_length(mode, count, data);
    // In a combined answer only the first servo waits.
    let waits = if mode == ReadMode::Fast { 1 } else { count };
    let waited: u64 = return_delays_micros[..waits].iter().map(|&micros| u64::from(micros)).sum();
    1.0 / (on_wire(bytes, baud) + Duration::from_micros(waited)).as_secs_f64()
}

/// The decoder of either bus.
#[derive(Clone, Debug)]
pub(super) enum BusDecoder {
    Feetech(feetech::Decoder),
    Dynamixel(dynamixel::Decoder),
}

impl BusDecoder {
    pub(super) fn new(protocol: ServoProtocol) -> Self {
        match protocol {
            ServoProtocol::Feetech => Self::Feetech(feetech::Decoder::default()),
            ServoProtocol::Dynamixel => Self::Dynamixel(dynamixel::Decoder::default()),
        }
    }

    pub(super) fn expect(&mut self, mode: ReadMode, servos: usize, data_length: usize) {
        match self {
            Self::Feetech(decoder) => decoder.expect(data_length),
            Self::Dynamixel(decoder) if mode == ReadMode::Fast => decoder.expect_fast(servos, data_length),
            Self::Dynamixel(decoder) => decoder.expect(data_length),
        }
    }

    pub(super) fn receive(&mut self, bytes: &[u8]) {
        match self {
            Self::Feetech(decoder) => decoder.receive(bytes),
            Self::Dynamixel(decoder) => decoder.receive(bytes),
        }
    }

    pub(super) fn next_status(&mut self) -> Option<Status> {
        match self {
            Self::Feetech(decoder) => decoder.next_status(),
            Self::Dynamixel(decoder) => decoder.next_status(),
        }
    }

    pub(super) fn give_up_waiting(&mut self) -> bool {
        match self {
            Self::Feetech(decoder) => decoder.give_up_waiting(),
            Self::Dynamixel(decoder) => decoder.give_up_waiting(),
        }
    }

    pub(super) fn reset(&mut self) {
        match self {
            Self::Feetech(decoder) => decoder.reset(),
            Self::Dynamixel(decoder) => decoder.reset(),
        }
    }

    pub(super) fn counters(&self) -> PacketCounters {
        match self {
            Self::Feetech(decoder) => decoder.counters(),
            Self::Dynamixel(decoder) => decoder.counters(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wire_bounds_are_the_known_ones() {
        use ServoProtocol::{Dynamixel, Feetech};
        let bound = |protocol, mode, baud, delay| wire_bound_hertz(protocol, mode, baud, &[delay; 16]);
        assert!((bound(Dynamixel, ReadMode::Sync, 1_000_000, 0) - 370.0).abs() < 1.0);
        assert!((bound(Dynamixel, ReadMode::Fast, 1_000_000, 0) - 602.0).abs() < 1.0);
        assert!((bound(Dynamixel, ReadMode::Sync, 57_600, 0) - 21.0).abs() < 0.5);
        assert!((bound(Dynamixel, ReadMode::Fast, 57_600, 0) - 35.0).abs() < 0.5);
        assert!((bound(Feetech, ReadMode::Sync, 1_000_000, 0) - 658.0).abs() < 1.0);
        assert!((bound(Feetech, ReadMode::Sync, 1_000_000, 500) - 105.0).abs() < 1.0);
        assert!(wire_bound_hertz(Feetech, ReadMode::Sync, 1_000_000, &[]).abs() < 1e-9);
    }

    #[test]
    fn positions_wrap_into_one_turn() {
        let status = |data: &[u8]| Status { id: 1, error: 0, data: data.to_vec() };
        assert_eq!(ServoProtocol::Feetech.counts(&status(&[0x64, 0x80])), Some(4096 - 100));
        assert_eq!(ServoProtocol::Dynamixel.counts(&status(&(-1_i32).to_le_bytes())), Some(4095));
        assert_eq!(ServoProtocol::Dynamixel.counts(&status(&i32::MIN.to_le_bytes())), Some(0));
        assert_eq!(ServoProtocol::Dynamixel.counts(&status(&[1, 2])), None);
    }
}
