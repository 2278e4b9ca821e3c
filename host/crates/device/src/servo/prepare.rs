//! Finding the servos, making sure that they are the right ones, and letting them move freely.

use std::time::Duration;

use super::bus::{ReadMode, wire_bound_hertz};
use super::exchange::{Purpose, Step, Task};
use super::packet::Status;
use super::session::{EepromConsent, Phase, Servo, ServoSession};
use crate::{DeviceInfo, DeviceNotice, DeviceProblem, Event};

/// How often a request to one servo is repeated when it is not answered.
const TRIES: u32 = 3;
/// An adapter that holds every answer for longer than this is worth a word. USB itself takes about 1 ms.
const SLOW_ADAPTER: Duration = Duration::from_millis(4);
/// A return delay below this costs less than a tenth of the rate.
const WORTHWHILE_DELAY_MICROS: u64 = 20;

impl ServoSession {
    /// Begins to look for the servos at this one of the speeds.
    pub(super) fn look_from(&mut self, speed: usize) {
        let speed = if speed < self.speeds.len() { speed } else { 0 };
        self.phase = Phase::Looking { speed };
        self.baud = self.speeds[speed];
        self.held_back = None;
        self.mode = Self::quickest(&self.arm);
        self.barren = 0;
        self.cycle = None;
        for servo in &mut self.servos {
            *servo = Servo { last: servo.last, missed: servo.missed, ..Servo::default() };
        }
        self.tasks.clear();
        let all = (0..self.arm.joints.len()).map(|servo| Task { servo, step: Step::ReadModel, tried: 0 });
        self.tasks.extend(all);
    }

    pub(super) fn send_task(&mut self, now: Duration, task: Task) {
        let (protocol, id) = (self.arm.protocol, self.arm.joints[task.servo].id);
        let registers = protocol.registers();
        let (request, data_length) = match task.step {
            Step::ReadModel => (protocol.read(id, registers.model, 2), 2),
            Step::ReadTorque => (protocol.read(id, registers.torque, 1), 1),
            Step::ReadReturnDelay => (protocol.read(id, registers.return_delay, 1), 1),
            Step::TorqueOff => (protocol.write(id, registers.torque, &[0]), 0),
            Step::Unlock | Step::Lock => {
                let Some(lock) = registers.lock else { return };
                (protocol.write(id, lock, &[u8::from(task.step == Step::Lock)]), 0)
            }
            Step::ClearReturnDelay => {
                // The only place that writes what wears out.
                if self.settings.eeprom != EepromConsent::ReturnDelayZero
                    || registers.return_delay >= registers.ram_begins
                {
                    return;
                }
                (protocol.write(id, registers.return_delay, &[0]), 0)
            }
            Step::Light { on } => {
                let Some(light) = registers.light else { return };
                (protocol.write(id, light, &[u8::from(on)]), 0)
            }
        };
        self.counters.repeated_requests += u64::from(task.tried > 0);
        self.send(now, Purpose::Task(task), &[task.servo], data_length, &request);
    }

    pub(super) fn finish_task(&mut self, _now: Duration, task: Task, answer: Option<Status>, events: &mut Vec<Event>) {
        let answer = answer.filter(|status| !self.arm.protocol.failed(status.error));
        let Some(status) = answer else {
            let tries = match (self.phase, task.step) {
                // One question at each speed would miss a servo behind a little noise; three take long where nobody is.
                (Phase::Looking { speed }, Step::ReadModel) => TRIES - u32::from(speed > 0),
                // What is missing is asked after again soon. A servo may be set to answer reads only: what was written
                // is read back.
                (_, Step::ReadModel | Step::TorqueOff | Step::Unlock | Step::Lock | Step::ClearReturnDelay) => 1,
                _ => TRIES,
            };
            if task.tried + 1 < tries {
                self.tasks.push_front(Task { tried: task.tried + 1, ..task });
            } else {
                self.give_up_task(task, events);
            }
            return;
        };
        self.hear_error(task.servo, status.error, events);
        match task.step {
            Step::ReadModel => self.take_model(task.servo, status.word().unwrap_or(0), events),
            Step::ReadTorque if status.data.first() != Some(&0) => {
                if task.tried < TRIES {
                    let again = |step| Task { step, tried: task.tried + 1, ..task };
                    self.tasks.push_front(again(Step::ReadTorque));
                    self.tasks.push_front(Task { tried: 0, ..again(Step::TorqueOff) });
                } else {
                    self.tell_torque(task.servo, events);
                }
            }
            Step::ReadReturnDelay => {
                self.servos[task.servo].return_delay_units = status.data.first().copied().unwrap_or(0);
                self.offer_return_delay(task);
            }
            _ => {}
        }
        self.welcome_when_done(task, events);
    }

    /// A servo that was missing is read again once all that prepares it is done.
    fn welcome_when_done(&mut self, task: Task, events: &mut Vec<Event>) {
        let pending = self.tasks.iter().any(|other| other.servo == task.servo);
        let prepared = matches!(task.step, Step::ReadReturnDelay | Step::Lock | Step::ClearReturnDelay);
        let servo = &mut self.servos[task.servo];
        if self.phase != Phase::Ready || pending || !prepared || servo.present || servo.foreign || servo.model.is_none()
        {
            return;
        }
        servo.present = true;
        servo.strikes = 0;
        servo.missed = false;
        servo.unlikely = None;
        let joint = &self.arm.joints[task.servo];
        events.push(Event::Notice(DeviceNotice::ServoBack { id: joint.id, name: joint.name.clone() }));
        self.granted = None;
    }

    fn give_up_task(&mut self, task: Task, events: &mut Vec<Event>) {
        match task.step {
            Step::ReadTorque => self.tell_torque(task.servo, events),
            Step::ReadReturnDelay => self.welcome_when_done(task, events),
            _ => {}
        }
    }

    fn tell_torque(&self, servo: usize, events: &mut Vec<Event>) {
        let joint = &self.arm.joints[servo];
        events.push(Event::Notice(DeviceNotice::TorqueOn { id: joint.id, name: joint.name.clone() }));
    }

    fn take_model(&mut self, servo: usize, found: u16, events: &mut Vec<Event>) {
        let joint = &self.arm.joints[servo];
        let (usable, expected) = (self.usable(found), joint.model);
        let known = &mut self.servos[servo];
        let confirmed = known.model.replace(found) == Some(found);
        if found != expected && !confirmed {
            // What a person may have to act upon is read twice: a check byte lets noise through now and then.
            self.tasks.push_front(Task { servo, step: Step::ReadModel, tried: 0 });
            return;
        }
        known.foreign = !usable;
        if found != expected {
            let (id, name) = (joint.id, joint.name.clone());
            events.push(Event::Notice(DeviceNotice::ServoModel { id, name, found, expected, usable }));
        }
        if usable {
            for step in [Step::ReadReturnDelay, Step::ReadTorque, Step::TorqueOff] {
                self.tasks.push_front(Task { servo, step, tried: 0 });
            }
        }
    }

    /// With consent a return delay is set to 0; what is written is read back.
    fn offer_return_delay(&mut self, task: Task) {
        let delayed = self.servos[task.servo].return_delay_units > 0;
        if !delayed || task.tried > 0 || self.settings.eeprom != EepromConsent::ReturnDelayZero {
            return;
        }
        let step = |step, tried| Task { servo: task.servo, step, tried };
        self.tasks.push_front(step(Step::ReadReturnDelay, 1));
        if self.arm.protocol.registers().lock.is_some() {
            self.tasks.push_front(step(Step::Lock, 0));
            self.tasks.push_front(step(Step::ClearReturnDelay, 0));
            self.tasks.push_front(step(Step::Unlock, 0));
        } else {
            self.tasks.push_front(step(Step::ClearReturnDelay, 0));
        }
    }

    /// What a servo reports of its own accord is told when it changes.
    pub(super) fn hear_error(&mut self, servo: usize, error: u8, events: &mut Vec<Event>) {
        let before = std::mem::replace(&mut self.servos[servo].error, error);
        if before != error
            && let Some(what) = self.arm.protocol.complaint(error)
        {
            let joint = &self.arm.joints[servo];
            events.push(Event::Notice(DeviceNotice::ServoComplains { id: joint.id, name: joint.name.clone(), what }));
        }
    }

    /// All questions at one speed are answered or given up.
    pub(super) fn found_or_next(&mut self, now: Duration, speed: usize, events: &mut Vec<Event>) {
        if self.servos.iter().any(|servo| servo.model.is_some() && !servo.foreign) {
            if speed > 0 && self.info.is_none() {
                let notice = DeviceNotice::FoundAtBaud { asked: self.speeds[0], found: self.baud };
                events.push(Event::Notice(notice));
            }
            // Next time this speed is the first to be tried.
            self.speeds.swap(0, speed);
            self.phase = Phase::Preparing;
            return;
        }
        let foreign = self.servos.iter().find_map(|servo| servo.model);
        if foreign.is_none() && speed + 1 < self.speeds.len() {
            return self.look_from(speed + 1);
        }
        self.phase = Phase::Pausing { until: now + self.settings.pause };
        if self.tell_silence(true) {
            let bauds: Vec<String> = self.speeds.iter().map(ToString::to_string).collect();
            let (arm, bauds) = (self.arm.title.clone(), bauds.join(", "));
            events.push(Event::Problem(match foreign {
                Some(model) => DeviceProblem::ForeignServos { arm, model },
                None => DeviceProblem::NoServos { arm, bauds },
            }));
        }
    }

    /// Everything is known: says who the arm is, and what could be better.
    pub(super) fn introduce(&mut self, now: Duration, events: &mut Vec<Event>) {
        self.phase = Phase::Ready;
        self.forget_silence();
        self.next_probe = now + self.settings.probe_every;
        let again = self.info.is_some();
        for index in 0..self.servos.len() {
            let servo = &mut self.servos[index];
            servo.present = servo.model.is_some() && !servo.foreign;
            let missing = servo.model.is_none();
            if missing && !std::mem::replace(&mut servo.missed, true) {
                let joint = &self.arm.joints[index];
                events.push(Event::Notice(DeviceNotice::ServoMissing { id: joint.id, name: joint.name.clone() }));
            }
        }
        if again {
            return;
        }
        self.counters.connections += 1;
        let max_rate_millihertz = (self.bound_hertz(self.mode) * 1000.0) as u32;
        let found = self.servos.iter().filter(|servo| servo.present).count();
        let info = DeviceInfo {
            name: format!("{} ({} {} servos)", self.arm.title, found, self.arm.protocol),
            uid: self.arm.part_uid(self.settings.seat, 0),
            protocol: match self.arm.protocol {
                super::ServoProtocol::Feetech => [1, 0],
                super::ServoProtocol::Dynamixel => [2, 0],
            },
            firmware: [0; 3],
            features: if self.arm.protocol.registers().light.is_some() { crate::features::BLINK } else { 0 },
            max_rate_millihertz,
        };
        self.info = Some(info.clone());
        events.push(Event::Connected(info));
        events.push(Event::Topology(self.topology.clone()));
        self.diagnose(events);
    }

    /// What costs rate, in plain words.
    fn diagnose(&self, events: &mut Vec<Event>) {
        let longest = (0..self.servos.len()).map(|servo| self.return_delay_micros(servo)).max().unwrap_or(0);
        if longest > WORTHWHILE_DELAY_MICROS {
            let present = self.servos.iter().filter(|servo| servo.present).count();
            let without = wire_bound_hertz(self.arm.protocol, self.mode, self.baud, &vec![0; present]);
            let (micros, hertz_now) = (longest as u32, self.bound_hertz(self.mode));
            events.push(Event::Notice(DeviceNotice::ReturnDelay { micros, hertz_now, hertz_without: without }));
        }
        if let Some((least, _)) = self.held_back.filter(|(least, _)| *least >= SLOW_ADAPTER) {
            let cycle = 1.0 / self.bound_hertz(self.mode).max(1e-3) + least.as_secs_f64();
            let (millis, hertz) = (least.as_secs_f64() * 1e3, 1.0 / cycle);
            events.push(Event::Notice(DeviceNotice::AdapterLatency { millis, hertz }));
        }
    }

    /// The most readings a second that the wire allows for the servos that are there.
    pub(super) fn bound_hertz(&self, mode: ReadMode) -> f64 {
        let present = (0..self.servos.len()).filter(|&servo| self.servos[servo].present);
        let delays: Vec<u32> = present.map(|servo| self.return_delay_micros(servo) as u32).collect();
        wire_bound_hertz(self.arm.protocol, mode, self.baud, &delays)
    }
}
