//! Where one joint stands for a whole spine, neck or tail, all its bones turn.

use super::entries::MappingEntry;
use super::shares::{SharedJoint, Sharing};
use crate::recognise::body_plan::BoneTraits;
use crate::recognise::{Figure, HumanoidBone, HumanoidPart, Recognition};
use crate::skeleton::Skeleton;

/// Joints that are shared, in the order of `entries`: the only one on a spine, neck or tail of several bones turns all of
/// them, each as much as the next. Where several joints are on one, they stay on the bones they have.
pub(super) fn proposed_shares(
    skeleton: &Skeleton,
    recognition: &Recognition,
    traits: &[BoneTraits],
    entries: &[MappingEntry],
) -> Vec<SharedJoint> {
    let drives: Vec<(usize, &MappingEntry)> =
        entries.iter().filter_map(|entry| Some((skeleton.find(&entry.bone)?, entry))).collect();
    let mut shared = Vec::new();
    for run in runs(skeleton, recognition, traits) {
        let Some(&last) = run.last().filter(|_| run.len() > 1) else { continue };
        let mut on_run = drives.iter().filter(|(bone, _)| run.contains(bone));
        let (Some((_, joint)), None) = (on_run.next(), on_run.next()) else { continue };
        // What hangs on it further up would turn less than the joint says.
        let hangs_at = |bone: usize| {
            std::iter::successors(skeleton.bones()[bone].parent, |&bone| skeleton.bones()[bone].parent)
                .find(|above| run.contains(above))
        };
        let others = drives.iter().filter(|(bone, _)| !run.contains(bone));
        if others.filter_map(|(bone, _)| hangs_at(*bone)).any(|at| at != last) {
            continue;
        }
        let share = 1.0 / run.len() as f64;
        let bones = run.iter().map(|&bone| (skeleton.bones()[bone].name.clone(), share)).collect();
        shared.push(SharedJoint { part: joint.part, sharing: Sharing::Chain, bones });
    }
    shared.sort_by_key(|joint| entries.iter().position(|entry| entry.part == joint.part));
    shared
}

/// Spine, neck and tail, where the skeleton has them, each from its first bone to its last.
fn runs(skeleton: &Skeleton, recognition: &Recognition, traits: &[BoneTraits]) -> Vec<Vec<usize>> {
    let middle = |part| recognition.find(HumanoidBone { part, side: None });
    let between = |first: Option<usize>, last: Option<usize>| first.zip(last).map(|(a, b)| line(skeleton, a, b));
    let mut runs = Vec::new();
    if matches!(recognition.figure, Figure::Human | Figure::Quadruped) {
        let top = middle(HumanoidPart::UpperChest).or_else(|| middle(HumanoidPart::Chest));
        runs.extend(between(middle(HumanoidPart::Spine), top));
        let below_head = middle(HumanoidPart::Head).and_then(|head| skeleton.bones()[head].parent);
        runs.extend(between(middle(HumanoidPart::Neck), below_head));
    }
    let is_first = |bone: usize| traits[bone].tail && skeleton.bones()[bone].parent.is_none_or(|p| !traits[p].tail);
    for first in (0..skeleton.len()).filter(|&bone| is_first(bone)) {
        let only = |&bone: &usize| {
            let mut below = skeleton.children(bone).filter(|&child| traits[child].tail);
            below.next().filter(|_| below.next().is_none())
        };
        // Marks at the end have no length and turn nothing.
        let chain = std::iter::successors(Some(first), only);
        runs.push(chain.filter(|&bone| traits[bone].head.distance(traits[bone].tip) > 0.0).collect());
    }
    runs
}

/// The bones from one down to another, both included; none if the other is not below it.
fn line(skeleton: &Skeleton, from: usize, to: usize) -> Vec<usize> {
    let up = std::iter::successors(Some(to), |&bone| skeleton.bones()[bone].parent);
    let mut bones: Vec<usize> = up.take_while(|&bone| bone >= from).collect();
    bones.reverse();
    if bones.first() == Some(&from) { bones } else { Vec::new() }
}
