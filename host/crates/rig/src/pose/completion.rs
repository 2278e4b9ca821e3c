//! Poses the bones that no joint drives.

use glam::Vec3;

use super::status::BoneStatus;
use super::target::{TargetChange, TargetError};
use crate::skeleton::Pose;

/// When a pose is completed, and where it will be.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PoseMoment {
    /// The device's clock.
    pub device_micros: u64,
    /// By how much the roots will be moved afterwards, as of the pose before this one (mesh units): feet on the floor move
    /// the character, while targets are places in the world.
    pub offset: Vec3,
}

/// Completes poses in which only some bones are driven, for example by inverse kinematics.
///
/// A completed pose may depend on those before it (a solver starts from the last frame), so a replay is exact only if
/// it follows the recording: from the same start, over every pose, in order.
pub trait PoseCompletion: std::fmt::Debug {
    /// Poses the bones whose status is [`Unmapped`](crate::BoneQuality::Unmapped), which are in the rest pose until
    /// then. Does not allocate unless the driven bones or the targets differ from those of the previous pose.
    fn complete(&mut self, moment: PoseMoment, status: &[BoneStatus], pose: &mut Pose);

    /// Drags a point of the character from the next pose on, or lets it go. An error changes nothing.
    fn change_target(&mut self, change: &TargetChange) -> Result<(), TargetError>;

    /// Whether a target holds a root, so that the feet have no say in where it is.
    fn holds_root(&self) -> bool {
        false
    }

    /// Forgets earlier poses and all targets: later ones no longer depend on them.
    fn restart(&mut self);
}
