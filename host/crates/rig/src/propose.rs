//! A first mapping from the shapes of the two trees alone.

use std::collections::BTreeMap;

use crate::alignment::{Alignment, BoneShape, JointShape, Tree, hub_variants};
use crate::{ChildOrder, JointAxis, JointTree, Mapping, MappingEntry, PartUid, Skeleton};

/// Bones that rarely have a joint of their own, by a word in their name: they are the first to go without one.
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
/// A bone right after a branching (a collarbone, half a pelvis) goes without a joint sooner than those after it,
const FIRST_OF_BRANCH_FACTOR: f64 = 0.6;
/// unless it is itself as long as this part of the longest bone: a thigh. A puppet with one joint a leg has it there.
const LIMB_SHARE: f64 = 0.6;
const FIRST_OF_LIMB_FACTOR: f64 = 1.2;
/// So does a single root with a single child, which mostly marks the ground.
const GROUND_FACTOR: f64 = 0.5;
/// The part of a bone's importance that does not depend on its length.
const BASE_IMPORTANCE: f64 = 0.1;
/// The extra cost of the next best choice at which an entry's confidence is 1 - 1/e.
const CONFIDENT_MARGIN: f64 = 0.25;
/// Below this margin the other choice is mentioned.
const AMBIGUOUS_MARGIN: f64 = 0.15;
/// Steps and table cells (a second or two, some 30 MB) beyond which no proposal is attempted.
const MAX_WORK: f64 = 5e8;
const MAX_CELLS: usize = 1_000_000;

/// A proposed mapping, and how sure it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proposal {
    /// One entry a joint that found a bone, in tree order.
    pub mapping: Mapping,
    /// For each entry how clearly it beats the next best choice, 0 (a coin toss) to 1.
    pub confidence: Vec<f32>,
    /// Parts with sensors that drive nothing, in tree order.
    pub unmapped_parts: Vec<PartUid>,
    /// Bones that nothing drives, in the skeleton's order.
    pub unmapped_bones: Vec<String>,
    /// What a person should look at, one sentence each.
    pub ambiguities: Vec<String>,
}

/// Proposes which part drives which bone, by the shapes of the two trees: who branches where, how long chains
/// are, how much hangs below. Where shape alone cannot tell (left from right, one finger from the next),
/// outlets and bones are paired in the order of [`ChildOrder`]: a splitter's outlets are expected to run from
/// the character's left to its right, and on one side from front to back. Names of bones are used only to
/// guess which bones usually have no joint (toes, collarbones, end markers).
pub fn propose(tree: &JointTree, skeleton: &Skeleton) -> Proposal {
    let (joints, part_of_joint) = joint_shapes(tree);
    let order = ChildOrder::new(skeleton);
    let bones = bone_shapes(skeleton, &order);
    let cells = (joints.nodes.len() + 1).saturating_mul(bones.nodes.len() + 1);
    if cells > MAX_CELLS || Alignment::work(&joints, &bones) > MAX_WORK {
        return too_large(tree, skeleton, &part_of_joint);
    }
    let variants = hub_variants(&bones, |siblings, parent| order.sort(siblings, parent));
    let mut alignment = Alignment::new(&joints, &bones, &variants);
    let best = alignment.cost();
    let bone_of_joint = alignment.bones_of_joints();
    let mut proposal = Proposal { ambiguities: equal_branches(tree, &joints, &part_of_joint), ..Proposal::default() };
    let mut driven = vec![false; skeleton.len()];
    for (joint, &part) in part_of_joint.iter().enumerate() {
        let uid = tree.parts()[part].uid;
        let Some(bone) = bone_of_joint[joint] else {
            proposal.unmapped_parts.push(uid);
            continue;
        };
        driven[bone] = true;
        let (cost, elsewhere) = alignment.without(joint, bone);
        let margin = (cost - best).max(0.0);
        let name = &skeleton.bones()[bone].name;
        proposal.mapping.entries.push(MappingEntry::new(uid, name.clone()));
        proposal.confidence.push((1.0 - libm::exp(-margin / CONFIDENT_MARGIN)) as f32);
        if margin < AMBIGUOUS_MARGIN {
            let other = elsewhere.map_or("no bone at all".into(), |b| format!("{:?}", skeleton.bones()[b].name));
            proposal.ambiguities.push(format!("part {part} ({uid}) drives {name:?}; {other} would fit nearly as well"));
        }
    }
    let undriven = skeleton.bones().iter().zip(driven).filter(|(_, driven)| !driven);
    proposal.unmapped_bones = undriven.map(|(bone, _)| bone.name.clone()).collect();
    proposal
}

fn too_large(tree: &JointTree, skeleton: &Skeleton, part_of_joint: &[usize]) -> Proposal {
    Proposal {
        unmapped_parts: part_of_joint.iter().map(|&part| tree.parts()[part].uid).collect(),
        unmapped_bones: skeleton.bones().iter().map(|bone| bone.name.clone()).collect(),
        ambiguities: vec![format!(
            "{} joints and {} bones are too many to compare; write a mapping file",
            part_of_joint.len(),
            skeleton.len()
        )],
        ..Proposal::default()
    }
}

/// The tree of parts that have sensors, with the part of every joint; splitters are looked through.
fn joint_shapes(tree: &JointTree) -> (Tree<JointShape>, Vec<usize>) {
    let parts = tree.parts();
    let is_joint = |part: usize| !parts[part].kind.axes().is_empty();
    let part_of_joint: Vec<usize> = (0..parts.len()).filter(|&part| is_joint(part)).collect();
    let mut joint_of_part = vec![None; parts.len()];
    for (joint, &part) in part_of_joint.iter().enumerate() {
        joint_of_part[part] = Some(joint);
    }
    // Outlets from the root to every part decide the order, because a splitter may hang on a splitter.
    let mut above: Vec<Option<usize>> = Vec::with_capacity(parts.len());
    let mut outlets: Vec<Vec<usize>> = Vec::with_capacity(parts.len());
    for (index, part) in parts.iter().enumerate() {
        above.push(part.parent.and_then(|p| joint_of_part[p].or(above[p])));
        let mut path = part.parent.map_or_else(Vec::new, |p| if is_joint(p) { Vec::new() } else { outlets[p].clone() });
        path.push(if part.parent.is_some() { part.outlet as usize } else { index });
        outlets.push(path);
    }
    let count = part_of_joint.len();
    let mut joints = Tree { nodes: Vec::new(), parent: Vec::new(), children: vec![Vec::new(); count + 1] };
    for (joint, &part) in part_of_joint.iter().enumerate() {
        let axes = parts[part].kind.axes();
        joints.nodes.push(JointShape {
            bends: axes.contains(&JointAxis::Bend),
            one_axis: axes.len() == 1,
            straight: parts[part].parent.is_some_and(is_joint),
        });
        joints.parent.push(above[part]);
        joints.children[above[part].unwrap_or(count)].push(joint);
    }
    for children in &mut joints.children {
        children.sort_by(|&a, &b| outlets[part_of_joint[a]].cmp(&outlets[part_of_joint[b]]));
    }
    (joints, part_of_joint)
}

fn bone_shapes(skeleton: &Skeleton, order: &ChildOrder) -> Tree<BoneShape> {
    let segments = skeleton.rest_segments();
    let length = |bone: usize| f64::from(segments[bone].0.distance(segments[bone].1));
    let longest = (0..skeleton.len()).map(length).fold(0.0, f64::max);
    let mut nodes = Vec::with_capacity(skeleton.len());
    for (index, bone) in skeleton.bones().iter().enumerate() {
        // Far below any real bone: exporters write 1e-7 where they mean nothing.
        let hub = length(index) <= 1e-4 * longest;
        let siblings = bone.parent.map_or_else(|| order.roots(), |parent| order.children(parent));
        let mut importance = BASE_IMPORTANCE + (1.0 - BASE_IMPORTANCE) * length(index) / longest;
        if siblings.len() > 1 {
            let is_limb = length(index) >= LIMB_SHARE * longest;
            importance *= if is_limb { FIRST_OF_LIMB_FACTOR } else { FIRST_OF_BRANCH_FACTOR };
        } else if bone.parent.is_none() && order.children(index).len() == 1 {
            importance *= GROUND_FACTOR;
        }
        if words(&bone.name).iter().any(|word| SELDOM_DRIVEN.contains(&word.as_str())) {
            importance *= SELDOM_DRIVEN_FACTOR;
        }
        nodes.push(BoneShape { importance: if hub { 0.0 } else { importance }, hub });
    }
    let mut children: Vec<Vec<usize>> = (0..skeleton.len()).map(|bone| order.children(bone).to_vec()).collect();
    children.push(order.roots().to_vec());
    Tree { nodes, parent: skeleton.bones().iter().map(|bone| bone.parent).collect(), children }
}

/// "mixamorig:LeftHandThumb1" → mixamorig, left, hand, thumb.
fn words(name: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut after_small = false;
    for c in name.chars() {
        if !c.is_alphabetic() || (c.is_uppercase() && after_small) {
            words.push(String::new());
        }
        if c.is_alphabetic()
            && let Some(word) = words.last_mut()
        {
            word.extend(c.to_lowercase());
        }
        after_small = c.is_lowercase();
    }
    words.retain(|word| !word.is_empty());
    words
}

/// One sentence for every joint after which branches of one shape follow.
fn equal_branches(tree: &JointTree, joints: &Tree<JointShape>, part_of_joint: &[usize]) -> Vec<String> {
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
                "{equal} of the branches after {place} have the same shape as another; they are told apart by their \
                 outlets, which are taken to run from the character's left to its right and from front to back"
            ));
        }
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fall_into_words() {
        assert_eq!(words("mixamorig:LeftHandThumb1"), ["mixamorig", "left", "hand", "thumb"]);
        assert_eq!(words("lowerarm_twist_01.l"), ["lowerarm", "twist", "l"]);
        assert_eq!(words("HeadTop_End"), ["head", "top", "end"]);
        assert!(words("  ").is_empty());
    }
}
