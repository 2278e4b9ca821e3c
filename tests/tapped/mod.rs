//! A virtual clock with a hand on the wire.

use std::cell::Cell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::time::Duration;

use armature::engine::perform::{Next, Source};
use armature_device::{Event, Session, SessionCounters, SessionSettings};
use armature_sim::Puppet;

/// May damage a frame (its number, its bytes without the delimiter) and says whether it did.
pub(crate) type Damage = fn(usize, &mut [u8]) -> bool;

/// A puppet and the session that hears it through damaged frames.
#[derive(Debug)]
pub(crate) struct Tapped {
    puppet: Puppet,
    session: Session,
    damage: Damage,
    frames: usize,
    damaged: Rc<Cell<(u64, u64)>>,
    now_micros: u64,
    events: VecDeque<Event>,
}

impl Tapped {
    /// A session that wants samples.
    pub(crate) fn new(puppet: Puppet, samples_per_second: f64, damage: Damage) -> Self {
        let mut session = Session::new(SessionSettings::default());
        session.start((samples_per_second * 1000.0) as u32);
        let damaged = Rc::default();
        Self { puppet, session, damage, frames: 0, damaged, now_micros: 0, events: VecDeque::new() }
    }

    /// How many frames were damaged, and how long they are with their delimiters.
    pub(crate) fn damaged(&self) -> Rc<Cell<(u64, u64)>> {
        self.damaged.clone()
    }

    /// To ask for the truth.
    pub(crate) fn puppet(&self) -> &Puppet {
        &self.puppet
    }

    fn step(&mut self) {
        let now = Duration::from_micros(self.now_micros);
        let (mut events, mut bytes) = (Vec::new(), Vec::new());
        self.session.tick(now, &mut events);
        self.puppet.step(self.now_micros, &self.session.take_outgoing(), &mut bytes);
        // The simulator puts whole frames on the line.
        for frame in bytes.split_mut(|byte| *byte == 0).filter(|frame| !frame.is_empty()) {
            if (self.damage)(self.frames, frame) {
                let (frames, bytes) = self.damaged.get();
                self.damaged.set((frames + 1, bytes + frame.len() as u64 + 1));
            }
            self.frames += 1;
        }
        self.session.receive(now, &bytes, &mut events);
        self.events.extend(events);
        self.now_micros += 1_000;
    }
}

impl Source for Tapped {
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
