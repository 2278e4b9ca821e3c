//! A first mapping, from nothing but the shapes of the two trees.

use super::alignment::{
    Alignment, BoneShape, Input, JointShape, SKIP_JOINT, Tree, Variant, chain_variants, hub_variants,
};
use super::bone_shapes::bone_shapes;
use super::doubts::{doubts, equal_branches};
use super::entries::{Mapping, MappingEntry};
use super::hints::{PuppetHints, PuppetKind};
use super::prices::{kind_of, prices};
use super::puppet_plan::{PuppetPlan, puppet_plan};
use super::share_proposal::proposed_shares;
use super::symmetry::Judge;
use crate::puppet::{JointTree, PartUid};
use crate::recognise::body_plan::{BoneTraits, body_plan};
use crate::recognise::{Side, recognise_by};
use crate::skeleton::{ChildOrder, Skeleton};

/// The extra cost of the next best choice at which an entry's confidence is 1 - 1/e.
const CONFIDENT_MARGIN: f64 = 0.25;
/// Below this margin the alternative is mentioned.
const AMBIGUOUS_MARGIN: f64 = 0.15;
/// Steps and table cells (a second or two, some 30 MB) beyond which no proposal is attempted.
const MAX_WORK: f64 = 5e8;
const MAX_CELLS: usize = 1_000_000;

/// A proposed mapping, and how sure it is.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proposal {
    /// One entry per joint that found a bone, in tree order.
    pub mapping: Mapping,
    /// For each entry, how clearly it beats the next best choice: 0 (a coin toss) to 1.
    pub confidence: Vec<f32>,
    /// Parts with sensors that drive nothing, in tree order.
    pub unmapped_parts: Vec<PartUid>,
    /// Bones that nothing drives, in the skeleton's order.
    pub unmapped_bones: Vec<String>,
    /// What the user should check, one sentence each.
    pub ambiguities: Vec<String>,
}

/// Proposes which part drives which bone, by the shapes of the two trees: what branches where, how long chains are, how
/// much is attached below, what is alike on both sides. Where shape alone cannot decide (left or right, one finger or
/// the next), outlets and bones are paired in the order of [`ChildOrder`]: a splitter's outlets are expected to run from
/// the character's left to its right, and on each side from front to back. Bone names are used only to guess what a bone
/// is (a finger, a tail, toes, a collarbone) and thus whether it usually has a joint. The only joint of a spine, neck or
/// tail of several bones is shared by all of them ([`Mapping::shared`]).
///
/// ```
/// use armature_rig::{Bone, PartUid, Skeleton, Transform, propose, skeleton_puppet};
///
/// let bone = |name: &str, parent, tail: [f32; 3]| Bone {
///     name: name.into(),
///     parent,
///     rest: Transform::IDENTITY,
///     tail: tail.into(),
/// };
/// let up = [0.0, 1.0, 0.0];
/// let skeleton = Skeleton::new(vec![bone("upper", None, up), bone("lower", Some(0), up)])?;
/// let (tree, _) = skeleton_puppet(&skeleton, 4096, |part| PartUid([part as u8; 12]))?;
/// let bones: Vec<_> = propose(&tree, &skeleton).mapping.entries.into_iter().map(|entry| entry.bone).collect();
/// assert_eq!(bones, ["upper", "lower"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn propose(tree: &JointTree, skeleton: &Skeleton) -> Proposal {
    propose_with(tree, skeleton, &PuppetHints::default())
}

/// [`propose`] for a puppet of which more is known than its tree: what it is, its parts' names, where they point.
pub fn propose_with(tree: &JointTree, skeleton: &Skeleton, hints: &PuppetHints) -> Proposal {
    let plan = puppet_plan(tree, hints);
    let (joints, part_of_joint) = (&plan.joints, &plan.part_of_joint);
    let order = ChildOrder::new(skeleton);
    let mut traits = body_plan(skeleton);
    let recognition = recognise_by(skeleton, &traits);
    for (bone, recognised) in traits.iter_mut().zip(&recognition.bones) {
        if let Some(recognised) = recognised {
            bone.meaning = bone.meaning.with_place(recognised.bone.part);
        }
    }
    let bones = bone_shapes(skeleton, &order, &traits);
    let cells = (joints.nodes.len() + 1).saturating_mul(bones.nodes.len() + 1);
    if cells > MAX_CELLS || Alignment::work(joints, &bones) > MAX_WORK {
        return too_large(tree, skeleton, part_of_joint);
    }
    let is_hand = kind_of(&plan, tree, hints) == Some(PuppetKind::Hand);
    let bone_variants = hub_variants(&bones, |siblings, parent| order.sort(siblings, parent));
    let bone_variants = if is_hand { fingers_as_held_up(bone_variants, &traits) } else { bone_variants };
    let joint_variants = chain_variants(joints);
    let same = same_shape(joints, &bones);
    let extra = prices(tree, &plan, &traits, hints, same);
    let (joint_variants, bone_variants) = (&joint_variants, &bone_variants);
    let mut alignment = Alignment::new(Input { joints, bones: &bones, joint_variants, bone_variants, extra: &extra });
    let best = alignment.cost();
    let importance: Vec<f64> = bones.nodes.iter().map(|bone| bone.importance).collect();
    let judge = Judge {
        joints,
        bone_parents: &bones.parent,
        traits: &traits,
        pairs: &plan.pairs,
        extra: &extra,
        importance: &importance,
        unused: SKIP_JOINT,
    };
    let aligned = alignment.bones_of_joints();
    let bone_of_joint = if same { aligned.clone() } else { judge.symmetric(aligned.clone()) };
    let mut proposal = Proposal { ambiguities: equal_branches(tree, joints, part_of_joint), ..Proposal::default() };
    proposal.ambiguities.extend(doubts(tree, &plan, &bone_of_joint, hints));
    for (joint, &part) in part_of_joint.iter().enumerate() {
        let uid = tree.parts()[part].uid;
        let Some(bone) = bone_of_joint[joint] else {
            proposal.unmapped_parts.push(uid);
            continue;
        };
        // Where one side does as the other, it is as sure as that one.
        let surer = if aligned[joint] == Some(bone) { joint } else { twin_of(&plan, joint).unwrap_or(joint) };
        let (cost, elsewhere) = match aligned[surer] {
            Some(own) => alignment.without(surer, own),
            None => (best, None),
        };
        let margin = (cost - best).max(0.0);
        let name = &skeleton.bones()[bone].name;
        proposal.mapping.entries.push(MappingEntry::new(uid, name.clone()));
        proposal.confidence.push((1.0 - libm::exp(-margin / CONFIDENT_MARGIN)) as f32);
        if margin < AMBIGUOUS_MARGIN && surer == joint {
            let other = elsewhere.map_or("no bone at all".into(), |b| format!("{:?}", skeleton.bones()[b].name));
            proposal.ambiguities.push(format!("part {part} ({uid}) drives {name:?}; {other} would fit nearly as well"));
        }
    }
    proposal.mapping.shared = proposed_shares(skeleton, &recognition, &traits, &proposal.mapping.entries);
    let driven = proposal.mapping.driven_bones(skeleton);
    let undriven = skeleton.bones().iter().zip(driven).filter(|(_, driven)| !driven);
    proposal.unmapped_bones = undriven.map(|(bone, _)| bone.name.clone()).collect();
    proposal
}

/// Whether every joint has its bone and every bone its joint, branch for branch: a puppet that was made after the skeleton.
fn same_shape(joints: &Tree<JointShape>, bones: &Tree<BoneShape>) -> bool {
    let mut beside = vec![(joints.root(), bones.root())];
    while let Some((joint, bone)) = beside.pop() {
        let (own, other) = (&joints.children[joint], &bones.children[bone]);
        if own.len() != other.len() {
            return false;
        }
        beside.extend(own.iter().copied().zip(other.iter().copied()));
    }
    true
}

/// A hand by itself has its palm to the front and its fingers up: a left one has its little finger on the character's
/// left. The hands of a figure have their palms down, and their fingers are counted from the front.
fn fingers_as_held_up(mut variants: Vec<Vec<Variant>>, traits: &[BoneTraits]) -> Vec<Vec<Variant>> {
    for (list, _) in variants.iter_mut().flatten() {
        let left = list.iter().all(|&bone| traits[bone].finger && traits[bone].side == Some(Side::Left));
        if left && list.len() > 1 {
            list.reverse();
        }
    }
    variants
}

fn twin_of(plan: &PuppetPlan, joint: usize) -> Option<usize> {
    plan.pairs.iter().find_map(|(first, second)| {
        let both = first.iter().zip(second);
        both.into_iter().find_map(|(&a, &b)| match joint {
            joint if joint == a => Some(b),
            joint if joint == b => Some(a),
            _ => None,
        })
    })
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
