//! What the alignment knows of a skeleton's bones: how much each matters, and where the tree may be opened.

use super::alignment::{BoneShape, Tree};
use crate::recognise::body_plan::BoneTraits;
use crate::recognise::words::words;
use crate::skeleton::{ChildOrder, Skeleton};

/// Bones that rarely have a joint of their own, by a word in their name: they are the first to go without.
const SELDOM_DRIVEN: [&str; 23] = [
    "armature",
    "clavicle",
    "collar",
    "end",
    "eye",
    "eyes",
    "finger",
    "ik",
    "index",
    "jaw",
    "little",
    "metacarpal",
    "middle",
    "nub",
    "pinky",
    "ring",
    "roll",
    "root",
    "scapula",
    "thumb",
    "toe",
    "toes",
    "twist",
];
const SELDOM_DRIVEN_FACTOR: f64 = 0.4;
/// A bone right after a branch that is shorter than the next one (a collarbone, half a pelvis) goes without a joint
/// sooner than that,
const FIRST_OF_BRANCH_FACTOR: f64 = 0.6;
/// unless it is itself at least this fraction of the longest bone: a thigh. A puppet with one joint per leg has it
/// there.
const LIMB_SHARE: f64 = 0.6;
const FIRST_OF_LIMB_FACTOR: f64 = 1.2;
/// So does a single root with a single child, which usually marks the ground.
const GROUND_FACTOR: f64 = 0.5;
/// The share of a bone's importance that does not depend on its length.
const BASE_IMPORTANCE: f64 = 0.1;
/// A bone of the trunk from which limbs branch off matters this much however short it is: the joint that carries the
/// puppet's limbs belongs there.
const CARRIES_LIMBS: f64 = 1.0;
/// So do a tail and fingers: limbs matter more.
const TAIL_FACTOR: f64 = 0.4;
const FINGER_FACTOR: f64 = 0.5;
/// The tree of bones, in the order of their outlets.
pub(super) fn bone_shapes(skeleton: &Skeleton, order: &ChildOrder, traits: &[BoneTraits]) -> Tree<BoneShape> {
    let segments = skeleton.rest_segments();
    let length = |bone: usize| f64::from(segments[bone].0.distance(segments[bone].1));
    let longest = (0..skeleton.len()).map(length).fold(0.0, f64::max);
    let mut nodes = Vec::with_capacity(skeleton.len());
    for (index, bone) in skeleton.bones().iter().enumerate() {
        // Far below any real bone: exporters write 1e-7 for zero.
        let hub = length(index) <= 1e-4 * longest;
        let siblings = bone.parent.map_or_else(|| order.roots(), |parent| order.children(parent));
        let mut importance = BASE_IMPORTANCE + (1.0 - BASE_IMPORTANCE) * length(index) / longest;
        if siblings.len() > 1 && traits[index].finger {
            // A finger with one joint has it where it begins.
            importance *= FIRST_OF_LIMB_FACTOR;
        } else if siblings.len() > 1 {
            let is_limb = length(index) >= LIMB_SHARE * longest;
            // The next one; fingers do not count.
            let next = order.children(index).iter().filter(|&&child| !traits[child].finger);
            let is_short = next.into_iter().any(|&child| length(child) > length(index));
            // Beside eyes and ears alone, it is the end of the head.
            let is_end = order.children(index).is_empty()
                && siblings.iter().all(|&other| other == index || traits[other].appendage);
            importance *= match (is_limb, is_short || is_end) {
                (true, _) => FIRST_OF_LIMB_FACTOR,
                (false, true) => FIRST_OF_BRANCH_FACTOR,
                (false, false) => 1.0,
            };
        } else if bone.parent.is_none() && order.children(index).len() == 1 {
            importance *= GROUND_FACTOR;
        }
        if words(&bone.name).iter().any(|word| SELDOM_DRIVEN.contains(&word.as_str())) {
            importance *= SELDOM_DRIVEN_FACTOR;
        } else if traits[index].finger {
            importance *= FINGER_FACTOR;
        }
        importance *= if traits[index].tail { TAIL_FACTOR } else { 1.0 };
        let limbs = order.children(index).iter().filter(|&&child| traits[child].mirror.is_some());
        if traits[index].trunk && limbs.count() > 1 {
            importance = importance.max(CARRIES_LIMBS);
        }
        nodes.push(BoneShape { importance: if hub { 0.0 } else { importance }, hub, trunk: traits[index].trunk });
    }
    let mut children: Vec<Vec<usize>> = (0..skeleton.len()).map(|bone| order.children(bone).to_vec()).collect();
    children.push(order.roots().to_vec());
    Tree { nodes, parent: skeleton.bones().iter().map(|bone| bone.parent).collect(), children }
}
