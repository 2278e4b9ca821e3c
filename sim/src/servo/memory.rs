//! A servo's registers.

use super::settings::{BusKind, SimulatedServo};

/// The control table of one servo.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    kind: BusKind,
    bytes: Vec<u8>,
}

const FEETECH_BAUDS: &[u32] = &[1_000_000, 500_000, 250_000, 128_000, 115_200];
const DYNAMIXEL_BAUDS: &[u32] = &[9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000];

impl Memory {
    pub(super) fn new(kind: BusKind, servo: &SimulatedServo, baud: u32) -> Self {
        let length = if kind == BusKind::Feetech { 86 } else { 256 };
        let mut memory = Self { kind, bytes: vec![0; length] };
        let bauds = if kind == BusKind::Feetech { FEETECH_BAUDS } else { DYNAMIXEL_BAUDS };
        let at = memory.places();
        memory.bytes[at.model..at.model + 2].copy_from_slice(&servo.model.to_le_bytes());
        memory.bytes[at.id] = servo.id;
        memory.bytes[at.id + 1] = bauds.iter().position(|&known| known == baud).unwrap_or(0) as u8;
        memory.bytes[at.delay] = servo.return_delay_units;
        // As the last user left it.
        memory.bytes[at.torque] = u8::from(servo.torque);
        if let Some(lock) = at.lock {
            memory.bytes[lock] = 1;
        }
        memory
    }

    fn places(&self) -> Places {
        match self.kind {
            BusKind::Feetech => Places { model: 3, id: 5, delay: 7, torque: 40, lock: Some(55), position: 56, ram: 40 },
            BusKind::Dynamixel => Places { model: 0, id: 7, delay: 9, torque: 64, lock: None, position: 132, ram: 64 },
        }
    }

    pub(super) fn id(&self) -> u8 {
        self.bytes[self.places().id]
    }

    pub(super) fn return_delay_units(&self) -> u64 {
        u64::from(self.bytes[self.places().delay])
    }

    pub(super) fn ping_data(&self) -> Vec<u8> {
        match self.kind {
            BusKind::Feetech => Vec::new(),
            BusKind::Dynamixel => vec![self.bytes[0], self.bytes[1], 52],
        }
    }

    pub(super) fn read(&self, address: u16, length: u16) -> Option<Vec<u8>> {
        let from = usize::from(address);
        self.bytes.get(from..from + usize::from(length)).filter(|bytes| !bytes.is_empty()).map(<[u8]>::to_vec)
    }

    /// Writes registers; returns whether any value that survives power-off changed.
    pub(super) fn write(&mut self, address: u16, data: &[u8]) -> bool {
        let from = usize::from(address);
        let at = self.places();
        let keeps = from < at.ram;
        let locked = match at.lock {
            // An unlocked Feetech servo keeps what is written; a locked one forgets it when it is switched off.
            Some(lock) => self.bytes[lock] != 0,
            None => self.bytes[at.torque] != 0,
        };
        if keeps && locked {
            return false;
        }
        if let Some(target) = self.bytes.get_mut(from..from + data.len()) {
            target.copy_from_slice(data);
        }
        keeps
    }

    pub(super) fn set_position(&mut self, counts: i32) {
        let at = self.places().position;
        match self.kind {
            BusKind::Feetech => {
                let magnitude = counts.unsigned_abs().min(0x7FFF) as u16;
                let word = magnitude | if counts < 0 { 0x8000 } else { 0 };
                self.bytes[at..at + 2].copy_from_slice(&word.to_le_bytes());
            }
            BusKind::Dynamixel => self.bytes[at..at + 4].copy_from_slice(&counts.to_le_bytes()),
        }
    }
}

struct Places {
    model: usize,
    id: usize,
    delay: usize,
    torque: usize,
    lock: Option<usize>,
    position: usize,
    /// Registers below this keep their value without power.
    ram: usize,
}
