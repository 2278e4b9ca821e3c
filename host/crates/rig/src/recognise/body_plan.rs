//! What a skeleton is by its shape: which bones lie in the middle, which have a counterpart on the other side, what is a
//! limb, a finger, a tail.

use std::collections::BTreeMap;

use glam::Vec3;

use super::humanoid::Side;
use super::vocabulary::{Limb, Meaning, meaning};
use crate::skeleton::Skeleton;

/// A bone no further from the plane of symmetry than this part of the skeleton's size lies in it.
const IN_PLANE: f32 = 0.01;
/// A counterpart is no further from the mirror image than this part of the skeleton's size.
const MIRRORED: f32 = 0.02;
/// What branches off within a limb is a finger, if it reaches no further than this part of the limb before it.
const FINGER_SHARE: f32 = 0.6;
/// A tail ends further back than it begins, by this part of the skeleton's size.
const LEADS_BACK: f32 = 0.05;
/// A branch to the side that reaches no further than this part of the skeleton's size is no limb: an eye, an ear.
const APPENDAGE: f32 = 0.1;
/// Counterparts are not looked for in skeletons of more bones.
const MOST_MIRRORED: usize = 4096;

/// What is known of one bone.
#[derive(Clone, Copy, Debug)]
#[expect(clippy::struct_excessive_bools, reason = "each mark is one that a bone may bear beside any other")]
pub(crate) struct BoneTraits {
    pub(crate) side: Option<Side>,
    /// Its counterpart on the other side.
    pub(crate) mirror: Option<usize>,
    /// Its branch has the same shape as its counterpart's.
    pub(crate) paired: bool,
    /// It lies in the middle, and another branch in the middle beside its own has the same shape.
    pub(crate) has_twin: bool,
    /// It carries limbs of both sides.
    pub(crate) trunk: bool,
    /// It begins an arm and is shorter than what follows: a collarbone.
    pub(crate) collarbone: bool,
    /// It belongs to a short branch on the head or trunk: an eye, an ear.
    pub(crate) appendage: bool,
    pub(crate) finger: bool,
    /// It leads backwards in the middle and carries nothing.
    pub(crate) tail: bool,
    /// It belongs to the pair of limbs nearest to the head, where there are several.
    pub(crate) arm: bool,
    pub(crate) meaning: Meaning,
    pub(crate) head: Vec3,
    pub(crate) tip: Vec3,
}

/// What each bone is, in the skeleton's order.
pub(crate) fn body_plan(skeleton: &Skeleton) -> Vec<BoneTraits> {
    let segments = skeleton.rest_segments();
    let count = skeleton.len();
    let ends = || segments.iter().flat_map(|(head, tip)| [*head, *tip]);
    let low = ends().fold(Vec3::INFINITY, Vec3::min);
    let high = ends().fold(Vec3::NEG_INFINITY, Vec3::max);
    let size = if count > 0 { (high - low).max_element().max(f32::MIN_POSITIVE) } else { 1.0 };
    let plane = middle(&segments);
    let in_plane = |at: Vec3| (at.x - plane).abs() <= IN_PLANE * size;
    let central: Vec<bool> = segments.iter().map(|(head, tip)| in_plane(*head) && in_plane(*tip)).collect();
    let mirrored = |at: Vec3| Vec3::new(2.0 * plane - at.x, at.y, at.z);
    let mirror_of = |bone: usize| {
        let (head, tip) = (mirrored(segments[bone].0), mirrored(segments[bone].1));
        let off = |other: usize| segments[other].0.distance(head).max(segments[other].1.distance(tip));
        let found = (0..count).filter(|&other| other != bone && !central[other]);
        found.min_by(|&a, &b| off(a).total_cmp(&off(b))).filter(|&other| off(other) <= MIRRORED * size)
    };
    let mut traits: Vec<BoneTraits> = (0..count)
        .map(|bone| {
            let (head, tip) = segments[bone];
            let x = 0.5 * (head.x + tip.x) - plane;
            let side = (!central[bone]).then_some(if x > 0.0 { Side::Left } else { Side::Right });
            let mirror = if central[bone] || count > MOST_MIRRORED { None } else { mirror_of(bone) };
            let meaning = meaning(&skeleton.bones()[bone].name);
            BoneTraits {
                side,
                mirror,
                paired: false,
                has_twin: false,
                trunk: false,
                collarbone: false,
                appendage: false,
                finger: false,
                tail: false,
                arm: false,
                meaning,
                head,
                tip,
            }
        })
        .collect();
    mark_likeness(skeleton, &central, &mut traits);
    mark_trunk(skeleton, &central, size, &mut traits);
    mark_tails(skeleton, &central, size, &mut traits);
    mark_fingers(skeleton, &central, &mut traits);
    mark_arms(skeleton, &central, &mut traits);
    traits
}

/// Which branches have the same shape, by the numbers of bones below each other.
fn mark_likeness(skeleton: &Skeleton, central: &[bool], traits: &mut [BoneTraits]) {
    let mut numbers: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    let mut below = vec![Vec::new(); skeleton.len()];
    let mut shape = vec![0; skeleton.len()];
    for bone in (0..skeleton.len()).rev() {
        let mut own = std::mem::take(&mut below[bone]);
        own.sort_unstable();
        let next = numbers.len();
        shape[bone] = *numbers.entry(own).or_insert(next);
        if let Some(parent) = skeleton.bones()[bone].parent {
            below[parent].push(shape[bone]);
        }
    }
    let twins =
        |bone: usize| skeleton.bones()[bone].parent.filter(|_| central[bone]).map(|parent| (parent, shape[bone]));
    let mut alike: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for key in (0..skeleton.len()).filter_map(twins) {
        *alike.entry(key).or_default() += 1;
    }
    for bone in 0..skeleton.len() {
        let parent = |bone: usize| skeleton.bones()[bone].parent;
        let face = |a: usize, b: usize| match (parent(a), parent(b)) {
            (Some(above), Some(other)) if above != other => traits[above].paired && traits[above].mirror == Some(other),
            (above, other) => above == other,
        };
        let mirror = traits[bone].mirror.filter(|&mirror| shape[bone] == shape[mirror]);
        traits[bone].paired = mirror.is_some_and(|mirror| face(bone, mirror));
        let above = skeleton.bones()[bone].parent.is_some_and(|parent| traits[parent].has_twin);
        traits[bone].has_twin = above || twins(bone).is_some_and(|key| alike[&key] > 1);
    }
}

/// The x of the plane of symmetry: that of the roots, which lie in it in every figure there is.
fn middle(segments: &[(Vec3, Vec3)]) -> f32 {
    segments.first().map_or(0.0, |(head, _)| head.x)
}

/// How far the branch that begins with each bone reaches, along its bones.
fn reaches(skeleton: &Skeleton, traits: &[BoneTraits]) -> Vec<f32> {
    let mut reach = vec![0.0_f32; skeleton.len()];
    for bone in (0..skeleton.len()).rev() {
        reach[bone] += traits[bone].head.distance(traits[bone].tip);
        if let Some(parent) = skeleton.bones()[bone].parent {
            reach[parent] = reach[parent].max(reach[bone]);
        }
    }
    reach
}

/// What carries limbs of both sides, and what branches off to the sides and is no limb.
fn mark_trunk(skeleton: &Skeleton, central: &[bool], size: f32, traits: &mut [BoneTraits]) {
    let reach = reaches(skeleton, traits);
    let has_limbs = (0..skeleton.len()).any(|bone| traits[bone].mirror.is_some() && reach[bone] > APPENDAGE * size);
    for bone in 0..skeleton.len() {
        let Some(parent) = skeleton.bones()[bone].parent else { continue };
        let begins = has_limbs && central[parent] && !central[bone] && reach[bone] <= APPENDAGE * size;
        traits[bone].appendage = begins || traits[parent].appendage;
    }
    for bone in (0..skeleton.len()).rev() {
        let Some(parent) = skeleton.bones()[bone].parent else { continue };
        let carries = !central[bone] && traits[bone].mirror.is_some() && !traits[bone].appendage;
        if central[parent] && (carries || (central[bone] && traits[bone].trunk)) {
            traits[parent].trunk = true;
        }
    }
}

/// Marks these bones and everything below them.
fn with_all_below(skeleton: &Skeleton, first: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut marked = vec![false; skeleton.len()];
    for bone in 0..skeleton.len() {
        marked[bone] = first(bone) || skeleton.bones()[bone].parent.is_some_and(|parent| marked[parent]);
    }
    marked
}

/// Chains in the middle that carry no limbs and lead backwards and down.
fn mark_tails(skeleton: &Skeleton, central: &[bool], size: f32, traits: &mut [BoneTraits]) {
    // Of each bone in such a chain, the chain's first bone; of each first bone, the chain's furthest end.
    let mut chain: Vec<Option<usize>> = vec![None; skeleton.len()];
    let mut end: Vec<Vec3> = traits.iter().map(|bone| bone.head).collect();
    for bone in 0..skeleton.len() {
        let Some(parent) = skeleton.bones()[bone].parent else { continue };
        let begins = central[bone] && !traits[bone].trunk && traits[parent].trunk;
        chain[bone] = if begins { Some(bone) } else { chain[parent] };
        if let Some(first) = chain[bone] {
            let (head, tip) = (traits[first].head, traits[bone].tip);
            end[first] = if tip.distance(head) > end[first].distance(head) { tip } else { end[first] };
        }
    }
    let leads_back = |first: usize| {
        let way = end[first] - traits[first].head;
        way.z < -LEADS_BACK * size && way.y + way.z < 0.0
    };
    let named = |bone: usize| traits[bone].meaning.limb == Some(Limb::Tail);
    let tail = with_all_below(skeleton, |bone| named(bone) || (chain[bone] == Some(bone) && leads_back(bone)));
    for (bone, own) in traits.iter_mut().enumerate() {
        own.tail = tail[bone] && !own.trunk;
    }
}

/// What branches off within a limb and is short beside it.
fn mark_fingers(skeleton: &Skeleton, central: &[bool], traits: &mut [BoneTraits]) {
    let count = skeleton.len();
    let length = |bone: usize| traits[bone].head.distance(traits[bone].tip);
    // From the limb's root to the end of the bone, and the longest way below it.
    let mut before = vec![0.0_f32; count];
    let reach = reaches(skeleton, traits);
    let mut children = vec![0_usize; count];
    for bone in 0..count {
        if let Some(parent) = skeleton.bones()[bone].parent {
            children[parent] += 1;
            before[bone] = if central[parent] { 0.0 } else { before[parent] };
        }
        before[bone] += if central[bone] { 0.0 } else { length(bone) };
    }
    let mut finger = vec![false; count];
    for bone in 0..count {
        let Some(parent) = skeleton.bones()[bone].parent else { continue };
        let branches = !central[parent] && children[parent] > 1 && reach[bone] < FINGER_SHARE * before[parent];
        finger[bone] = finger[parent] || branches;
    }
    for (bone, own) in traits.iter_mut().enumerate() {
        own.finger = finger[bone] || own.meaning.limb == Some(Limb::Digit);
    }
}

/// Of the pairs of limbs on the trunk, those that begin nearest to the head's end of it; a single pair is neither.
fn mark_arms(skeleton: &Skeleton, central: &[bool], traits: &mut [BoneTraits]) {
    let parent = |bone: usize| skeleton.bones()[bone].parent;
    let begins = |bone: usize| {
        let on_trunk = parent(bone).is_some_and(|parent| central[parent]);
        on_trunk && !central[bone] && traits[bone].mirror.is_some() && !traits[bone].appendage
    };
    let mut depth = vec![0_usize; skeleton.len()];
    for bone in 0..skeleton.len() {
        depth[bone] = parent(bone).map_or(0, |parent| depth[parent] + 1);
    }
    let depths = || (0..skeleton.len()).filter(|&bone| begins(bone)).map(|bone| depth[bone]);
    let (least, most) = (depths().min(), depths().max());
    let begins_arm = |bone: usize| {
        let by_shape = least < most && Some(depth[bone]) == most;
        begins(bone) && traits[bone].meaning.limb.map_or(by_shape, |named| named == Limb::Arm)
    };
    let arm = with_all_below(skeleton, begins_arm);
    // How many bones an arm has, without its fingers.
    let mut below = vec![0_usize; skeleton.len()];
    for bone in (0..skeleton.len()).rev() {
        below[bone] += usize::from(!traits[bone].finger);
        if let Some(parent) = parent(bone) {
            below[parent] += below[bone];
        }
    }
    let length = |bone: usize| traits[bone].head.distance(traits[bone].tip);
    let is_collarbone = |bone: usize| {
        let next = skeleton.children(bone).next();
        begins_arm(bone) && below[bone] > 3 && next.is_some_and(|next| length(bone) < length(next))
    };
    let collarbone: Vec<bool> = (0..skeleton.len()).map(is_collarbone).collect();
    for (bone, own) in traits.iter_mut().enumerate() {
        (own.arm, own.collarbone) = (arm[bone], collarbone[bone]);
    }
}
