//! Dynamixel protocol 2.0 packets: bytes to statuses and requests to bytes. No I/O, no clock.
//!
//! ```text
//! request  FF FF FD 00 ID LENlo LENhi INST P..     CRClo CRChi    LEN = n + 3
//! status   FF FF FD 00 ID LENlo LENhi 55 ERR D..   CRClo CRChi    LEN = n + 4
//! fast     FF FF FD 00 FE LENlo LENhi 55 then for each servo {ERR ID D.. CRClo CRChi}
//! ```
//!
//! The CRC (polynomial 8005, no reflection, initial value 0) covers all bytes before it, as sent on the wire. After the
//! instruction, every FF FF FD is written FF FF FD FD. The answer to a fast sync read is written by several servos one
//! after another and its length is fixed by the first, so nothing in it is stuffed; each servo's CRC covers everything
//! before it, so a piece can be trusted even if a later servo stayed silent.

use super::packet::{PacketCounters, Status};

/// All servos.
pub const BROADCAST: u8 = 0xFE;
/// Longest accepted packet, bytes.
pub const MAX_PACKET: usize = 1_024;

const PING: u8 = 0x01;
const READ: u8 = 0x02;
const WRITE: u8 = 0x03;
const SYNC_READ: u8 = 0x82;
const FAST_SYNC_READ: u8 = 0x8A;
const STATUS: u8 = 0x55;
const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
/// Bytes before the instruction: header, id, length.
const FRONT: usize = 7;
/// Bytes around the data of a status: header, id, length, instruction, error, CRC.
pub(super) const STATUS_OVERHEAD: usize = 11;
/// Bytes before the first piece of a fast answer, and around the data of each piece.
pub(super) const FAST_FRONT: usize = 8;
pub(super) const PIECE_OVERHEAD: usize = 4;

/// CRC-16 with polynomial 8005, no reflection, initial value and final exclusive-or 0.
pub fn checksum(bytes: &[u8]) -> u16 {
    static TABLE: [u16; 256] = table();
    bytes.iter().fold(0, |crc: u16, &byte| (crc << 8) ^ TABLE[usize::from((crc >> 8) as u8 ^ byte)])
}

const fn table() -> [u16; 256] {
    let mut table = [0_u16; 256];
    let mut index = 0;
    while index < 256 {
        let mut value = (index as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            value = if value & 0x8000 == 0 { value << 1 } else { (value << 1) ^ 0x8005 };
            bit += 1;
        }
        table[index] = value;
        index += 1;
    }
    table
}

/// A packet with any instruction. Parameters that do not fit in a packet are cut off.
pub fn request(id: u8, instruction: u8, parameters: &[u8]) -> Vec<u8> {
    let parameters = &parameters[..parameters.len().min(MAX_PACKET / 2)];
    let mut packet = HEADER.to_vec();
    packet.extend([id, 0, 0]);
    for &byte in std::iter::once(&instruction).chain(parameters) {
        packet.push(byte);
        if packet.len() >= FRONT + 3 && packet.ends_with(&HEADER[..3]) {
            packet.push(0xFD);
        }
    }
    let length = (packet.len() - FRONT + 2) as u16;
    packet[5..FRONT].copy_from_slice(&length.to_le_bytes());
    let crc = checksum(&packet);
    packet.extend(crc.to_le_bytes());
    packet
}

/// Is this servo there? It answers with its model (two bytes) and firmware version (one).
pub fn ping(id: u8) -> Vec<u8> {
    request(id, PING, &[])
}

/// Reads registers.
pub fn read(id: u8, address: u16, length: u16) -> Vec<u8> {
    request(id, READ, &[address.to_le_bytes(), length.to_le_bytes()].concat())
}

/// Writes registers.
pub fn write(id: u8, address: u16, data: &[u8]) -> Vec<u8> {
    request(id, WRITE, &[&address.to_le_bytes(), data].concat())
}

/// Reads the same registers of several servos; each answers with its own status, in this order.
pub fn sync_read(ids: &[u8], address: u16, length: u16) -> Vec<u8> {
    request(BROADCAST, SYNC_READ, &[&address.to_le_bytes(), &length.to_le_bytes(), ids].concat())
}

/// Reads the same registers of several servos; they answer with one combined status.
pub fn fast_sync_read(ids: &[u8], address: u16, length: u16) -> Vec<u8> {
    request(BROADCAST, FAST_SYNC_READ, &[&address.to_le_bytes(), &length.to_le_bytes(), ids].concat())
}

/// Bytes in a request when nothing in it is stuffed.
pub(super) const fn request_length(parameters: usize) -> usize {
    FRONT + 1 + parameters + 2
}

/// Finds statuses in a stream of bytes, and resynchronises after garbage. Echoes of requests are skipped.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: Vec<u8>,
    longest: usize,
    /// Data bytes of each piece, while a fast answer is awaited.
    piece: Option<usize>,
    /// Statuses found but not yet returned, last first.
    ready: Vec<Status>,
    counters: PacketCounters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self {
            buffer: Vec::new(),
            longest: MAX_PACKET,
            piece: None,
            ready: Vec::new(),
            counters: PacketCounters::default(),
        }
    }
}

impl Decoder {
    /// The counters so far.
    pub fn counters(&self) -> PacketCounters {
        self.counters
    }

    /// Data length of the longest expected status. A header that announces more is garbage and is not waited for.
    pub fn expect(&mut self, data_length: usize) {
        // Three bytes of data may have to be stuffed with a fourth. An echo of the request may be longer than the
        // answer.
        self.longest = (data_length + data_length / 3 + STATUS_OVERHEAD).clamp(64, MAX_PACKET);
        self.piece = None;
    }

    /// Expects a fast answer from this many servos with this much data each.
    pub fn expect_fast(&mut self, servos: usize, data_length: usize) {
        let answer = FAST_FRONT + servos * (PIECE_OVERHEAD + data_length);
        self.longest = answer.max(request_length(servos + 4)).clamp(64, MAX_PACKET);
        self.piece = Some(data_length);
    }

    /// Takes bytes as they arrive.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.buffer.extend_from_slice(bytes);
    }

    /// The next status; `None` until more bytes arrive. The pieces of a fast answer are returned as separate statuses.
    pub fn next_status(&mut self) -> Option<Status> {
        loop {
            if let Some(status) = self.ready.pop() {
                return Some(status);
            }
            let whole = self.packet_in_front()?;
            let covered = whole - 2;
            let packet = &self.buffer[..whole];
            if checksum(&packet[..covered]).to_le_bytes() == packet[covered..] {
                let packet: Vec<u8> = self.buffer.drain(..whole).collect();
                self.take_packet(&packet[..covered]);
            } else {
                self.counters.checksum_errors += 1;
                self.give_up_waiting();
            }
        }
    }

    /// Skips to a header; returns the length of its packet once that is complete.
    fn packet_in_front(&mut self) -> Option<usize> {
        loop {
            let starts = |at: usize| HEADER.iter().zip(&self.buffer[at..]).all(|(a, b)| a == b);
            let skipped = (0..self.buffer.len()).find(|&at| starts(at)).unwrap_or(self.buffer.len());
            self.discard(skipped);
            let &[_, _, _, _, id, low, high, ..] = &self.buffer[..] else { return None };
            let length = usize::from(u16::from_le_bytes([low, high]));
            if !(3..=self.longest - FRONT).contains(&length) || id == 0xFF {
                self.discard(1);
            } else if self.buffer.len() < FRONT + length {
                return None;
            } else {
                return Some(FRONT + length);
            }
        }
    }

    /// Takes a packet without its CRC, which was correct.
    fn take_packet(&mut self, packet: &[u8]) {
        if packet[FRONT] != STATUS {
            // The echo of a request.
            return;
        }
        match self.piece {
            Some(data_length) if packet[4] == BROADCAST => {
                let pieces = packet[FAST_FRONT..].chunks(data_length + PIECE_OVERHEAD);
                // The last piece's CRC is the packet's, which is cut off here.
                let statuses = pieces.filter(|piece| piece.len() >= data_length + 2).map(|piece| Status {
                    id: piece[1],
                    error: piece[0],
                    data: piece[2..2 + data_length].to_vec(),
                });
                self.ready.extend(statuses);
                self.ready.reverse();
            }
            _ => {
                let unstuffed = unstuff(&packet[FRONT + 1..]);
                let Some((&error, data)) = unstuffed.split_first() else { return };
                self.ready.push(Status { id: packet[4], error, data: data.to_vec() });
            }
        }
        self.counters.packets += self.ready.len() as u64;
    }

    /// Nothing more will arrive: gives up the pending packet, so that packets after its header are found. The pieces of
    /// a fast answer before the point where it broke off are kept if their own CRCs are correct. Call
    /// [`next_status`](Self::next_status) afterwards; returns whether anything is left to parse.
    pub fn give_up_waiting(&mut self) -> bool {
        if let Some(data_length) = self.piece
            && self.buffer.len() > FAST_FRONT
            && self.buffer[4] == BROADCAST
            && self.buffer[FRONT] == STATUS
        {
            let size = data_length + PIECE_OVERHEAD;
            let mut end = FAST_FRONT;
            while end + size <= self.buffer.len() {
                let piece = &self.buffer[end..end + size];
                if checksum(&self.buffer[..end + size - 2]).to_le_bytes() != piece[size - 2..] {
                    break;
                }
                let status = Status { id: piece[1], error: piece[0], data: piece[2..2 + data_length].to_vec() };
                self.ready.push(status);
                self.counters.packets += 1;
                end += size;
            }
            if end > FAST_FRONT {
                self.ready.reverse();
                self.buffer.drain(..end);
                return true;
            }
        }
        self.discard(1);
        !self.buffer.is_empty()
    }

    /// Discards any partly received packet, counting it as garbage.
    pub fn reset(&mut self) {
        self.discard(self.buffer.len());
        self.ready.clear();
    }

    fn discard(&mut self, count: usize) {
        let count = count.min(self.buffer.len());
        self.buffer.drain(..count);
        self.counters.discarded_bytes += count as u64;
    }
}

fn unstuff(stuffed: &[u8]) -> Vec<u8> {
    let mut plain = Vec::with_capacity(stuffed.len());
    let mut skip = false;
    for (at, &byte) in stuffed.iter().enumerate() {
        if skip && byte == 0xFD {
            skip = false;
            continue;
        }
        plain.push(byte);
        skip = at >= 2 && stuffed[at - 2..=at] == HEADER[..3];
    }
    plain
}

#[cfg(test)]
#[path = "dynamixel_tests.rs"]
mod tests;
