//! Feetech STS/SMS bus packets: bytes to statuses and requests to bytes. No I/O, no clock.
//!
//! ```text
//! request  FF FF ID LEN INST P1..Pn SUM    LEN = n + 2
//! status   FF FF ID LEN ERR  D1..Dn SUM    SUM = !(ID + LEN + .. + last) & FF
//! ```
//!
//! Words are little-endian (the SCS series, which is big-endian, is recognised by its model number). A request and a
//! status look the same, so the caller has to know whether the adapter echoes what is sent.

use super::packet::{PacketCounters, Status};

/// All servos.
pub const BROADCAST: u8 = 0xFE;
/// Longest packet on this bus, bytes.
pub const MAX_PACKET: usize = 250;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const SYNC_READ: u8 = 0x82;
/// Bytes around the data of a status: header, id, length, error, sum.
pub(super) const STATUS_OVERHEAD: usize = 6;

/// A request with any instruction. Parameters that do not fit in a packet are cut off.
pub fn request(id: u8, instruction: u8, parameters: &[u8]) -> Vec<u8> {
    let parameters = &parameters[..parameters.len().min(MAX_PACKET - STATUS_OVERHEAD)];
    let mut packet = vec![0xFF, 0xFF, id, parameters.len() as u8 + 2, instruction];
    packet.extend_from_slice(parameters);
    packet.push(sum(&packet[2..]));
    packet
}

/// Is this servo there?
pub fn ping(id: u8) -> Vec<u8> {
    request(id, PING, &[])
}

/// Reads registers.
pub fn read(id: u8, address: u8, length: u8) -> Vec<u8> {
    request(id, READ, &[address, length])
}

/// Writes registers.
pub fn write(id: u8, address: u8, data: &[u8]) -> Vec<u8> {
    request(id, WRITE, &[&[address], data].concat())
}

/// Reads the same registers of several servos; each answers with its own status, in this order.
pub fn sync_read(ids: &[u8], address: u8, length: u8) -> Vec<u8> {
    request(BROADCAST, SYNC_READ, &[&[address, length], ids].concat())
}

/// A two-byte register whose top bit is the sign of the rest.
pub fn signed_magnitude(word: u16) -> i32 {
    let magnitude = i32::from(word & 0x7FFF);
    if word & 0x8000 == 0 { magnitude } else { -magnitude }
}

fn sum(bytes: &[u8]) -> u8 {
    !bytes.iter().fold(0_u8, |sum, &byte| sum.wrapping_add(byte))
}

/// Finds statuses in a stream of bytes, and resynchronises after garbage.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: Vec<u8>,
    longest: usize,
    counters: PacketCounters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { buffer: Vec::new(), longest: MAX_PACKET, counters: PacketCounters::default() }
    }
}

impl Decoder {
    /// The counters so far.
    pub fn counters(&self) -> PacketCounters {
        self.counters
    }

    /// Data length of the longest expected status. A header that announces more is garbage and is not waited for.
    pub fn expect(&mut self, data_length: usize) {
        self.longest = (data_length + STATUS_OVERHEAD).min(MAX_PACKET);
    }

    /// Takes bytes as they arrive.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// The next status; `None` until more bytes arrive.
    pub fn next_status(&mut self) -> Option<Status> {
        loop {
            let skipped = self.buffer.iter().position(|&byte| byte == 0xFF).unwrap_or(self.buffer.len());
            self.discard(skipped);
            let &[first, second, id, length, ..] = &self.buffer[..] else {
                return match self.buffer[..] {
                    [_] | [_, 0xFF] | [_, 0xFF, ..] => {
                        // A third FF pushes the header one byte on.
                        if self.buffer.get(2) == Some(&0xFF) {
                            self.discard(1);
                            continue;
                        }
                        None
                    }
                    [] => None,
                    _ => {
                        self.discard(1);
                        continue;
                    }
                };
            };
            let whole = usize::from(length) + 4;
            if (first, second) != (0xFF, 0xFF) || id >= BROADCAST || length < 2 || whole > self.longest {
                self.discard(1);
                continue;
            }
            if self.buffer.len() < whole {
                return None;
            }
            if self.buffer[whole - 1] != sum(&self.buffer[2..whole - 1]) {
                self.counters.checksum_errors += 1;
                self.discard(1);
                continue;
            }
            let status = Status { id, error: self.buffer[4], data: self.buffer[5..whole - 1].to_vec() };
            self.buffer.drain(..whole);
            self.counters.packets += 1;
            return Some(status);
        }
    }

    /// Nothing more will arrive: gives up the pending packet, so that packets after its header are found. Call
    /// [`next_status`](Self::next_status) afterwards; returns whether anything is left to parse.
    pub fn give_up_waiting(&mut self) -> bool {
        self.discard(1);
        !self.buffer.is_empty()
    }

    /// Discards any partly received packet, counting it as garbage.
    pub fn reset(&mut self) {
        self.discard(self.buffer.len());
    }

    fn discard(&mut self, count: usize) {
        let count = count.min(self.buffer.len());
        self.buffer.drain(..count);
        self.counters.discarded_bytes += count as u64;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn all(bytes: &[u8]) -> Vec<Status> {
        let mut decoder = Decoder::default();
        decoder.receive(bytes);
        std::iter::from_fn(|| decoder.next_status()).collect()
    }

    #[test]
    fn requests_are_the_published_bytes() {
        assert_eq!(ping(1), [0xFF, 0xFF, 0x01, 0x02, 0x01, 0xFB]);
        assert_eq!(ping(BROADCAST), [0xFF, 0xFF, 0xFE, 0x02, 0x01, 0xFE]);
        assert_eq!(read(1, 3, 2), [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x03, 0x02, 0xF3]);
        assert_eq!(read(1, 56, 2), [0xFF, 0xFF, 0x01, 0x04, 0x02, 0x38, 0x02, 0xBE]);
        assert_eq!(sync_read(&[1, 2], 56, 2), [0xFF, 0xFF, 0xFE, 0x06, 0x82, 0x38, 0x02, 0x01, 0x02, 0x3C]);
        assert_eq!(write(1, 40, &[0]), [0xFF, 0xFF, 0x01, 0x04, 0x03, 0x28, 0x00, 0xCF]);
        assert_eq!(write(1, 7, &[0]), [0xFF, 0xFF, 0x01, 0x04, 0x03, 0x07, 0x00, 0xF0]);
    }

    #[test]
    fn statuses_are_read() {
        let status = |data: &[u8]| Status { id: 1, error: 0, data: data.to_vec() };
        let model = all(&[0xFF, 0xFF, 0x01, 0x04, 0x00, 0x09, 0x03, 0xEE]);
        assert_eq!(model, [status(&[0x09, 0x03])]);
        assert_eq!(model[0].word(), Some(777));
        assert_eq!(all(&[0xFF, 0xFF, 0x01, 0x04, 0x00, 0x00, 0x08, 0xF2])[0].word(), Some(2048));
        let back = all(&[0xFF, 0xFF, 0x01, 0x04, 0x00, 0x64, 0x80, 0x16]);
        assert_eq!(back[0].word().map(signed_magnitude), Some(-100));
    }

    #[test]
    fn a_damaged_length_does_not_swallow_the_statuses_behind_it() {
        let mut decoder = Decoder::default();
        decoder.expect(2);
        let good = [0xFF, 0xFF, 2, 4, 0, 7, 0, !(2 + 4 + 7)];
        decoder.receive(&[0xFF, 0xFF, 1, 0x84, 0, 0, 8, 0xF2]);
        decoder.receive(&good);
        assert_eq!(decoder.next_status().map(|status| status.id), Some(2), "longer than anything awaited");
        let mut decoder = Decoder::default();
        decoder.receive(&[0xFF, 0xFF, 1, 0x40, 0, 0, 8, 0xF2]);
        decoder.receive(&good);
        assert_eq!(decoder.next_status(), None, "it may still be coming");
        assert!(decoder.give_up_waiting());
        assert_eq!(decoder.next_status().map(|status| status.id), Some(2));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn any_bytes_in_any_portions_give_the_same(
            bytes in prop::collection::vec(prop_oneof![Just(0xFF_u8), 0_u8..8, any::<u8>()], 0..400), cut in 0_usize..400,
        ) {
            let whole = all(&bytes);
            let (front, rear) = bytes.split_at(cut.min(bytes.len()));
            let mut decoder = Decoder::default();
            let mut parts = Vec::new();
            for piece in [front, rear] {
                decoder.receive(piece);
                parts.extend(std::iter::from_fn(|| decoder.next_status()));
            }
            prop_assert_eq!(parts, whole);
            while decoder.give_up_waiting() {
                while decoder.next_status().is_some() {}
            }
            let counters = decoder.counters();
            prop_assert!(counters.discarded_bytes + 6 * counters.packets <= bytes.len() as u64);
        }

        #[test]
        fn a_status_behind_garbage_is_found(
            garbage in prop::collection::vec(0_u8..0xFF, 0..60), id in 0_u8..0xFE, data in prop::collection::vec(any::<u8>(), 0..8),
        ) {
            let packet = request(id, 0, &data);
            let found = all(&[garbage, packet].concat());
            prop_assert_eq!(found, vec![Status { id, error: 0, data }]);
        }
    }
}
