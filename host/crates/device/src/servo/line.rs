//! The line to a bus: sends one request at a time, receives its answers, and learns how much time adapter and system
//! add to the time on the wire.

use std::time::Duration;

use super::bus::{BusDecoder, ReadMode, on_wire};
use super::exchange::{Echo, Exchange};
use super::packet::{PacketCounters, Status};
use super::task::Task;
use crate::arm::ServoProtocol;

/// What a request is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Purpose {
    Task {
        task: Task,
        /// Whether the request cannot be mistaken for an answer, see [`Echo`].
        is_telling: bool,
    },
    /// The positions of a group of servos, read in this mode.
    Positions(ReadMode),
}

/// A request, the servos that should answer, and the data length of each answer.
#[derive(Debug)]
pub(super) struct Request {
    pub(super) purpose: Purpose,
    pub(super) bytes: Vec<u8>,
    pub(super) servos: Vec<usize>,
    pub(super) data_length: usize,
    /// How long all the servos together may wait before they answer.
    pub(super) return_delays: Duration,
}

/// The outcome of a request.
#[derive(Debug)]
pub(super) struct Concluded {
    pub(super) purpose: Purpose,
    pub(super) answers: Vec<(usize, Status)>,
    /// Those that did not answer, in the order in which they would have.
    pub(super) silent: Vec<usize>,
}

/// The line to a bus.
#[derive(Clone, Debug)]
pub(super) struct Line {
    protocol: ServoProtocol,
    /// The servos' numbers on the bus, by their place in the arm.
    ids: Vec<u8>,
    patience: Duration,
    baud: u32,
    decoder: BusDecoder,
    outgoing: Vec<u8>,
    echo: Echo,
    pending: Option<(Purpose, Exchange)>,
    /// What adapter and system add to an exchange: the minimum, and a slowly decaying maximum.
    held_back: Option<(Duration, Duration)>,
    bytes: u64,
    unexpected: u64,
}

impl Line {
    pub(super) fn new(protocol: ServoProtocol, ids: Vec<u8>, baud: u32, patience: Duration) -> Self {
        Self {
            protocol,
            ids,
            patience,
            baud,
            decoder: BusDecoder::new(protocol),
            outgoing: Vec::new(),
            echo: Echo::Unknown,
            pending: None,
            held_back: None,
            bytes: 0,
            unexpected: 0,
        }
    }

    /// Bits per second.
    pub(super) fn baud(&self) -> u32 {
        self.baud
    }

    /// Changes to another speed; what was learnt about the adapter's delays is discarded.
    pub(super) fn set_baud(&mut self, baud: u32) {
        self.baud = baud;
        self.held_back = None;
    }

    /// The line was reopened: anything in transit is lost.
    pub(super) fn reopened(&mut self) {
        self.decoder.reset();
        self.outgoing.clear();
        self.pending = None;
    }

    pub(super) fn take_outgoing(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.outgoing)
    }

    /// The least time that adapter and system have added to an exchange.
    pub(super) fn least_held_back(&self) -> Option<Duration> {
        self.held_back.map(|(least, _)| least)
    }

    /// The decoder's counters.
    pub(super) fn packets(&self) -> PacketCounters {
        self.decoder.counters()
    }

    /// Bytes received.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Answers that nobody expected.
    pub(super) fn unexpected(&self) -> u64 {
        self.unexpected
    }

    /// Whether answers are pending.
    pub(super) fn is_busy(&self) -> bool {
        self.pending.is_some()
    }

    /// Until when answers are expected.
    pub(super) fn deadline(&self) -> Option<Duration> {
        self.pending.as_ref().map(|(_, exchange)| exchange.deadline())
    }

    /// Sends a request and waits for its answers.
    pub(super) fn send(&mut self, now: Duration, request: Request) {
        let Request { purpose, bytes, servos, data_length, return_delays } = request;
        let (mode, is_telling) = match purpose {
            Purpose::Positions(mode) => (mode, false),
            Purpose::Task { is_telling, .. } => (ReadMode::Single, is_telling),
        };
        let count = servos.len();
        let wire = on_wire(bytes.len() + self.protocol.answer_length(mode, count, data_length), self.baud);
        let patience = match (purpose, self.held_back) {
            (Purpose::Positions(_), Some((_, most))) => (most * 3 + Duration::from_millis(3)).min(self.patience),
            _ => self.patience,
        };
        let mut exchange = Exchange::new(servos, data_length, now, wire, return_delays + patience);
        self.echo.watch(self.protocol, &mut exchange, &bytes, is_telling);
        self.decoder.reset();
        self.decoder.expect(mode, count, data_length);
        self.pending = Some((purpose, exchange));
        self.outgoing.extend_from_slice(&bytes);
    }

    /// Takes bytes that have arrived.
    pub(super) fn receive(&mut self, bytes: &[u8]) {
        self.bytes += bytes.len() as u64;
        if let Some((_, exchange)) = &mut self.pending {
            let answer = self.echo.strip(exchange, bytes);
            self.decoder.receive(&answer);
            self.take_statuses();
        } else {
            self.decoder.receive(bytes);
            self.decoder.reset();
        }
    }

    /// The outcome of the request, once all have answered or its time is over.
    pub(super) fn conclude(&mut self, now: Duration, return_delay: impl Fn(usize) -> Duration) -> Option<Concluded> {
        let (_, exchange) = self.pending.as_ref()?;
        if !exchange.is_answered() {
            if now < exchange.deadline() {
                return None;
            }
            while self.decoder.give_up_waiting() {
                self.take_statuses();
            }
            self.take_statuses();
        }
        let (purpose, exchange) = self.pending.take()?;
        if let Some(added) = exchange.added(now, return_delay) {
            self.held_back = Some(match self.held_back {
                None => (added, added),
                Some((least, most)) => (least.min(added), added.max(most.mul_f64(63.0 / 64.0))),
            });
        }
        let (answers, silent) = exchange.into_answers();
        Some(Concluded { purpose, answers, silent })
    }

    fn take_statuses(&mut self) {
        while let Some(status) = self.decoder.next_status() {
            let servo = self.ids.iter().position(|&id| id == status.id);
            let taken = self.pending.as_mut().is_some_and(|(_, exchange)| exchange.take(servo, status));
            self.unexpected += u64::from(!taken);
        }
    }
}
