//! A task for a single servo, outside the stream of positions.

use super::bus::Registers;
use super::settings::EepromConsent;
use crate::arm::ServoProtocol;

/// What the task is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
    ReadModel,
    TorqueOff,
    ReadTorque,
    ReadReturnDelay,
    Unlock,
    ClearReturnDelay,
    Lock,
    Light { on: bool },
}

/// One step for one servo, identified by its place in the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    servo: usize,
    step: Step,
    tried: u32,
}

impl Task {
    pub(super) const fn new(servo: usize, step: Step) -> Self {
        Self { servo, step, tried: 0 }
    }

    /// This step for the same servo, tried this often so far.
    pub(super) const fn and_then(self, step: Step, tried: u32) -> Self {
        Self { servo: self.servo, step, tried }
    }

    pub(super) const fn servo(self) -> usize {
        self.servo
    }

    pub(super) const fn step(self) -> Step {
        self.step
    }

    /// How often it has been tried.
    pub(super) const fn tried(self) -> u32 {
        self.tried
    }

    /// The request for the servo with this number on the bus, and the length of the answer's data; `None` if such
    /// servos have no register for it, or it may not be written.
    pub(super) fn request(self, protocol: ServoProtocol, id: u8, consent: EepromConsent) -> Option<(Vec<u8>, usize)> {
        let registers: Registers = protocol.registers();
        Some(match self.step {
            Step::ReadModel => (protocol.read(id, registers.model, 2), 2),
            Step::ReadTorque => (protocol.read(id, registers.torque, 1), 1),
            Step::ReadReturnDelay => (protocol.read(id, registers.return_delay, 1), 1),
            Step::TorqueOff => (protocol.write(id, registers.torque, &[0]), 0),
            Step::Unlock | Step::Lock => (protocol.write(id, registers.lock?, &[u8::from(self.step == Step::Lock)]), 0),
            Step::ClearReturnDelay => {
                // The only place that writes registers that wear out.
                if consent != EepromConsent::ReturnDelayZero || registers.return_delay >= registers.ram_begins {
                    return None;
                }
                (protocol.write(id, registers.return_delay, &[0]), 0)
            }
            Step::Light { on } => (protocol.write(id, registers.light?, &[u8::from(on)]), 0),
        })
    }
}
