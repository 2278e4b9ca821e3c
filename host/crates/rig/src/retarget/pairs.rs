//! Which bone of the source moves which bone of the target.

use std::collections::BTreeMap;

use crate::mapping::next_part;
use crate::recognise::{HumanoidBone, HumanoidPart, Recognition, recognise};
use crate::skeleton::Skeleton;

/// The parts of the trunk between hips and neck, from below.
pub(super) const TRUNK: [HumanoidPart; 3] = [HumanoidPart::Spine, HumanoidPart::Chest, HumanoidPart::UpperChest];

/// What was recognised of both, and which bones go together.
pub(super) struct Pairs {
    pub(super) source: Recognition,
    pub(super) target: Recognition,
    /// For each bone of the target its partner; bones of the trunk have theirs in [`super::trunk`].
    pub(super) of_target: Vec<Option<usize>>,
}

impl Pairs {
    pub(super) fn new(source: &Skeleton, target: &Skeleton) -> Self {
        let (found, wanted) = (recognise(source), recognise(target));
        let mut of_target: Vec<Option<usize>> = vec![None; target.len()];
        let mut taken = vec![false; source.len()];
        for (bone, own) in wanted.bones.iter().enumerate() {
            let Some(own) = own.filter(|own| !TRUNK.contains(&own.bone.part)) else { continue };
            of_target[bone] = found.find(own.bone);
        }
        of_target.iter().flatten().for_each(|&bone| taken[bone] = true);
        // What nothing is known of goes by its name, where that is one bone's alone.
        let mut named: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (index, bone) in source.bones().iter().enumerate() {
            if !taken[index] && found.bones[index].is_none() {
                named.entry(plain(&bone.name)).or_default().push(index);
            }
        }
        for (index, bone) in target.bones().iter().enumerate() {
            if of_target[index].is_none() && wanted.bones[index].is_none() {
                of_target[index] = match named.remove(&plain(&bone.name)).as_deref() {
                    Some([one]) => Some(*one),
                    _ => None,
                };
            }
        }
        Self { source: found, target: wanted, of_target }
    }

    /// Both bones that are this part.
    pub(super) fn both(&self, bone: HumanoidBone) -> Option<[usize; 2]> {
        Some([self.source.find(bone)?, self.target.find(bone)?])
    }

    /// The ends of both limbs that begin with a pair: the heads of the pair that comes next.
    pub(super) fn next(&self, target: &Skeleton, bone: usize) -> Option<[usize; 2]> {
        if let Some(own) = self.target.bones[bone] {
            let part = match own.bone.part {
                HumanoidPart::Finger(finger, segment @ 1..=2) => HumanoidPart::Finger(finger, segment + 1),
                part => next_part(part)?,
            };
            return self.both(HumanoidBone { part, ..own.bone });
        }
        let mut below = target.children(bone).filter_map(|child| Some([self.of_target[child]?, child]));
        let one = below.next()?;
        below.next().is_none().then_some(one)
    }
}

/// A name without what programs put before it, in lower case.
fn plain(name: &str) -> String {
    name.rsplit([':', '|']).next().unwrap_or(name).to_lowercase()
}
