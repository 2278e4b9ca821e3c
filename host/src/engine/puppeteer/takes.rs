//! What a puppeteer has to do with takes: each stands on its own.

use armature_character::inverse_kinematics::InverseKinematics;
use armature_rig::TargetChange;
use armature_take::InverseKinematicsHeader;

use super::Puppeteer;

impl Puppeteer {
    /// A take begins: the past is forgotten, and what the take's header has to say of inverse kinematics is returned.
    /// Where no bone needs it now, the take does without to its end.
    pub fn begin_take(&mut self) -> Option<InverseKinematicsHeader> {
        let held = |ik: &InverseKinematics| {
            ik.targets().map(|target| TargetChange::Set { target: *target, over_micros: 0 }).collect::<Vec<_>>()
        };
        let held = self.inverse_kinematics.as_ref().map(held).unwrap_or_default();
        self.forget_past();
        self.dragging.ask_first(held);
        let needed = self.inverse_kinematics.as_ref().filter(|ik| ik.is_needed());
        self.solves_joints_alone = needed.is_none();
        if self.solves_joints_alone { None } else { self.inverse_kinematics_header() }
    }

    pub(super) fn inverse_kinematics_header(&self) -> Option<InverseKinematicsHeader> {
        self.inverse_kinematics.as_ref().map(|ik| InverseKinematicsHeader {
            pins: ik.pins().map(|pin| pin.to_string()).collect(),
            preferences: self.preferences.clone(),
            limits: ik.limits().map(|limited| limited.to_string()).collect(),
            settings: ik.settings().words(self.character.skeleton.len()),
        })
    }

    /// The take has ended.
    pub fn end_take(&mut self) {
        self.solves_joints_alone = false;
    }
}
