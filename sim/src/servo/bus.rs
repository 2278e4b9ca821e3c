//! The bus: requests in, answers out, at the speed of the wire.

use std::collections::VecDeque;

use super::memory::Memory;
use super::packets::{self, Request, Requests};
use super::settings::{BusKind, ServoBusError, ServoBusSettings};
use crate::faults::{NoiseBurst, SensorFaultKind};
use crate::random::Random;

const NANOS_PER_MICRO: u64 = 1_000;
/// A request interrupted for longer than this is discarded; until then the bus waits for the host to finish it.
const FORGET_NANOS: u64 = 50_000_000;

/// What really happened on a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoBusTruth {
    /// Requests understood.
    pub requests: u64,
    /// Position readings put on the wire.
    pub readings_sent: u64,
    /// Readings suppressed by a fault.
    pub readings_missing: u64,
    /// Bytes damaged, lost or repeated on the way to the host.
    pub bytes_damaged: u64,
    /// Bytes of noise.
    pub noise_bytes: u64,
    /// Writes to registers that keep their value without power.
    pub eeprom_writes: u64,
    /// Bytes received at a speed other than the bus's own.
    pub bytes_at_wrong_speed: u64,
}

/// A bus with servos on it.
#[derive(Clone, Debug)]
pub struct ServoBus {
    settings: ServoBusSettings,
    memories: Vec<Memory>,
    requests: Requests,
    random: Random,
    origin: Option<u64>,
    now: u64,
    /// Until when the wire is taken.
    busy_until: u64,
    last_heard: u64,
    /// Bytes on their way to the host, and when each has come.
    on_the_way: VecDeque<(u64, u8)>,
    noise_from: u64,
    truth: ServoBusTruth,
}

impl ServoBus {
    /// A bus that its first [`step`](Self::step) switches on.
    pub fn new(settings: ServoBusSettings) -> Result<Self, ServoBusError> {
        settings.check()?;
        Ok(Self {
            memories: settings.servos.iter().map(|servo| Memory::new(settings.kind, servo, settings.baud)).collect(),
            requests: Requests::new(settings.kind),
            random: Random::new(settings.seed, 4),
            origin: None,
            now: 0,
            busy_until: 0,
            last_heard: 0,
            on_the_way: VecDeque::new(),
            noise_from: 0,
            truth: ServoBusTruth::default(),
            settings,
        })
    }

    /// Advances the clock to `now_nanos`, reads what the host has just written with its line at `host_baud`, and
    /// appends to `bytes_out` everything that has reached the host by now. A time before the latest step counts as that
    /// step's time.
    pub fn step(&mut self, now_nanos: u64, host_baud: u32, bytes_in: &[u8], bytes_out: &mut Vec<u8>) {
        self.now = self.now.max(now_nanos);
        let origin = *self.origin.get_or_insert(now_nanos);
        self.make_noise(origin);
        if !bytes_in.is_empty() {
            self.hear(host_baud, bytes_in);
        }
        while let Some(&(at, byte)) = self.on_the_way.front().filter(|(at, _)| *at <= self.now) {
            self.on_the_way.pop_front();
            // Read at another speed, a byte becomes some other byte.
            let garbled = host_baud != self.settings.baud && at > 0;
            bytes_out.push(if garbled { byte.rotate_left(3) ^ 0x5A } else { byte });
        }
    }

    /// The next time at which something reaches the host unprompted; `None` while all wait for the host.
    pub fn next_due_nanos(&self) -> Option<u64> {
        let noise = self.burst_at(self.now).map(|_| self.now + 1_000_000);
        self.on_the_way.front().map(|(at, _)| *at).into_iter().chain(noise).min()
    }

    /// Which wire format it speaks.
    pub fn kind(&self) -> BusKind {
        self.settings.kind
    }

    /// What really happened.
    pub fn truth(&self) -> ServoBusTruth {
        self.truth
    }

    /// A register of a servo, as the host would read it.
    pub fn register(&self, servo: usize, address: u16) -> Option<u8> {
        self.memories.get(servo).and_then(|memory| memory.read(address, 1)).map(|bytes| bytes[0])
    }

    /// A servo's true position at a time, counts; what its position register would hold if nothing were wrong.
    pub fn true_counts(&self, servo: usize, at_nanos: u64) -> i32 {
        self.settings.servos[servo].counts_at(at_nanos.saturating_sub(self.origin.unwrap_or(0)))
    }

    fn hear(&mut self, host_baud: u32, bytes: &[u8]) {
        if self.now > self.last_heard.saturating_add(FORGET_NANOS) {
            self.requests.forget();
        }
        self.last_heard = self.now;
        let begins = self.now.max(self.busy_until);
        self.busy_until = begins + bytes.len() as u64 * self.nanos_per_byte();
        if host_baud != self.settings.baud {
            self.truth.bytes_at_wrong_speed += bytes.len() as u64;
            self.requests.forget();
            return;
        }
        if self.settings.echo {
            let mut at = begins;
            for &byte in bytes {
                at += self.nanos_per_byte();
                self.deliver(at, byte);
            }
        }
        self.requests.receive(bytes);
        while let Some(request) = self.requests.next_request() {
            self.truth.requests += 1;
            self.answer(&request);
        }
    }

    fn answer(&mut self, request: &Request) {
        match request {
            Request::Ping { id } => {
                for servo in self.addressed(*id) {
                    let data = self.memories[servo].ping_data();
                    self.send_status(servo, &data);
                }
            }
            Request::Read { id, address, length } => {
                if let Some(servo) = self.find(*id).filter(|&servo| !self.is_silent(servo)) {
                    self.update_position(servo, *address);
                    match self.memories[servo].read(*address, *length) {
                        Some(data) => self.send_status(servo, &data),
                        None => self.send_error(servo),
                    }
                }
            }
            Request::Write { id, address, data } => {
                for servo in self.addressed(*id) {
                    self.truth.eeprom_writes += u64::from(self.memories[servo].write(*address, data));
                    if *id < packets::BROADCAST {
                        self.send_status(servo, &[]);
                    }
                }
            }
            Request::SyncRead { fast, ids, address, length } => self.answer_together(*fast, ids, *address, *length),
        }
    }

    /// One servo after another, until one is missing.
    fn answer_together(&mut self, fast: bool, ids: &[u8], address: u16, length: u16) {
        if fast && !self.settings.knows_fast_reads {
            return;
        }
        let mut common = packets::fast_front(ids.len(), usize::from(length));
        let mut sent = 0;
        for (turn, &id) in ids.iter().enumerate() {
            let answering = self.find(id).filter(|&servo| !self.is_silent(servo));
            let Some(servo) = answering else {
                self.truth.readings_missing += (ids.len() - turn) as u64;
                return;
            };
            self.update_position(servo, address);
            let Some(data) = self.memories[servo].read(address, length) else { return };
            self.truth.readings_sent += 1;
            if fast {
                packets::add_fast_piece(&mut common, id, &data);
                // Only the first servo waits; each piece leaves when it is its turn.
                let delay = if turn == 0 { self.return_delay_nanos(servo) } else { 0 };
                let piece = common[sent..].to_vec();
                sent = common.len();
                self.transmit(delay, &piece);
            } else {
                self.send_status(servo, &data);
            }
        }
    }

    fn update_position(&mut self, servo: usize, _address: u16) {
        let at = self.now.saturating_sub(self.origin.unwrap_or(0));
        let fault = self.fault_of(servo);
        let counts = self.settings.servos[servo].counts_at(at);
        if fault != Some(SensorFaultKind::Stuck) {
            self.memories[servo].set_position(counts);
        }
    }

    fn addressed(&self, id: u8) -> Vec<usize> {
        let all = 0..self.memories.len();
        all.filter(|&s| (id == packets::BROADCAST || self.memories[s].id() == id) && !self.is_silent(s)).collect()
    }

    fn find(&self, id: u8) -> Option<usize> {
        self.memories.iter().position(|memory| memory.id() == id)
    }

    fn fault_of(&self, servo: usize) -> Option<SensorFaultKind> {
        let micros = self.now.saturating_sub(self.origin.unwrap_or(0)) / NANOS_PER_MICRO;
        let during = |start: u64, duration: u64| micros >= start && micros - start < duration;
        let faults = &self.settings.faults;
        let pulled = faults.unplugged.iter().any(|pull| {
            // A daisy chain: when a servo is missing, so are all behind it.
            pull.part <= servo && micros >= pull.at_micros && pull.for_micros.is_none_or(|f| during(pull.at_micros, f))
        });
        if pulled {
            return Some(SensorFaultKind::NoData);
        }
        let fault = faults.sensors.iter().find(|f| f.sensor == servo && during(f.start_micros, f.duration_micros));
        fault.map(|fault| fault.kind)
    }

    fn is_silent(&self, servo: usize) -> bool {
        self.fault_of(servo) == Some(SensorFaultKind::NoData)
    }

    fn return_delay_nanos(&self, servo: usize) -> u64 {
        self.memories[servo].return_delay_units() * 2 * NANOS_PER_MICRO
    }

    fn send_status(&mut self, servo: usize, data: &[u8]) {
        let packet = packets::status(self.settings.kind, self.memories[servo].id(), 0, data);
        self.transmit(self.return_delay_nanos(servo), &packet);
    }

    /// For a register that does not exist a Dynamixel reports an error; a Feetech servo does not answer anything useful
    /// either.
    fn send_error(&mut self, servo: usize) {
        let packet = packets::status(self.settings.kind, self.memories[servo].id(), 7, &[]);
        self.transmit(self.return_delay_nanos(servo), &packet);
    }

    /// Puts bytes on the wire as soon as it is free.
    fn transmit(&mut self, delay_nanos: u64, packet: &[u8]) {
        let mut at = self.busy_until.max(self.now) + delay_nanos;
        let noisy = self.burst_at(at).is_some();
        for &byte in packet {
            at += self.nanos_per_byte();
            if noisy {
                continue;
            }
            let faults = &self.settings.faults;
            if self.random.chance(faults.byte_drop) {
                self.truth.bytes_damaged += 1;
                continue;
            }
            let mut byte = byte;
            if self.random.chance(faults.bit_flip) {
                self.truth.bytes_damaged += 1;
                byte ^= 1 << (self.random.next_u64() & 7);
            }
            let twice = self.random.chance(faults.byte_duplicate);
            self.deliver(at, byte);
            if twice {
                self.truth.bytes_damaged += 1;
                self.deliver(at, byte);
            }
        }
        self.busy_until = at;
    }

    fn deliver(&mut self, at: u64, byte: u8) {
        let held = self.settings.adapter_latency_micros * NANOS_PER_MICRO;
        self.on_the_way.push_back((at + held, byte));
    }

    fn burst_at(&self, nanos: u64) -> Option<NoiseBurst> {
        let micros = nanos.saturating_sub(self.origin.unwrap_or(0)) / NANOS_PER_MICRO;
        let during = |b: &&NoiseBurst| micros >= b.start_micros && micros - b.start_micros < b.duration_micros;
        self.settings.faults.noise.iter().find(during).copied()
    }

    /// During a burst the line carries noise at its own speed.
    fn make_noise(&mut self, origin: u64) {
        if self.burst_at(self.now).is_none() {
            self.noise_from = self.now;
            return;
        }
        let from = self.noise_from.max(origin);
        let count = (self.now - from) / self.nanos_per_byte();
        self.noise_from = from + count * self.nanos_per_byte();
        for _ in 0..count.min(1 << 16) {
            let byte = self.random.byte();
            self.on_the_way.push_front((0, byte));
            self.truth.noise_bytes += 1;
        }
    }

    fn nanos_per_byte(&self) -> u64 {
        10_000_000_000 / u64::from(self.settings.baud)
    }
}
