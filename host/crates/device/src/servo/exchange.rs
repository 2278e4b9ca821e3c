//! One request, its answers, and its echo.

use std::time::Duration;

use super::packet::Status;
use crate::arm::ServoProtocol;

/// A request whose answers are pending.
#[derive(Clone, Debug)]
pub(super) struct Exchange {
    /// The servos that have not answered, in the order in which they will.
    awaited: Vec<usize>,
    answers: Vec<(usize, Status)>,
    data_length: usize,
    sent: Duration,
    /// How long request and answers take on the wire when no servo waits.
    on_wire: Duration,
    deadline: Duration,
    /// The request as sent, until it is known whether the adapter echoes.
    request: Vec<u8>,
    /// Bytes that arrived in the meantime.
    held: Vec<u8>,
}

impl Exchange {
    /// Expects data of this length from each of these servos. `on_wire`: how long request and answers take when no
    /// servo waits; `grace`: how much longer they may take.
    pub(super) fn new(
        servos: Vec<usize>,
        data_length: usize,
        sent: Duration,
        on_wire: Duration,
        grace: Duration,
    ) -> Self {
        Self {
            awaited: servos,
            answers: Vec::new(),
            data_length,
            sent,
            on_wire,
            deadline: sent + on_wire + grace,
            request: Vec::new(),
            held: Vec::new(),
        }
    }

    pub(super) fn deadline(&self) -> Duration {
        self.deadline
    }

    /// Whether all servos have answered.
    pub(super) fn is_answered(&self) -> bool {
        self.awaited.is_empty()
    }

    /// Takes an answer if it is one of those expected.
    pub(super) fn take(&mut self, servo: Option<usize>, status: Status) -> bool {
        let Some(at) = self.awaited.iter().position(|&awaited| Some(awaited) == servo) else { return false };
        if status.data.len() != self.data_length {
            return false;
        }
        let servo = self.awaited.remove(at);
        self.answers.push((servo, status));
        true
    }

    /// The time that adapter and system added to the time on the wire, if all have answered by now; `return_delay` is
    /// how long each servo itself waited.
    pub(super) fn added(&self, now: Duration, return_delay: impl Fn(usize) -> Duration) -> Option<Duration> {
        if !self.awaited.is_empty() || self.answers.is_empty() {
            return None;
        }
        let delays: Duration = self.answers.iter().map(|(servo, _)| return_delay(*servo)).sum();
        Some(now.saturating_sub(self.sent).saturating_sub(self.on_wire + delays))
    }

    /// Which servos answered, with what, and which did not.
    pub(super) fn into_answers(self) -> (Vec<(usize, Status)>, Vec<usize>) {
        (self.answers, self.awaited)
    }
}

/// Whether the adapter echoes what is written to it. On a Feetech bus a request looks like an answer, so this has to be
/// known; it is learnt when model numbers are read, because that request cannot be mistaken for an answer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Echo {
    #[default]
    Unknown,
    Yes,
}

impl Echo {
    /// Prepares an exchange for a possible echo. `is_telling`: whether the request cannot be mistaken for an answer.
    pub(super) fn watch(self, protocol: ServoProtocol, exchange: &mut Exchange, request: &[u8], is_telling: bool) {
        // Dynamixel echoes differ from answers by their instruction.
        let watched = protocol == ServoProtocol::Feetech && (self == Self::Yes || is_telling);
        exchange.request = if watched { request.to_vec() } else { Vec::new() };
    }

    /// Passes on everything but the echo.
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
