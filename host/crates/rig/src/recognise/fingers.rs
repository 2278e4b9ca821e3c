//! The fingers of a hand.

use glam::Vec3;

use super::body_plan::BoneTraits;
use super::humanoid::{Evidence, Finger, HumanoidPart};
use super::limbs::Found;
use super::names::{Named, Reading};
use crate::skeleton::Skeleton;

/// A finger has three bones; what follows is its tip.
const SEGMENTS: usize = 3;

/// The fingers below a hand: by their names, or by their places where no name says which is which.
pub(super) fn fingers(skeleton: &Skeleton, readings: &[Reading], traits: &[BoneTraits], hand: usize) -> Vec<Found> {
    let below = below(skeleton, hand);
    let finger_of = |bone: usize| {
        readings[bone].candidates.iter().find_map(|(named, _)| match named {
            Named::Finger(finger) => Some(*finger),
            _ => None,
        })
    };
    let mut found = Vec::new();
    for finger in Finger::ALL {
        let first = below.iter().copied().find(|&bone| finger_of(bone) == Some(finger) && !readings[bone].is_helper);
        found.extend(
            first.into_iter().flat_map(|first| segments(skeleton, readings, first, finger, Evidence::Name, 0.95)),
        );
    }
    if found.is_empty() { fingers_by_shape(skeleton, readings, traits, hand) } else { found }
}

fn segments(
    skeleton: &Skeleton,
    readings: &[Reading],
    first: usize,
    finger: Finger,
    evidence: Evidence,
    confidence: f32,
) -> Vec<Found> {
    let next = |&bone: &usize| skeleton.children(bone).find(|&child| !readings[child].is_helper);
    let chain = std::iter::successors(Some(first), next).take(SEGMENTS);
    let part = |at: usize| HumanoidPart::Finger(finger, at as u8 + 1);
    chain.enumerate().map(|(at, bone)| (bone, part(at), evidence, confidence)).collect()
}

/// Four or five chains that branch off: the thumb begins nearest to the wrist and points most to the side, the others
/// follow from its side.
fn fingers_by_shape(skeleton: &Skeleton, readings: &[Reading], traits: &[BoneTraits], hand: usize) -> Vec<Found> {
    let firsts: Vec<usize> = skeleton
        .children(hand)
        .filter(|&child| !readings[child].is_helper && skeleton.children(child).next().is_some())
        .collect();
    if !(4..=5).contains(&firsts.len()) {
        return Vec::new();
    }
    let wrist = traits[hand].head;
    let way = |bone: usize| (traits[bone].tip - traits[bone].head).normalize_or_zero();
    let mean = firsts.iter().map(|&bone| traits[bone].tip - wrist).sum::<Vec3>().normalize_or_zero();
    let Some(&thumb) = firsts.iter().min_by(|&&a, &&b| way(a).dot(mean).total_cmp(&way(b).dot(mean))) else {
        return Vec::new();
    };
    let mut others: Vec<usize> = firsts.iter().copied().filter(|&bone| bone != thumb).collect();
    let from_thumb = |bone: usize| traits[bone].head.distance(traits[thumb].head);
    others.sort_by(|&a, &b| from_thumb(a).total_cmp(&from_thumb(b)));
    let named = std::iter::once(thumb).chain(others).zip(Finger::ALL);
    named.flat_map(|(bone, finger)| segments(skeleton, readings, bone, finger, Evidence::Shape, 0.4)).collect()
}

/// All bones below one, parents first.
pub(super) fn below(skeleton: &Skeleton, bone: usize) -> Vec<usize> {
    let mut is_below = vec![false; skeleton.len()];
    let mut found = Vec::new();
    for (index, other) in skeleton.bones().iter().enumerate().skip(bone + 1) {
        if other.parent.is_some_and(|parent| parent == bone || is_below[parent]) {
            is_below[index] = true;
            found.push(index);
        }
    }
    found
}
