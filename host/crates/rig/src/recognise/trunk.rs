//! The bones of the middle: hips, spine, neck, head.

use super::body_plan::BoneTraits;
use super::humanoid::{Evidence, HumanoidPart};
use super::limbs::Found;
use super::names::{Named, Reading};
use crate::skeleton::Skeleton;

/// The bones of the middle, between the first bones of the limbs: `legs` and `arms` are those of both sides.
pub(super) fn trunk(
    skeleton: &Skeleton,
    readings: &[Reading],
    traits: &[BoneTraits],
    legs: &[usize],
    arms: &[usize],
) -> Vec<Found> {
    let says = |bone: usize, named: Named| {
        !readings[bone].is_helper && readings[bone].candidates.iter().any(|&(own, fit)| own == named && fit > 0.5)
    };
    let legs_at = meeting(skeleton, legs);
    let arms_at = meeting(skeleton, arms);
    let mut found = Vec::new();
    let hips = hips(skeleton, legs_at, arms_at, &says);
    if let Some(hips) = hips {
        found.push(sure(hips, HumanoidPart::Hips, says(hips, Named::Hips)));
    }
    // The spine from above the hips to where the arms begin, or the neck, or by names alone.
    let top = arms_at.or_else(|| last_named(skeleton, &says, Named::Trunk));
    let spine: Vec<usize> = match (hips, top) {
        (Some(hips), Some(top)) => {
            let path = path(skeleton, hips, top);
            path.into_iter()
                .filter(|&bone| bone != hips && !says(bone, Named::Neck) && !says(bone, Named::Head))
                .filter(|&bone| !readings[bone].is_helper || says(bone, Named::Trunk))
                .collect()
        }
        _ => Vec::new(),
    };
    let parts: &[(usize, HumanoidPart)] = &match spine.len() {
        0 => vec![],
        1 => vec![(0, HumanoidPart::Spine)],
        2 => vec![(0, HumanoidPart::Spine), (1, HumanoidPart::Chest)],
        n => vec![(0, HumanoidPart::Spine), (n / 2, HumanoidPart::Chest), (n - 1, HumanoidPart::UpperChest)],
    };
    found.extend(parts.iter().map(|&(at, part)| sure(spine[at], part, says(spine[at], Named::Trunk))));
    let taken: Vec<usize> = spine.iter().copied().chain(hips).collect();
    found.extend(neck_and_head(skeleton, readings, traits, top, &taken, &says));
    found
}

/// Where the legs meet; the bone above it, if that is called so and this one is a spine's (Biped hangs its thighs on the
/// spine); where legs and arms meet, if the arms do not hang on it (a pelvis beside the spine).
fn hips(
    skeleton: &Skeleton,
    legs_at: Option<usize>,
    arms_at: Option<usize>,
    says: &impl Fn(usize, Named) -> bool,
) -> Option<usize> {
    let named = || (0..skeleton.len()).find(|&bone| says(bone, Named::Hips));
    let Some(at) = legs_at else { return named() };
    if says(at, Named::Trunk) {
        let above = std::iter::successors(skeleton.bones()[at].parent, |&bone| skeleton.bones()[bone].parent);
        if let Some(named) = above.into_iter().find(|&bone| says(bone, Named::Hips)) {
            return Some(named);
        }
    }
    match arms_at {
        Some(arms) if at != arms && !is_below(skeleton, arms, at) => meeting(skeleton, &[at, arms]).or(Some(at)),
        _ => Some(at),
    }
}

fn neck_and_head(
    skeleton: &Skeleton,
    readings: &[Reading],
    traits: &[BoneTraits],
    top: Option<usize>,
    taken: &[usize],
    says: &impl Fn(usize, Named) -> bool,
) -> Vec<Found> {
    let mut found = Vec::new();
    let is_free = |bone: usize| !taken.contains(&bone) && !readings[bone].is_helper;
    let named_head = (0..skeleton.len()).find(|&bone| says(bone, Named::Head) && is_free(bone));
    let head = named_head.or_else(|| top.and_then(|top| highest_chain(skeleton, traits, top, &is_free)));
    let Some(head) = head else { return found };
    let above = std::iter::successors(skeleton.bones()[head].parent, |&bone| skeleton.bones()[bone].parent);
    let mut between: Vec<usize> = above.take_while(|&bone| Some(bone) != top && !taken.contains(&bone)).collect();
    // Biped hangs its arms on the neck.
    between.extend(top.filter(|&top| says(top, Named::Neck)));
    between.reverse();
    let neck = between.iter().copied().find(|&bone| says(bone, Named::Neck));
    let neck = neck.or_else(|| between.iter().copied().find(|&bone| traits[bone].side.is_none() && is_free(bone)));
    if let Some(neck) = neck {
        found.push(sure(neck, HumanoidPart::Neck, says(neck, Named::Neck)));
    }
    found.push(sure(head, HumanoidPart::Head, named_head.is_some()));
    found
}

/// The last bone of the branch in the middle that reaches highest.
fn highest_chain(
    skeleton: &Skeleton,
    traits: &[BoneTraits],
    top: usize,
    is_free: &impl Fn(usize) -> bool,
) -> Option<usize> {
    let length = |bone: usize| traits[bone].head.distance(traits[bone].tip);
    let middle = |bone: usize| traits[bone].side.is_none() && !traits[bone].tail && is_free(bone);
    let next = |&bone: &usize| {
        let children = skeleton.children(bone).filter(|&child| middle(child));
        children.max_by(|&a, &b| traits[a].tip.y.total_cmp(&traits[b].tip.y))
    };
    let chain: Vec<usize> = std::iter::successors(Some(top), next).skip(1).collect();
    let longest = chain.iter().map(|&bone| length(bone)).fold(0.0, f32::max);
    // Ends without length are no heads.
    chain.into_iter().rfind(|&bone| length(bone) > 0.01 * longest)
}

fn last_named(skeleton: &Skeleton, says: &impl Fn(usize, Named) -> bool, named: Named) -> Option<usize> {
    (0..skeleton.len()).rfind(|&bone| says(bone, named))
}

fn sure(bone: usize, part: HumanoidPart, is_named: bool) -> Found {
    let (evidence, confidence) = if is_named { (Evidence::Name, 0.95) } else { (Evidence::Shape, 0.6) };
    (bone, part, evidence, confidence)
}

/// The lowest bone above all of these.
fn meeting(skeleton: &Skeleton, bones: &[usize]) -> Option<usize> {
    let above = |bone: usize| -> Vec<usize> {
        std::iter::successors(skeleton.bones()[bone].parent, |&bone| skeleton.bones()[bone].parent).collect()
    };
    let (&first, rest) = bones.split_first()?;
    let others: Vec<Vec<usize>> = rest.iter().map(|&bone| above(bone)).collect();
    above(first).into_iter().find(|bone| others.iter().all(|own| own.contains(bone)))
}

/// The bones from one down to another, both included; none if the other is not below it.
fn path(skeleton: &Skeleton, from: usize, to: usize) -> Vec<usize> {
    let up = std::iter::successors(Some(to), |&bone| skeleton.bones()[bone].parent);
    let mut bones: Vec<usize> = up.take_while(|&bone| bone >= from).collect();
    bones.reverse();
    if bones.first() == Some(&from) { bones } else { Vec::new() }
}

fn is_below(skeleton: &Skeleton, bone: usize, above: usize) -> bool {
    std::iter::successors(skeleton.bones()[bone].parent, |&bone| skeleton.bones()[bone].parent).any(|b| b == above)
}
