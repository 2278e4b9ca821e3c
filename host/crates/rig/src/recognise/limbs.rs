//! The bones of an arm or a leg: the chain whose names fit best, or the longest one of a branch that names say nothing of.

use super::body_plan::BoneTraits;
use super::humanoid::{Evidence, HumanoidPart, Side};
use super::names::{Named, Reading};
use crate::skeleton::Skeleton;

/// An arm or a leg.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Limb {
    Arm,
    Leg,
}

/// A bone of a limb, what it is, and how sure that is.
pub(super) type Found = (usize, HumanoidPart, Evidence, f32);

/// A limb's parts from the trunk outwards, what their names are, and how much each counts.
fn parts_of(limb: Limb) -> [(HumanoidPart, Named, f32); 4] {
    match limb {
        Limb::Arm => [
            (HumanoidPart::Shoulder, Named::Shoulder, 0.5),
            (HumanoidPart::UpperArm, Named::UpperArm, 1.0),
            (HumanoidPart::LowerArm, Named::LowerArm, 1.0),
            (HumanoidPart::Hand, Named::Hand, 0.9),
        ],
        Limb::Leg => [
            (HumanoidPart::UpperLeg, Named::UpperLeg, 1.0),
            (HumanoidPart::LowerLeg, Named::LowerLeg, 1.0),
            (HumanoidPart::Foot, Named::Foot, 0.9),
            (HumanoidPart::Toes, Named::Toes, 0.4),
        ],
    }
}

/// Two parts that names fit: less may be a coincidence.
const LEAST_SCORE: f32 = 1.1;

/// The limb of this side whose names fit best: parts follow each other down the tree, others may lie between them. Empty
/// if no two names fit. `sides`: the side of each bone, its own or its parent's.
pub(super) fn named_limb(
    skeleton: &Skeleton,
    readings: &[Reading],
    sides: &[Option<Side>],
    limb: Limb,
    side: Side,
) -> Vec<Found> {
    let parts = parts_of(limb);
    let fit = |bone: usize, part: usize| {
        let reading = &readings[bone];
        if reading.is_helper || sides[bone] != Some(side) {
            return 0.0;
        }
        let (_, named, weight) = parts[part];
        reading.candidates.iter().find(|(candidate, _)| *candidate == named).map_or(0.0, |(_, fit)| weight * fit)
    };
    // What the bones from each one down can score with the parts from each one on; below it, and by which child.
    let mut from = vec![[Choice::default(); 5]; skeleton.len()];
    let mut below = vec![[(0.0_f32, None::<usize>); 5]; skeleton.len()];
    for bone in (0..skeleton.len()).rev() {
        for part in 0..parts.len() {
            let (score, child) = below[bone][part];
            let mut choice = Choice { score, takes: None, child };
            for taken in part..parts.len() {
                let fit = fit(bone, taken);
                let (rest, child) = below[bone][taken + 1];
                // Of equals, the one nearer to the trunk.
                if fit > 0.0 && fit + rest >= choice.score {
                    choice = Choice { score: fit + rest, takes: Some(taken), child };
                }
            }
            from[bone][part] = choice;
            if let Some(parent) = skeleton.bones()[bone].parent
                && choice.score > 0.0
                && choice.score >= below[parent][part].0
            {
                below[parent][part] = (choice.score, Some(bone));
            }
        }
    }
    // Of equals the highest, from which the way leads to the first bone that takes a part.
    let start = (0..skeleton.len()).rev().max_by(|&a, &b| from[a][0].score.total_cmp(&from[b][0].score));
    let mut next = start.filter(|&bone| from[bone][0].score >= LEAST_SCORE);
    let (mut found, mut part) = (Vec::new(), 0);
    while let Some(bone) = next.filter(|_| part < parts.len()) {
        let choice = from[bone][part];
        if let Some(taken) = choice.takes {
            let clear = readings[bone].candidates.len() == 1;
            let (evidence, confidence) = if clear { (Evidence::Name, 0.95) } else { (Evidence::NameAndPlace, 0.85) };
            found.push((bone, parts[taken].0, evidence, confidence));
            part = taken + 1;
        }
        next = choice.child;
    }
    found
}

#[derive(Clone, Copy, Default)]
struct Choice {
    score: f32,
    /// The part that the bone itself takes.
    takes: Option<usize>,
    child: Option<usize>,
}

/// The limb that begins with this bone, by its shape alone.
pub(super) fn shaped_limb(skeleton: &Skeleton, traits: &[BoneTraits], limb: Limb, first: usize) -> Vec<Found> {
    let length = |bone: usize| traits[bone].head.distance(traits[bone].tip);
    let chain = chain(skeleton, traits, first);
    let whole: f32 = chain.iter().map(|&bone| length(bone)).sum();
    // Ends and hubs are no segments.
    let bones: Vec<usize> = chain.into_iter().filter(|&bone| length(bone) > 0.01 * whole).collect();
    let parts = parts_of(limb).map(|(part, _, _)| part);
    let taken: &[HumanoidPart] = match (limb, bones.len()) {
        (_, 0) => &[],
        (Limb::Arm, 1) => &parts[1..2],
        (Limb::Arm, 2) => &parts[1..3],
        (Limb::Arm, 3) if length(bones[0]) < 0.6 * length(bones[1]) => &parts[..3],
        (Limb::Arm, 3) => &parts[1..],
        (Limb::Arm | Limb::Leg, _) => &parts[..bones.len().min(4)],
    };
    bones.iter().zip(taken).map(|(&bone, &part)| (bone, part, Evidence::Shape, 0.5)).collect()
}

/// The longest way down from a bone, without fingers.
fn chain(skeleton: &Skeleton, traits: &[BoneTraits], first: usize) -> Vec<usize> {
    let mut reach = vec![0.0_f32; skeleton.len()];
    for bone in (first..skeleton.len()).rev() {
        reach[bone] += traits[bone].head.distance(traits[bone].tip);
        if let Some(parent) = skeleton.bones()[bone].parent.filter(|_| !traits[bone].finger) {
            reach[parent] = reach[parent].max(reach[bone]);
        }
    }
    let next = |&bone: &usize| {
        let children = skeleton.children(bone).filter(|&child| !traits[child].finger);
        children.max_by(|&a, &b| reach[a].total_cmp(&reach[b]))
    };
    std::iter::successors(Some(first), next).collect()
}
