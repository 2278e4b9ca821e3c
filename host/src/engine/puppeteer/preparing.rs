//! What a puppeteer's inverse kinematics is prepared for, and what it costs.

use armature_character::Progress;
use armature_character::inverse_kinematics::{IkEnergy, IkError, InverseKinematics, RefitCost};

use super::Puppeteer;

/// Preparing inverse kinematics for fewer bones than this is over before anyone could read of it.
const FEW_BONES: usize = 150;

impl Puppeteer {
    /// Whether preparing inverse kinematics takes long enough to be reported.
    pub fn prepares_long(&self) -> bool {
        let many = self.character.skeleton.len() > FEW_BONES;
        self.inverse_kinematics.as_ref().is_some_and(|ik| many || ik.settings().energy == IkEnergy::Volume)
    }

    /// What it costs in the latest pose that bones are rigid; `None` where none was solved.
    pub fn refit_cost(&self) -> Option<RefitCost> {
        let ik = self.inverse_kinematics.as_ref().filter(|_| !self.solves_joints_alone)?;
        ik.refit_cost(self.solver.completed_pose())
    }

    /// Why bones without a joint keep their rest pose although they should not.
    pub fn ik_problem(&self) -> Option<&IkError> {
        self.inverse_kinematics.as_ref().and_then(InverseKinematics::problem)
    }

    /// Prepares for the bones that the mapping drives before samples come; those would do it too, but late.
    pub(super) fn prepare_inverse_kinematics(&mut self, progress: Progress<'_>) {
        let (Some(ik), Some(mapping)) = (&mut self.inverse_kinematics, self.solver.mapping()) else { return };
        let driven = mapping.driven_bones(&self.character.skeleton);
        if ik.driven() == driven {
            return;
        }
        if let Err(error) = ik.drive(&driven, progress) {
            tracing::warn!("bones without a joint keep their rest pose: {error}");
        }
    }
}
