//! One request and the answers to it.

use std::time::Duration;

use super::arm::ServoProtocol;
use super::packet::Status;

/// What a request is for. Servos are named by their place in the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Task(Task),
    /// The positions of a group of servos.
    Positions,
}

/// Something done with one servo, outside of the stream of positions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Task {
    pub(super) servo: usize,
    pub(super) step: Step,
    /// How often it has been tried.
    pub(super) tried: u32,
}

/// What is done with it.
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

/// A request whose answers are awaited.
#[derive(Clone, Debug)]
pub(super) struct Exchange {
    pub(super) purpose: Purpose,
    /// The servos that have not answered, in the order in which they will.
    pub(super) awaited: Vec<usize>,
    pub(super) answers: Vec<(usize, Status)>,
    pub(super) data_length: usize,
    pub(super) sent: Duration,
    /// How long request and answers take on the wire, with nobody waiting.
    pub(super) on_wire: Duration,
    pub(super) deadline: Duration,
    /// The request as sent, while it is open whether the adapter echoes.
    request: Vec<u8>,
    /// Bytes that came while that is open.
    held: Vec<u8>,
}

impl Exchange {
    pub(super) fn new(
        purpose: Purpose,
        servos: &[usize],
        data_length: usize,
        times: (Duration, Duration, Duration),
    ) -> Self {
        let (sent, on_wire, deadline) = times;
        Self {
            purpose,
            awaited: servos.to_vec(),
            answers: Vec::new(),
            data_length,
            sent,
            on_wire,
            deadline,
            request: Vec::new(),
            held: Vec::new(),
        }
    }

    /// Takes an answer if it is one of those awaited.
    pub(super) fn take(&mut self, servo: Option<usize>, status: Status) -> bool {
        let Some(at) = self.awaited.iter().position(|&awaited| Some(awaited) == servo) else { return false };
        if status.data.len() != self.data_length {
            return false;
        }
        let servo = self.awaited.remove(at);
        self.answers.push((servo, status));
        true
    }
}

/// Whether the adapter sends back what is written to it. On a Feetech bus a request looks like an answer, so this has
/// to be known; it is learnt from the reading of model numbers, whose request can be no answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Echo {
    #[default]
    Unknown,
    Yes,
}

impl Echo {
    /// Prepares an exchange for what the adapter may send back.
    pub(super) fn watch(self, protocol: ServoProtocol, exchange: &mut Exchange, request: &[u8]) {
        let is_telling = matches!(exchange.purpose, Purpose::Task(Task { step: Step::ReadModel, .. }));
        // Dynamixel echoes are told from answers by their instruction.
        let watched = protocol == ServoProtocol::Feetech && (self == Self::Yes || is_telling);
        exchange.request = if watched { request.to_vec() } else { Vec::new() };
    }

    /// Passes on what is no echo.
    pub(super) fn strip(&mut self, exchange: &mut Exchange, bytes: &[u8]) -> Vec<u8> {
        if exchange.request.is_empty() {
            return bytes.to_vec();
        }
        exchange.held.extend_from_slice(bytes);
        let compared = exchange.held.len().min(exchange.request.len());
        if exchange.held[..compared] != exchange.request[..compared] {
            exchange.request.clear();
            return std::mem::take(&mut exchange.held);
        }
        if compared < exchange.request.len() {
            return Vec::new();
        }
        *self = Self::Yes;
        exchange.request.clear();
        let rest = exchange.held.split_off(compared);
        exchange.held.clear();
        rest
    }
}
