//! What is asked of the character besides the puppet: targets on a timetable, and those that a hand sets meanwhile.

use armature_character::inverse_kinematics::Missed;
use armature_rig::{PoseCompletion, TargetChange};
use armature_take::Record;

use super::{Puppeteer, ZeroWish};
use crate::characters::targets::TargetArgs;
use crate::failure::Failure;

/// Changes that wait for their time, or for the next sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Dragging {
    /// Microseconds of the device's clock since it began; in time order.
    timetable: Vec<(u64, TargetChange)>,
    /// How many of them are done.
    done: usize,
    /// The device's clock at the latest sample, and how long it has gone on.
    clock: Option<(u64, u64)>,
    waiting: Vec<TargetChange>,
}

impl Dragging {
    pub(super) fn new(timetable: Vec<(u64, TargetChange)>) -> Self {
        Self { timetable, ..Self::default() }
    }

    /// With the next sample.
    pub(super) fn ask(&mut self, change: TargetChange) {
        self.waiting.push(change);
    }

    /// Before everything that waits.
    pub(super) fn ask_first(&mut self, changes: impl IntoIterator<Item = TargetChange>) {
        self.waiting.splice(0..0, changes);
    }

    /// Forgets what waits for the next sample; the timetable goes on.
    pub(super) fn forget(&mut self) {
        self.waiting.clear();
    }

    /// What holds from the sample on that has come. `micros`: its time on the device's clock; `has_begun`: whether the
    /// timetable goes on.
    pub(super) fn due(&mut self, micros: u64, has_begun: bool) -> Vec<TargetChange> {
        let mut due = std::mem::take(&mut self.waiting);
        if has_begun {
            // A clock that has gone back means that the device restarted.
            let elapsed = self.clock.map_or(0, |(before, elapsed)| elapsed + micros.saturating_sub(before));
            self.clock = Some((micros, elapsed));
            while let Some((_, change)) = self.timetable.get(self.done).filter(|(at, _)| *at <= elapsed) {
                due.push(*change);
                self.done += 1;
            }
        }
        due
    }
}

impl Puppeteer {
    /// Drags points of the character, as chosen, from its first sample in the rest pose on.
    pub fn with_targets(mut self, choice: &TargetArgs) -> Result<Self, Failure> {
        let timetable = choice.for_character(&self.character)?;
        timetable.iter().try_for_each(|(_, change)| self.check_target(change))?;
        self.dragging = Dragging::new(timetable);
        Ok(self)
    }

    /// Drags a point of the character, or lets it go, from the next sample on.
    pub fn change_target(&mut self, change: TargetChange) -> Result<(), Failure> {
        self.check_target(&change)?;
        self.dragging.ask(change);
        Ok(())
    }

    fn check_target(&self, change: &TargetChange) -> Result<(), Failure> {
        let name = change.point().name(&self.character.skeleton);
        let Some(ik) = &self.inverse_kinematics else {
            let what = format!("{name} of {} cannot be dragged without inverse kinematics", self.character.name);
            return Err(Failure::usage(what, "choose a character with a mesh, and leave out --ik off"));
        };
        let checked = ik.check_target(change);
        checked.map_err(|why| Failure::usage(format!("{name} of {}: {why}", self.character.name), ""))
    }

    /// Targets whose time has come, and what a take says of them.
    pub(super) fn drag(&mut self, micros: u64) -> Vec<Record> {
        let mut told = Vec::new();
        for change in self.dragging.due(micros, self.zero_wish == ZeroWish::Nothing) {
            let begins = self.solves_joints_alone.then(|| self.inverse_kinematics_header()).flatten();
            let Some(ik) = &mut self.inverse_kinematics else { continue };
            if let Some(header) = begins {
                // The take began without.
                self.solves_joints_alone = false;
                ik.restart();
                told.push(Record::InverseKinematics(header));
            }
            match ik.change_target(&change) {
                Ok(()) => told.push(Record::Target(change)),
                Err(why) => tracing::warn!("{}: {why}", change.point().name(&self.character.skeleton)),
            }
        }
        told
    }

    /// Targets that were missed by more than this since the take began or the puppet came, mesh units; each with the most
    /// it was missed by.
    pub fn missed_targets(&self, by: f32) -> Vec<Missed> {
        self.inverse_kinematics.as_ref().map_or_else(Vec::new, |ik| ik.missed_targets(by))
    }
}

#[cfg(test)]
mod tests {
    use armature_rig::TargetPoint;

    use super::*;

    #[test]
    fn a_timetable_counts_from_its_first_sample_and_over_a_restart() {
        let release = |bone| TargetChange::Release { point: TargetPoint::Head(bone), over_micros: 0 };
        let mut dragging = Dragging::new(vec![(0, release(0)), (1_000, release(1)), (1_500, release(2))]);
        assert_eq!(dragging.due(9_000, false), []);
        dragging.ask(release(7));
        assert_eq!(dragging.due(10_000, true), [release(7), release(0)]);
        assert_eq!(dragging.due(10_900, true), []);
        assert_eq!(dragging.due(100, true), [], "the device has restarted");
        assert_eq!(dragging.due(200, true), [release(1)]);
        assert_eq!(dragging.due(5_000, true), [release(2)]);
        assert_eq!(dragging.due(50_000, true), []);
    }
}
