//! Work on single servos: checking that they are the right ones, and letting them move freely.

use std::collections::VecDeque;

use super::packet::Status;
use super::roster::{ModelRead, Roster};
use super::settings::EepromConsent;
use super::task::{Step, Task};
use crate::events::Event;

/// How often a request to one servo is repeated if it is not answered.
const TRIES: u32 = 3;

/// The pending tasks.
#[derive(Clone, Debug)]
pub(super) struct Preparation {
    consent: EepromConsent,
    tasks: VecDeque<Task>,
    repeated: u64,
}

impl Preparation {
    pub(super) fn new(consent: EepromConsent) -> Self {
        Self { consent, tasks: VecDeque::new(), repeated: 0 }
    }

    /// Asks all servos who they are, and drops all other tasks.
    pub(super) fn look_for_all(&mut self, servos: usize) {
        self.tasks.clear();
        (0..servos).for_each(|servo| self.add(servo, Step::ReadModel));
    }

    /// Adds a task, to be done after all earlier ones.
    pub(super) fn add(&mut self, servo: usize, step: Step) {
        self.tasks.push_back(Task::new(servo, step));
    }

    pub(super) fn next(&mut self) -> Option<Task> {
        self.tasks.pop_front()
    }

    /// Requests sent again.
    pub(super) fn repeated(&self) -> u64 {
        self.repeated
    }

    /// The request for a task, and the length of the answer's data; `None` if there is nothing to send.
    pub(super) fn request(&mut self, task: Task, roster: &Roster) -> Option<(Vec<u8>, usize)> {
        let request = task.request(roster.protocol(), roster.id(task.servo()), self.consent)?;
        self.repeated += u64::from(task.tried() > 0);
        Some(request)
    }

    /// Takes the answer to a task, or its absence, and adds follow-up tasks. `looking_at`: which of the speeds is being
    /// tried, while looking for the servos. Returns whether this completes the servo's preparation.
    pub(super) fn finish(
        &mut self,
        task: Task,
        answer: Option<Status>,
        looking_at: Option<usize>,
        roster: &mut Roster,
        events: &mut Vec<Event>,
    ) -> bool {
        let answer = answer.filter(|status| !roster.protocol().failed(status.error));
        let Some(status) = answer else { return self.unanswered(task, looking_at, roster, events) };
        let servo = task.servo();
        roster.hear_error(servo, status.error, events);
        match task.step() {
            Step::ReadModel => self.take_model(servo, status.word().unwrap_or(0), roster, events),
            Step::ReadTorque if status.data.first() != Some(&0) => {
                if task.tried() < TRIES {
                    self.tasks.push_front(task.and_then(Step::ReadTorque, task.tried() + 1));
                    self.tasks.push_front(task.and_then(Step::TorqueOff, 0));
                } else {
                    roster.report_torque(servo, events);
                }
            }
            Step::ReadReturnDelay => {
                let units = status.data.first().copied().unwrap_or(0);
                roster.set_return_delay(servo, units);
                self.offer_return_delay(task, units, roster.protocol().registers().lock.is_some());
            }
            _ => {}
        }
        self.is_last(task)
    }

    fn unanswered(&mut self, task: Task, looking_at: Option<usize>, roster: &Roster, events: &mut Vec<Event>) -> bool {
        let tries = match (looking_at, task.step()) {
            // One question at each speed would miss a servo behind a little noise; three take long where there is no
            // servo.
            (Some(speed), Step::ReadModel) => TRIES - u32::from(speed > 0),
            // A missing servo is asked again soon. A servo may be configured to answer reads only, so what was written
            // is read back.
            (_, Step::ReadModel | Step::TorqueOff | Step::Unlock | Step::Lock | Step::ClearReturnDelay) => 1,
            _ => TRIES,
        };
        if task.tried() + 1 < tries {
            self.tasks.push_front(task.and_then(task.step(), task.tried() + 1));
            return false;
        }
        if task.step() == Step::ReadTorque {
            roster.report_torque(task.servo(), events);
        }
        task.step() == Step::ReadReturnDelay && self.is_last(task)
    }

    /// Whether this was the last task for a servo that has been asked everything.
    fn is_last(&self, task: Task) -> bool {
        let ends = matches!(task.step(), Step::ReadReturnDelay | Step::Lock | Step::ClearReturnDelay);
        ends && !self.tasks.iter().any(|other| other.servo() == task.servo())
    }

    fn take_model(&mut self, servo: usize, found: u16, roster: &mut Roster, events: &mut Vec<Event>) {
        match roster.take_model(servo, found, events) {
            ModelRead::Doubtful => self.tasks.push_front(Task::new(servo, Step::ReadModel)),
            ModelRead::Usable => {
                for step in [Step::ReadReturnDelay, Step::ReadTorque, Step::TorqueOff] {
                    self.tasks.push_front(Task::new(servo, step));
                }
            }
            ModelRead::Foreign => {}
        }
    }

    /// With consent, sets a return delay to 0; what is written is read back.
    fn offer_return_delay(&mut self, task: Task, units: u8, has_lock: bool) {
        if units == 0 || task.tried() > 0 || self.consent != EepromConsent::ReturnDelayZero {
            return;
        }
        self.tasks.push_front(task.and_then(Step::ReadReturnDelay, 1));
        if has_lock {
            self.tasks.push_front(task.and_then(Step::Lock, 0));
        }
        self.tasks.push_front(task.and_then(Step::ClearReturnDelay, 0));
        if has_lock {
            self.tasks.push_front(task.and_then(Step::Unlock, 0));
        }
    }
}
