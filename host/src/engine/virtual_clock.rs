//! A simulated puppet in this process, on a clock that moves as fast as the machine can work: the same every time.

use std::collections::VecDeque;
use std::time::Duration;

use armature_device::{Event, Session, SessionCounters, SessionSettings};
use armature_sim::Puppet;

use super::perform::{Next, Source};
use super::simulated::{self, SimulatedArgs};
use crate::failure::Failure;

/// How far the clock moves at once. A sample is received at most so much later than it was taken.
const STEP_MICROS: u64 = 1_000;

/// The puppet, the session that talks to it, and their clock.
#[derive(Debug)]
pub struct VirtualPuppet {
    puppet: Puppet,
    session: Session,
    now_micros: u64,
    events: VecDeque<Event>,
    fresh: Vec<Event>,
    from_device: Vec<u8>,
}

impl VirtualPuppet {
    /// A puppet by name.
    pub fn new(name: &str, args: &SimulatedArgs, samples_per_second: f64) -> Result<Self, Failure> {
        Ok(Self::of(simulated::puppet(&args.options(name))?, samples_per_second))
    }

    /// This puppet.
    pub fn of(puppet: Puppet, samples_per_second: f64) -> Self {
        let mut session = Session::new(SessionSettings::default());
        session.start((samples_per_second * 1000.0).round() as u32);
        Self { puppet, session, now_micros: 0, events: VecDeque::new(), fresh: Vec::new(), from_device: Vec::new() }
    }

    /// The puppet, to ask it for the truth.
    pub fn puppet(&self) -> &Puppet {
        &self.puppet
    }

    fn step(&mut self) {
        let now = Duration::from_micros(self.now_micros);
        self.session.tick(now, &mut self.fresh);
        let to_device = self.session.take_outgoing();
        self.from_device.clear();
        self.puppet.step(self.now_micros, &to_device, &mut self.from_device);
        self.session.receive(now, &self.from_device, &mut self.fresh);
        self.events.extend(self.fresh.drain(..));
        self.now_micros += STEP_MICROS;
    }
}

impl Source for VirtualPuppet {
    fn next(&mut self) -> Next {
        if self.events.is_empty() {
            self.step();
        }
        self.events.pop_front().map_or(Next::Quiet, Next::Event)
    }

    fn now(&self) -> f64 {
        self.now_micros as f64 * 1e-6
    }

    fn age(&self, _: Duration) -> Option<Duration> {
        None
    }

    fn counters(&self) -> SessionCounters {
        self.session.counters()
    }

    fn interrupted(&self) -> bool {
        false
    }

    fn close(self) -> SessionCounters {
        self.session.counters()
    }
}
