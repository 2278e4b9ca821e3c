//! The bones between hips and neck, of which rigs have different numbers.

use glam::DQuat;

use super::pairs::{Pairs, TRUNK};
use crate::recognise::{HumanoidBone, HumanoidPart, Recognition};

/// How a bone of the target's trunk turns: between two of the source's.
#[derive(Clone, Copy, Debug)]
pub(super) struct TrunkBone {
    pub(super) bone: usize,
    /// The source's bone below; the hips before the first.
    below: Option<usize>,
    above: usize,
    /// How far it is from one to the other.
    share: f64,
}

impl TrunkBone {
    /// The turn, from those of the source's bones.
    pub(super) fn turn(&self, turns: &[DQuat]) -> DQuat {
        let below = self.below.map_or(DQuat::IDENTITY, |bone| turns[bone]);
        if self.share >= 1.0 { turns[self.above] } else { below.slerp(turns[self.above], self.share).normalize() }
    }
}

/// The target's trunk: its last bone turns as the source's last does, the others in between.
pub(super) fn trunk(pairs: &Pairs) -> Vec<TrunkBone> {
    let (own, wanted) = (bones(&pairs.source), bones(&pairs.target));
    if own.is_empty() {
        return Vec::new();
    }
    let hips = pairs.source.find(HumanoidBone { part: HumanoidPart::Hips, side: None });
    let of = |(place, bone): (usize, &usize)| {
        let along = (place + 1) as f64 * own.len() as f64 / wanted.len() as f64;
        let last = (along.ceil() as usize).clamp(1, own.len());
        let below = if last == 1 { hips } else { Some(own[last - 2]) };
        TrunkBone { bone: *bone, below, above: own[last - 1], share: along - (last - 1) as f64 }
    };
    wanted.iter().enumerate().map(of).collect()
}

fn bones(recognition: &Recognition) -> Vec<usize> {
    TRUNK.iter().filter_map(|&part| recognition.find(HumanoidBone { part, side: None })).collect()
}
