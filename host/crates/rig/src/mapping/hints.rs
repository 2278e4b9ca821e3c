//! What is known of a puppet besides the tree of its parts.

use std::collections::BTreeMap;

use glam::Vec3;

use super::limb_directions::directions;
use crate::puppet::PartUid;
use crate::skeleton::Skeleton;

/// What a puppet is, where that is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PuppetKind {
    /// One arm, from the shoulder outwards.
    Arm,
    /// One hand, from the wrist outwards.
    Hand,
}

/// What is known of a puppet besides the tree of its parts. A simulated one knows what its parts are called; one made from
/// a motion file also knows how long they are and where they point. A real puppet reports none of this.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PuppetHints {
    /// What it is as a whole.
    pub kind: Option<PuppetKind>,
    /// What its parts are called.
    pub names: BTreeMap<PartUid, String>,
    /// From where to where its parts reach in the rest pose, in the character's frame (+Y up, facing +Z, its left at +X)
    /// and any unit.
    pub segments: BTreeMap<PartUid, (Vec3, Vec3)>,
    /// Where its arms and legs point when it is zeroed, joint by joint, in the character's frame.
    pub rest: BTreeMap<PartUid, Vec3>,
    /// Where its trunk points then, from the hips to the arms.
    pub trunk: Option<Vec3>,
}

impl PuppetHints {
    /// What a skeleton says of the puppet that was made from it, see [`skeleton_puppet`](crate::skeleton_puppet).
    /// `uid`: the part of each bone.
    pub fn of_skeleton(skeleton: &Skeleton, uid: impl Fn(usize) -> PartUid) -> Self {
        let names = skeleton.bones().iter().enumerate().map(|(bone, b)| (uid(bone), b.name.clone())).collect();
        let segments = skeleton.rest_segments().into_iter().enumerate().map(|(bone, ends)| (uid(bone), ends)).collect();
        let (limbs, trunk) = directions(skeleton);
        let rest = limbs.into_iter().map(|(bone, direction)| (uid(bone), direction)).collect();
        Self { kind: None, names, segments, rest, trunk }
    }
}
