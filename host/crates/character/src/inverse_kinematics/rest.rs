//! A skeleton at rest, and what is held of it.

use armature_rig::Skeleton;
use glam::{Quat, Vec3};

use super::pinned_bone::PinHold;

/// Everything that no pose changes; positions and rotations are in model space.
#[derive(Clone, Debug)]
pub(super) struct RestRig {
    pub(super) skeleton: Skeleton,
    pub(super) heads: Vec<Vec3>,
    pub(super) tails: Vec<Vec3>,
    pub(super) rotations: Vec<Quat>,
    /// One per bone.
    pub(super) pins: Vec<Option<PinHold>>,
}

impl RestRig {
    pub(super) fn new(skeleton: Skeleton, pins: Vec<Option<PinHold>>) -> Self {
        let (heads, tails) = skeleton.rest_segments().into_iter().unzip();
        let mut rotations: Vec<Quat> = Vec::with_capacity(skeleton.len());
        for bone in skeleton.bones() {
            rotations.push(bone.parent.map_or(bone.rest.rotation, |p| rotations[p] * bone.rest.rotation).normalize());
        }
        Self { skeleton, heads, tails, rotations, pins }
    }

    pub(super) fn parent(&self, bone: usize) -> Option<usize> {
        self.skeleton.bones()[bone].parent
    }

    /// Whether a pin holds the bone's head.
    pub(super) fn stays(&self, bone: usize) -> bool {
        matches!(self.pins[bone], Some(PinHold::Fixed | PinHold::Turning))
    }
}
