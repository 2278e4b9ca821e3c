//! What of a proposed mapping a person should look at, in sentences.

use std::collections::BTreeMap;

use super::alignment::{JointShape, Tree};
use super::hints::PuppetHints;
use super::puppet_plan::PuppetPlan;
use crate::puppet::JointTree;
use crate::recognise::vocabulary::meaning;

/// One sentence for every joint after which branches of one shape follow.
pub(super) fn equal_branches(tree: &JointTree, joints: &Tree<JointShape>, part_of_joint: &[usize]) -> Vec<String> {
    let mut numbers: BTreeMap<(bool, bool, Vec<usize>), usize> = BTreeMap::new();
    let mut shape = vec![0_usize; joints.nodes.len()];
    for joint in (0..joints.nodes.len()).rev() {
        let mut below: Vec<usize> = joints.children[joint].iter().map(|&child| shape[child]).collect();
        below.sort_unstable();
        let next = numbers.len();
        let node = joints.nodes[joint];
        shape[joint] = *numbers.entry((node.bends, node.one_axis, below)).or_insert(next);
    }
    let mut sentences = Vec::new();
    for (joint, children) in joints.children.iter().enumerate() {
        let mut count: BTreeMap<usize, usize> = BTreeMap::new();
        for &child in children {
            *count.entry(shape[child]).or_default() += 1;
        }
        let equal: usize = count.values().filter(|&&n| n > 1).sum();
        if equal > 1 {
            let place = part_of_joint
                .get(joint)
                .map_or("the root".into(), |&part| format!("part {part} ({})", tree.parts()[part].uid));
            sentences.push(format!(
                "{equal} of the branches after {place} have the same shape as another; they are distinguished by \
                 their outlets, which are assumed to run from the character's left to its right and from front to back"
            ));
        }
    }
    sentences
}

/// What the puppet's shape cannot decide and no hint states: which end of it the root is, and which joints have no bone.
pub(super) fn doubts(
    tree: &JointTree,
    plan: &PuppetPlan,
    bone_of_joint: &[Option<usize>],
    hints: &PuppetHints,
) -> Vec<String> {
    let mut sentences = Vec::new();
    let known = |joint: usize| {
        let uid = tree.parts()[plan.part_of_joint[joint]].uid;
        hints.names.get(&uid).is_some_and(|name| meaning(name).limb.is_some())
    };
    let shape = |joints: &[usize]| -> Vec<JointShape> {
        joints.iter().map(|&joint| JointShape { straight: false, ..plan.joints.nodes[joint] }).collect()
    };
    for (at, (near, _)) in plan.pairs.iter().enumerate() {
        for (far, _) in &plan.pairs[at + 1..] {
            if shape(near) == shape(far) && !near.iter().chain(far).any(|&joint| known(joint)) {
                let part = |joints: &[usize]| plan.part_of_joint[joints[0]];
                sentences.push(format!(
                    "the two limbs from part {} on have the same shape as the two from part {} on; which of them are the \
                     arms is guessed from which are nearer to the root, so a puppet held by its head or chest gets them \
                     the wrong way round",
                    part(near),
                    part(far)
                ));
            }
        }
    }
    if let [(only, _)] = &plan.pairs[..]
        && !only
            .iter()
            .any(|&joint| known(joint) || hints.segments.contains_key(&tree.parts()[plan.part_of_joint[joint]].uid))
    {
        sentences.push(format!(
            "the puppet has one pair of limbs, from part {} on; whether they are arms or legs is unknown",
            plan.part_of_joint[only[0]]
        ));
    }
    let unused = bone_of_joint.iter().filter(|bone| bone.is_none()).count();
    if unused > 0 {
        let joints = if unused == 1 { "joint has" } else { "joints have" };
        sentences.push(format!("{unused} {joints} no bone: the character has no place like theirs that is free"));
    }
    sentences
}
