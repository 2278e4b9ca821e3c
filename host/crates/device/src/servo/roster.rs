//! The servos of an arm and what is known about each.

use std::time::Duration;

use super::bus::{RETURN_DELAY_UNIT_MICROS, ReadMode, wire_bound_hertz};
use crate::arm::{ServoArm, ServoProtocol, is_usable};
use crate::events::{DeviceNotice, Event};

/// The longest return delay that a servo can be set to; assumed for one whose delay was not read.
const LONGEST_RETURN_DELAY: Duration = Duration::from_micros(510);

/// What is known about one servo.
#[derive(Clone, Debug, Default)]
struct Servo {
    model: Option<u16>,
    /// Whether it is read; a missing servo or one of a foreign model is not.
    present: bool,
    foreign: bool,
    /// Whether its absence has been reported.
    missed: bool,
    return_delay_units: u8,
    strikes: u32,
    error: u8,
}

/// What a model number means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ModelRead {
    /// It is not the expected one, and should be read once more.
    Doubtful,
    Usable,
    Foreign,
}

/// The servos of an arm, by their place in it.
#[derive(Clone, Debug)]
pub(super) struct Roster {
    arm: ServoArm,
    servos: Vec<Servo>,
}

impl Roster {
    pub(super) fn new(arm: ServoArm) -> Self {
        Self { servos: vec![Servo::default(); arm.joints.len()], arm }
    }

    pub(super) fn arm(&self) -> &ServoArm {
        &self.arm
    }

    pub(super) fn protocol(&self) -> ServoProtocol {
        self.arm.protocol
    }

    /// How many there should be.
    pub(super) fn len(&self) -> usize {
        self.servos.len()
    }

    /// A servo's number on the bus.
    pub(super) fn id(&self, servo: usize) -> u8 {
        self.arm.joints[servo].id
    }

    /// A servo's number on the bus and the name of its joint.
    fn names(&self, servo: usize) -> (u8, String) {
        let joint = &self.arm.joints[servo];
        (joint.id, joint.name.clone())
    }

    /// Starts looking for all of them again; what was reported is not reported again.
    pub(super) fn forget(&mut self) {
        for servo in &mut self.servos {
            *servo = Servo { missed: servo.missed, ..Servo::default() };
        }
    }

    /// Those that are read.
    pub(super) fn present(&self) -> Vec<usize> {
        (0..self.len()).filter(|&servo| self.servos[servo].present).collect()
    }

    /// Those to ask for.
    pub(super) fn missing(&self) -> Vec<usize> {
        (0..self.len()).filter(|&servo| !self.servos[servo].present && !self.servos[servo].foreign).collect()
    }

    /// Whether any usable servo has answered.
    pub(super) fn any_usable(&self) -> bool {
        self.servos.iter().any(|servo| servo.model.is_some() && !servo.foreign)
    }

    /// The model number of the first servo that has answered.
    pub(super) fn first_model(&self) -> Option<u16> {
        self.servos.iter().find_map(|servo| servo.model)
    }

    /// How long a servo waits before it answers, as far as known.
    pub(super) fn return_delay(&self, servo: usize) -> Duration {
        let units = u32::from(self.servos[servo].return_delay_units);
        Duration::from_micros(u64::from(units * RETURN_DELAY_UNIT_MICROS))
    }

    /// How long it may wait at most.
    pub(super) fn longest_return_delay(&self, servo: usize) -> Duration {
        if self.servos[servo].model.is_none() { LONGEST_RETURN_DELAY } else { self.return_delay(servo) }
    }

    pub(super) fn set_return_delay(&mut self, servo: usize, units: u8) {
        self.servos[servo].return_delay_units = units;
    }

    /// Takes a model number. Anything the user may have to act on is read twice: a checksum byte lets noise through now
    /// and then.
    pub(super) fn take_model(&mut self, servo: usize, found: u16, events: &mut Vec<Event>) -> ModelRead {
        let (usable, expected) = (is_usable(self.arm.protocol, found), self.arm.joints[servo].model);
        let known = &mut self.servos[servo];
        let confirmed = known.model.replace(found) == Some(found);
        if found != expected && !confirmed {
            return ModelRead::Doubtful;
        }
        known.foreign = !usable;
        if found != expected {
            let (id, name) = self.names(servo);
            events.push(Event::Notice(DeviceNotice::ServoModel { id, name, found, expected, usable }));
        }
        if usable { ModelRead::Usable } else { ModelRead::Foreign }
    }

    /// Passes on a servo's error report when it changes.
    pub(super) fn hear_error(&mut self, servo: usize, error: u8, events: &mut Vec<Event>) {
        let before = std::mem::replace(&mut self.servos[servo].error, error);
        if before != error
            && let Some(what) = self.arm.protocol.complaint(error)
        {
            let (id, name) = self.names(servo);
            events.push(Event::Notice(DeviceNotice::ServoComplains { id, name, what }));
        }
    }

    /// Reports that its motor still holds its position.
    pub(super) fn report_torque(&self, servo: usize, events: &mut Vec<Event>) {
        let (id, name) = self.names(servo);
        events.push(Event::Notice(DeviceNotice::TorqueOn { id, name }));
    }

    /// Counts whether a servo that is read has answered; returns whether it is ignored from now on.
    pub(super) fn strike(&mut self, servo: usize, answered: bool, limit: u32, events: &mut Vec<Event>) -> bool {
        let known = &mut self.servos[servo];
        if !known.present {
            return false;
        }
        known.strikes = if answered { 0 } else { known.strikes + 1 };
        if known.strikes < limit {
            return false;
        }
        known.present = false;
        known.model = None;
        self.report_missing(servo, events);
        true
    }

    fn report_missing(&mut self, servo: usize, events: &mut Vec<Event>) {
        if !std::mem::replace(&mut self.servos[servo].missed, true) {
            let (id, name) = self.names(servo);
            events.push(Event::Notice(DeviceNotice::ServoMissing { id, name }));
        }
    }

    /// Takes back a missing servo that has been prepared; returns whether there was one to take back.
    pub(super) fn welcome(&mut self, servo: usize, events: &mut Vec<Event>) -> bool {
        let known = &mut self.servos[servo];
        if known.present || known.foreign || known.model.is_none() {
            return false;
        }
        known.present = true;
        known.strikes = 0;
        known.missed = false;
        let (id, name) = self.names(servo);
        events.push(Event::Notice(DeviceNotice::ServoBack { id, name }));
        true
    }

    /// From now on, all that have answered are read; the others are reported.
    pub(super) fn settle(&mut self, events: &mut Vec<Event>) {
        for index in 0..self.len() {
            let servo = &mut self.servos[index];
            servo.present = servo.model.is_some() && !servo.foreign;
            if servo.model.is_none() {
                self.report_missing(index, events);
            }
        }
    }

    /// The most readings per second that the wire allows for the servos present.
    pub(super) fn bound_hertz(&self, mode: ReadMode, baud: u32) -> f64 {
        let delays: Vec<u32> = self.present().iter().map(|&s| self.return_delay(s).as_micros() as u32).collect();
        wire_bound_hertz(self.arm.protocol, mode, baud, &delays)
    }
}
