//! The servos' side of both wire formats.

use super::settings::BusKind;

/// All servos.
pub(super) const BROADCAST: u8 = 0xFE;
const HEADER: [u8; 4] = [0xFF, 0xFF, 0xFD, 0x00];
const STATUS: u8 = 0x55;
/// Longest request that the bus waits for.
const LONGEST: usize = 600;

/// A request from the host.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Request {
    Ping { id: u8 },
    Read { id: u8, address: u16, length: u16 },
    Write { id: u8, address: u16, data: Vec<u8> },
    SyncRead { fast: bool, ids: Vec<u8>, address: u16, length: u16 },
}

/// Bytes from the host, collected into requests.
#[derive(Clone, Debug)]
pub(super) struct Requests {
    kind: BusKind,
    bytes: Vec<u8>,
}

impl Requests {
    pub(super) fn new(kind: BusKind) -> Self {
        Self { kind, bytes: Vec::new() }
    }

    pub(super) fn forget(&mut self) {
        self.bytes.clear();
    }

    pub(super) fn receive(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// The next complete request that these servos understand.
    pub(super) fn next_request(&mut self) -> Option<Request> {
        loop {
            let header = self.kind.header();
            let skipped = self.bytes.windows(header.len()).position(|window| window == header)?;
            self.bytes.drain(..skipped);
            let (front, length) = match (self.kind, &self.bytes[..]) {
                (BusKind::Feetech, [_, _, _, length, ..]) => (4, usize::from(*length)),
                (BusKind::Dynamixel, [_, _, _, _, _, low, high, ..]) => {
                    (7, usize::from(u16::from_le_bytes([*low, *high])))
                }
                _ => return None,
            };
            if length < self.kind.check_length() + 1 || front + length > LONGEST {
                self.bytes.drain(..1);
                continue;
            }
            if self.bytes.len() < front + length {
                return None;
            }
            let packet: Vec<u8> = self.bytes.drain(..front + length).collect();
            let (covered, check) = packet.split_at(packet.len() - self.kind.check_length());
            if self.kind.check(covered) != check {
                continue;
            }
            let id = covered[self.kind.header().len()];
            let plain = self.kind.plain(&covered[front..]);
            let Some((&instruction, parameters)) = plain.split_first() else { continue };
            if let Some(request) = self.kind.request(id, instruction, parameters) {
                return Some(request);
            }
        }
    }
}

impl BusKind {
    fn header(self) -> &'static [u8] {
        match self {
            Self::Feetech => &HEADER[..2],
            Self::Dynamixel => &HEADER,
        }
    }

    fn check_length(self) -> usize {
        match self {
            Self::Feetech => 1,
            Self::Dynamixel => 2,
        }
    }

    fn check(self, covered: &[u8]) -> Vec<u8> {
        match self {
            Self::Feetech => vec![!covered[2..].iter().fold(0_u8, |sum, byte| sum.wrapping_add(*byte))],
            Self::Dynamixel => crc(covered).to_le_bytes().to_vec(),
        }
    }

    /// Removes the stuffing.
    fn plain(self, bytes: &[u8]) -> Vec<u8> {
        let mut plain: Vec<u8> = Vec::with_capacity(bytes.len());
        let mut run = 0;
        for &byte in bytes {
            if self == Self::Dynamixel && run == 3 && byte == 0xFD {
                run = 0;
                continue;
            }
            run = match (run, byte) {
                (2, 0xFD) => 3,
                (2 | 3, 0xFF) => {
                    if run == 2 {
                        2
                    } else {
                        1
                    }
                }
                (run, 0xFF) => run + 1,
                _ => 0,
            };
            plain.push(byte);
        }
        plain
    }

    fn request(self, id: u8, instruction: u8, parameters: &[u8]) -> Option<Request> {
        let width = if self == Self::Feetech { 1 } else { 2 };
        let number = |bytes: &[u8]| bytes.iter().rev().fold(0_u16, |number, byte| number << 8 | u16::from(*byte));
        let fields = |count: usize| (parameters.len() >= count * width).then(|| parameters.split_at(count * width));
        match instruction {
            0x01 => Some(Request::Ping { id }),
            0x02 => fields(2).map(|(head, _)| {
                let (address, length) = head.split_at(width);
                Request::Read { id, address: number(address), length: number(length) }
            }),
            0x03 => fields(1).map(|(head, data)| Request::Write { id, address: number(head), data: data.to_vec() }),
            0x82 | 0x8A if instruction == 0x82 || self == Self::Dynamixel => fields(2).map(|(head, ids)| {
                let (address, length) = head.split_at(width);
                let (address, length) = (number(address), number(length));
                Request::SyncRead { fast: instruction == 0x8A, ids: ids.to_vec(), address, length }
            }),
            _ => None,
        }
    }
}

/// A servo's answer.
pub(super) fn status(kind: BusKind, id: u8, error: u8, data: &[u8]) -> Vec<u8> {
    let mut packet = kind.header().to_vec();
    packet.push(id);
    match kind {
        BusKind::Feetech => {
            packet.extend([data.len() as u8 + 2, error]);
            packet.extend_from_slice(data);
        }
        BusKind::Dynamixel => {
            let mut body = vec![STATUS];
            for &byte in std::iter::once(&error).chain(data) {
                body.push(byte);
                if body.ends_with(&HEADER[..3]) {
                    body.push(0xFD);
                }
            }
            packet.extend((body.len() as u16 + 2).to_le_bytes());
            packet.extend(body);
        }
    }
    packet.extend(kind.check(&packet));
    packet
}

/// What comes before the first servo's piece of a combined answer.
pub(super) fn fast_front(servos: usize, data_length: usize) -> Vec<u8> {
    let mut packet = HEADER.to_vec();
    packet.push(BROADCAST);
    packet.extend(((servos * (data_length + 4) + 1) as u16).to_le_bytes());
    packet.push(STATUS);
    packet
}

/// A servo's piece; its checksum covers everything before it.
pub(super) fn add_fast_piece(packet: &mut Vec<u8>, id: u8, data: &[u8]) {
    packet.extend([0, id]);
    packet.extend_from_slice(data);
    let check = crc(packet);
    packet.extend(check.to_le_bytes());
}

/// CRC-16, polynomial 8005, bit by bit.
fn crc(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc: u16, &byte| {
        (0..8).fold(crc ^ (u16::from(byte) << 8), |c, _| if c & 0x8000 == 0 { c << 1 } else { (c << 1) ^ 0x8005 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(kind: BusKind, text: &str) -> Option<Request> {
        let mut requests = Requests::new(kind);
        requests.receive(&bytes(text));
        requests.next_request()
    }

    fn bytes(text: &str) -> Vec<u8> {
        text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
    }

    #[test]
    fn published_requests_are_understood() {
        use BusKind::{Dynamixel, Feetech};
        assert_eq!(one(Feetech, "FF FF 01 02 01 FB"), Some(Request::Ping { id: 1 }));
        assert_eq!(one(Feetech, "00 FF FF 01 04 02 38 02 BE"), Some(Request::Read { id: 1, address: 56, length: 2 }));
        let sync = |fast, address, length| Request::SyncRead { fast, ids: vec![1, 2], address, length };
        assert_eq!(one(Feetech, "FF FF FE 06 82 38 02 01 02 3C"), Some(sync(false, 56, 2)));
        assert_eq!(one(Feetech, "FF FF 01 04 03 28 00 CF"), Some(Request::Write { id: 1, address: 40, data: vec![0] }));
        assert_eq!(one(Feetech, "FF FF 01 04 03 28 00 CE"), None);
        assert_eq!(one(Dynamixel, "FF FF FD 00 FE 03 00 01 31 42"), Some(Request::Ping { id: 0xFE }));
        let read = Request::Read { id: 1, address: 132, length: 4 };
        assert_eq!(one(Dynamixel, "FF FF FD 00 01 07 00 02 84 00 04 00 1D 15"), Some(read));
        assert_eq!(one(Dynamixel, "FF FF FD 00 FE 09 00 82 84 00 04 00 01 02 CE FA"), Some(sync(false, 132, 4)));
        assert_eq!(one(Dynamixel, "FF FF FD 00 FE 09 00 8A 84 00 04 00 01 02 4D 72"), Some(sync(true, 132, 4)));
    }

    #[test]
    fn published_statuses_are_written() {
        assert_eq!(status(BusKind::Feetech, 1, 0, &[0x64, 0x80]), bytes("FF FF 01 04 00 64 80 16"));
        let stuffed = bytes("FF FF FD 00 01 0F 00 55 00 FF FF FD FD FF FF FF 00 08 00 00 49 F0");
        let data = bytes("FF FF FD FF FF FF 00 08 00 00");
        assert_eq!(status(BusKind::Dynamixel, 1, 0, &data), stuffed);
        assert_eq!(BusKind::Dynamixel.plain(&bytes("55 00 FF FF FD FD FF FF FF 00 08 00 00"))[2..], data);
    }
}
