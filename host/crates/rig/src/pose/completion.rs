//! Poses the bones that no joint drives.

use super::status::BoneStatus;
use crate::skeleton::Pose;

/// Completes poses in which only some bones are driven, for example by inverse kinematics.
///
/// A completed pose may depend on those before it (a solver starts from the last frame), so a replay is exact only if
/// it follows the recording: from the same start, over every pose, in order.
pub trait PoseCompletion: std::fmt::Debug {
    /// Poses the bones whose status is [`Unmapped`](crate::BoneQuality::Unmapped), which are in the rest pose until
    /// then. Does not allocate unless the driven bones differ from those of the previous pose.
    fn complete(&mut self, status: &[BoneStatus], pose: &mut Pose);

    /// Forgets earlier poses: later ones no longer depend on them.
    fn restart(&mut self);
}
