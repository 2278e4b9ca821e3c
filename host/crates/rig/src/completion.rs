//! What turns the bones that no joint drives.

use crate::{BoneStatus, Pose};

/// Completes poses in which only some bones are driven, such as inverse kinematics.
///
/// A completed pose may depend on those before it (a solver starts from the last frame), so a replay is exact only if
/// it goes the way the recording went: from the same start, over every pose, in order.
pub trait PoseCompletion: std::fmt::Debug {
    /// Turns the bones whose status is [`Unmapped`](crate::BoneQuality::Unmapped), which are in the rest pose until
    /// then. Allocates nothing unless other bones are driven than in the pose before.
    fn complete(&mut self, status: &[BoneStatus], pose: &mut Pose);

    /// Forgets the poses before: what comes next depends on nothing that was.
    fn restart(&mut self);
}
