//! A simulated puppet in this process, on a clock that runs as fast as the machine can work: the same every time.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::time::Duration;

use armature_device::{Event, Session, SessionSettings};
use armature_rig::PuppetHints;
use armature_sim::Puppet;
use armature_sim::serve::hints_of;

use super::simulated::{self, SimulatedArgs};
use super::{Source, loading, working};
use crate::characters::skin::SkinArgs;
use crate::engine::input::{Input, LineId, LineNews, OpenLine, Request};
use crate::failure::Failure;

/// How far the clock moves in one step: the longest time between taking a sample and receiving it.
const STEP_MICROS: u64 = 1_000;

/// What a wire does to the bytes coming from the puppet.
type Wire = Box<dyn FnMut(&mut [u8])>;

/// The puppet, the session that talks to it, and their clock. Whatever address is connected, it is this puppet.
pub struct VirtualSource {
    puppet: Puppet,
    hints: PuppetHints,
    session: Session,
    now_micros: u64,
    line: Option<LineId>,
    /// What happens before the puppet continues.
    inputs: VecDeque<Input>,
    events: VecDeque<Event>,
    fresh: Vec<Event>,
    from_device: Vec<u8>,
    wire: Wire,
}

impl std::fmt::Debug for VirtualSource {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("VirtualSource").field("now_micros", &self.now_micros).finish_non_exhaustive()
    }
}

impl VirtualSource {
    /// A puppet by name.
    pub fn new(name: &str, args: &SimulatedArgs, samples_per_second: f64) -> Result<Self, Failure> {
        let options = args.options(name);
        if options.servo_bus().is_some() {
            let what = format!("{name} is an arm of servos, which are simulated in real time only");
            return Err(Failure::usage(what, "leave out --virtual-clock"));
        }
        let source = Self::of(simulated::puppet(&options)?, samples_per_second);
        Ok(Self { hints: simulated::hints(&options), ..source })
    }

    /// This puppet.
    pub fn of(puppet: Puppet, samples_per_second: f64) -> Self {
        Self::through(puppet, samples_per_second, |_| ())
    }

    /// This puppet, with its bytes passing through a wire that may damage them.
    pub fn through(puppet: Puppet, samples_per_second: f64, wire: impl FnMut(&mut [u8]) + 'static) -> Self {
        let hints = hints_of(puppet.body());
        let mut session = Session::new(SessionSettings::default());
        session.start((samples_per_second * 1000.0).round() as u32);
        Self {
            puppet,
            hints,
            session,
            now_micros: 0,
            line: None,
            inputs: VecDeque::new(),
            events: VecDeque::new(),
            fresh: Vec::new(),
            from_device: Vec::new(),
            wire: Box::new(wire),
        }
    }

    /// The puppet, to ask it for the truth.
    pub fn puppet(&self) -> &Puppet {
        &self.puppet
    }

    /// The puppet's next event, advancing the clock by a step if none is waiting; for callers that want only the
    /// events.
    pub fn next_event(&mut self) -> Option<Event> {
        if self.events.is_empty() {
            self.step();
        }
        self.events.pop_front()
    }

    fn step(&mut self) {
        let now = Duration::from_micros(self.now_micros);
        self.session.tick(now, &mut self.fresh);
        let to_device = self.session.take_outgoing();
        self.from_device.clear();
        self.puppet.step(self.now_micros, &to_device, &mut self.from_device);
        (self.wire)(&mut self.from_device);
        self.session.receive(now, &self.from_device, &mut self.fresh);
        self.events.extend(self.fresh.drain(..));
        self.now_micros += STEP_MICROS;
    }

    fn news(&self, line: LineId, news: LineNews) -> Input {
        Input::Device { line, counters: self.session.counters(), news }
    }
}

impl Source for VirtualSource {
    fn next(&mut self, _: Option<f64>) -> Input {
        if let Some(input) = self.inputs.pop_front() {
            return input;
        }
        let event = self.next_event();
        match (event, self.line) {
            (Some(event), Some(line)) => self.news(line, LineNews::Event(event)),
            _ => Input::Tick,
        }
    }

    fn now(&self) -> f64 {
        self.now_micros as f64 * 1e-6
    }

    fn age(&self, _: f64) -> Option<Duration> {
        None
    }

    fn fulfil(&mut self, request: Request) {
        match request {
            Request::Connect { line, address } => {
                self.line = Some(line);
                let hints = self.hints.clone();
                let opened = OpenLine { address, hints, ..OpenLine::default() };
                self.inputs.push_back(Input::Connected { line, outcome: Ok(opened) });
            }
            Request::Blink { uid, millis, .. } => {
                self.session.blink(uid, millis);
            }
            Request::Close(line) => {
                self.line = None;
                self.inputs.push_back(self.news(line, LineNews::Closed));
            }
            Request::Load { load, source } => {
                let news = loading::find(&source, SkinArgs::default(), &mut |_, _| ControlFlow::Continue(()));
                self.inputs.push_back(Input::Loaded { load, news });
            }
            Request::Work { work, order } => {
                let news = working::done(&order, &mut |_, _| ControlFlow::Continue(()));
                self.inputs.push_back(Input::Worked { work, news });
            }
            // Samples were requested at once, because on this clock nothing is too early; characters are loaded and
            // work is done at once.
            Request::Stream { .. } | Request::CancelLoad(_) | Request::CancelWork(_) => {}
            Request::ListDevices => self.inputs.push_back(Input::Listed(Ok(Vec::new()))),
        }
    }
}
