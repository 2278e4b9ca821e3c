//! An emulated arm and a session with it, on one virtual clock.

#![allow(dead_code, reason = "each test binary uses a part of this")]

use std::time::Duration;

use armature_device::servo::{ServoArm, ServoJoint, ServoProtocol, ServoSession, ServoSettings};
use armature_device::{DeviceNotice, DeviceProblem, Event, PartKind, Sample, SensorState};
use armature_sim::servo::{BusKind, ServoBus, ServoBusSettings, SimulatedServo};
use armature_sim::{Faults, SensorFault};

/// The clock is checked at most this often when nothing is due, ns.
const LONGEST_STEP: u64 = 20_000_000;

pub(crate) struct World {
    pub(crate) now_nanos: u64,
    pub(crate) bus: ServoBus,
    pub(crate) session: ServoSession,
    pub(crate) events: Vec<Event>,
    ids: usize,
}

impl World {
    pub(crate) fn new(bus: ServoBusSettings, arm: ServoArm, settings: ServoSettings) -> Self {
        let ids = arm.joints.len();
        let session = ServoSession::new(arm, None, settings).expect("the arm is a tree");
        Self { now_nanos: 0, bus: ServoBus::new(bus).expect("a possible bus"), session, events: Vec::new(), ids }
    }

    pub(crate) fn preset(name: &str, change: impl FnOnce(&mut ServoBusSettings)) -> Self {
        let mut bus = ServoBusSettings::preset(name, 1).expect("an arm of that name");
        change(&mut bus);
        Self::new(bus, name.parse().expect("an arm of that name"), ServoSettings::default())
    }

    /// Lets time pass; session and bus are called exactly when something is due.
    pub(crate) fn run(&mut self, seconds: f64) {
        let end = self.now_nanos + (seconds * 1e9) as u64;
        while self.now_nanos < end {
            let now = Duration::from_nanos(self.now_nanos);
            self.session.tick(now, &mut self.events);
            let (baud, to_bus) = (self.session.line_baud(), self.session.take_outgoing());
            let mut to_host = Vec::new();
            self.bus.step(self.now_nanos, baud, &to_bus, &mut to_host);
            if !to_host.is_empty() {
                self.session.receive(now, &to_host, &mut self.events);
                let to_bus = self.session.take_outgoing();
                self.bus.step(self.now_nanos, self.session.line_baud(), &to_bus, &mut Vec::new());
            }
            let due = self.session.next_due().map(|at| at.as_nanos() as u64);
            let next = [due, self.bus.next_due_nanos()].into_iter().flatten().min().unwrap_or(u64::MAX);
            self.now_nanos = next.clamp(self.now_nanos + 1, self.now_nanos + LONGEST_STEP);
        }
    }

    pub(crate) fn samples(&self) -> impl Iterator<Item = &Sample> + Clone {
        self.events.iter().filter_map(|event| if let Event::Sample(sample) = event { Some(sample) } else { None })
    }

    pub(crate) fn notices(&self) -> impl Iterator<Item = &DeviceNotice> {
        self.events.iter().filter_map(|event| if let Event::Notice(notice) = event { Some(notice) } else { None })
    }

    pub(crate) fn problems(&self) -> impl Iterator<Item = &DeviceProblem> {
        self.events.iter().filter_map(|event| if let Event::Problem(problem) = event { Some(problem) } else { None })
    }

    /// The events without samples.
    pub(crate) fn milestones(&self) -> Vec<&Event> {
        self.events.iter().filter(|event| !matches!(event, Event::Sample(_))).collect()
    }

    pub(crate) fn rate_between(&self, from: f64, to: f64) -> f64 {
        let inside = |sample: &&Sample| (from..to).contains(&sample.received.as_secs_f64());
        self.samples().filter(inside).count() as f64 / (to - from)
    }

    /// Every reading marked good is where the servo was within the last 80 ms; returns how many there are.
    pub(crate) fn assert_readings_are_true(&self) -> usize {
        let mut good = 0;
        let mut last_micros = None;
        for sample in self.samples() {
            assert_eq!((sample.counts.len(), sample.states.len()), (self.ids, self.ids));
            let moved_on = sample.sequence == 0 || last_micros.is_none_or(|last| sample.device_micros > last);
            assert!(moved_on, "time must advance");
            last_micros = Some(sample.device_micros);
            for servo in 0..self.ids {
                if sample.states[servo] != SensorState::Ok {
                    continue;
                }
                good += 1;
                let at = sample.received.as_nanos() as u64;
                let apart = |nanos: u64| {
                    let truth = self.bus.true_counts(servo, at.saturating_sub(nanos)).rem_euclid(4_096);
                    let apart = (i32::from(sample.counts[servo]) - truth).rem_euclid(4_096);
                    apart.min(4_096 - apart)
                };
                let nearest = (0..=80).map(|millis| apart(millis * 1_000_000)).min().unwrap_or(4_096);
                assert!(nearest <= 2, "servo {servo} at {:?}: off by {nearest} counts", sample.received);
            }
        }
        good
    }
}

pub(crate) fn faults(sensors: Vec<SensorFault>) -> Faults {
    Faults { sensors, ..Faults::default() }
}

/// Sixteen servos at 1 Mbaud, as an arm.
pub(crate) fn sixteen(kind: BusKind) -> (ServoBusSettings, ServoArm) {
    let (protocol, model) = match kind {
        BusKind::Feetech => (ServoProtocol::Feetech, 777),
        BusKind::Dynamixel => (ServoProtocol::Dynamixel, 1190),
    };
    let servo =
        |id: u8| SimulatedServo { swing_counts: 300.0, hertz: 0.1 * f64::from(id), ..SimulatedServo::new(id, model) };
    let joint = |id: u8| ServoJoint { id, name: format!("joint_{id}"), kind: PartKind::Bend, model };
    let arm = ServoArm {
        name: "sixteen".into(),
        title: "Sixteen servos".into(),
        protocol,
        baud: 1_000_000,
        joints: (1..=16).map(joint).collect(),
    };
    (ServoBusSettings::new(kind, 1_000_000, (1..=16).map(servo).collect()), arm)
}
