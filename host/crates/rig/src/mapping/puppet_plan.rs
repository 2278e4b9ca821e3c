//! What a puppet is by its shape: its joints without the splitters between them, and which of its branches are made
//! alike, as the two sides of a body are.

use std::collections::BTreeMap;

use super::alignment::{JointShape, Tree};
use super::hints::PuppetHints;
use crate::puppet::{JointAxis, JointTree};

/// The joints of a puppet.
#[derive(Clone, Debug)]
pub(super) struct PuppetPlan {
    /// The tree of parts that have sensors; splitters are skipped.
    pub(super) joints: Tree<JointShape>,
    /// The part of every joint.
    pub(super) part_of_joint: Vec<usize>,
    /// Whether another branch beside the joint's own has the same shape, as on the other side of a body.
    pub(super) has_twin: Vec<bool>,
    /// Whether no branch beside the joint's own has the same shape. The middle one of an odd number has no twin and is not
    /// lone either; nor is any joint of a puppet that branches without twins.
    pub(super) is_lone: Vec<bool>,
    /// Branches of the same shape that face each other, joint by joint; the one on the left first.
    pub(super) pairs: Vec<(Vec<usize>, Vec<usize>)>,
    /// Five equal chains after this many joints in a row: a hand, with the arm before it.
    pub(super) hand_after: Option<usize>,
}

/// Which branches of the same shape face each other: those as far on either side, where that is known. Else the
/// first and the last of two or of an odd number, and so on inwards; of four, two front legs cannot be distinguished
/// from two left ones.
fn couples(twins: &[usize], x: impl Fn(usize) -> Option<f32>) -> Vec<(usize, usize)> {
    let known: Vec<(usize, f32)> = twins.iter().filter_map(|&part| Some((part, x(part)?))).collect();
    if known.len() == twins.len() {
        let mut left: Vec<(usize, f32)> = known.iter().copied().filter(|(_, x)| *x > 0.0).collect();
        let mut right: Vec<(usize, f32)> = known.iter().copied().filter(|(_, x)| *x < 0.0).collect();
        left.sort_by(|a, b| b.1.total_cmp(&a.1));
        right.sort_by(|a, b| a.1.total_cmp(&b.1));
        return left.into_iter().zip(right).map(|((left, _), (right, _))| (left, right)).collect();
    }
    let count = twins.len();
    if count != 2 && count.is_multiple_of(2) {
        return Vec::new();
    }
    (0..count / 2).map(|at| (twins[at], twins[count - 1 - at])).collect()
}

/// How far on the character's left a branch lies, where that is known: the mean of its joints.
fn x_of(tree: &JointTree, part: usize, hints: &PuppetHints) -> Option<f32> {
    let is_below = |other: usize| std::iter::successors(Some(other), |&p| tree.parts()[p].parent).any(|p| p == part);
    let below = (part..tree.parts().len()).filter(|&other| is_below(other));
    let ends: Vec<f32> = below
        .filter_map(|other| hints.segments.get(&tree.parts()[other].uid))
        .map(|(head, tip)| 0.5 * (head.x + tip.x))
        .collect();
    (!ends.is_empty()).then(|| ends.iter().sum::<f32>() / ends.len() as f32)
}

/// What the joints of a tree of parts are.
pub(super) fn puppet_plan(tree: &JointTree, hints: &PuppetHints) -> PuppetPlan {
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
    let likeness = Likeness::of(tree);
    let mut has_twin = vec![false; count];
    let mut is_lone = vec![true; count];
    let mut pairs = Vec::new();
    for siblings in likeness.families(tree) {
        for twins in siblings.into_values().filter(|twins| twins.len() > 1) {
            let joints_of = |part: usize| -> Vec<usize> {
                likeness.below(part).into_iter().filter_map(|part| joint_of_part[part]).collect()
            };
            twins.iter().flat_map(|&part| joints_of(part)).for_each(|joint| is_lone[joint] = false);
            // The middle one of an odd number is its own mirror image.
            let middle = (twins.len() % 2 == 1).then_some(twins.len() / 2);
            let sides = twins.iter().enumerate().filter(|(place, _)| Some(*place) != middle);
            sides.flat_map(|(_, &part)| joints_of(part)).for_each(|joint| has_twin[joint] = true);
            for (first, second) in couples(&twins, |part| x_of(tree, part, hints)) {
                pairs.push((joints_of(first), joints_of(second)));
            }
        }
    }
    // Branches that are all different say nothing of sides.
    if !has_twin.contains(&true) && joints.children.iter().any(|children| children.len() > 1) {
        is_lone.fill(false);
    }
    pairs.retain(|(first, second)| !first.is_empty() && first.len() == second.len());
    let hand_after = hand_after(&joints);
    PuppetPlan { joints, part_of_joint, has_twin, is_lone, pairs, hand_after }
}

fn hand_after(joints: &Tree<JointShape>) -> Option<usize> {
    let mut before = 0;
    let mut at = joints.nodes.len();
    while let [only] = joints.children[at][..] {
        (before, at) = (before + 1, only);
    }
    let chain = |finger: usize| -> Option<Vec<JointShape>> {
        let mut shapes = Vec::new();
        let mut next = Some(finger);
        while let Some(joint) = next {
            shapes.push(JointShape { straight: false, ..joints.nodes[joint] });
            next = match joints.children[joint][..] {
                [] => None,
                [only] => Some(only),
                _ => return None,
            };
        }
        Some(shapes)
    };
    let fingers = &joints.children[at];
    let first = fingers.first().and_then(|&finger| chain(finger))?;
    let alike =
        fingers.len() == 5 && before > 0 && fingers.iter().all(|&finger| chain(finger).as_ref() == Some(&first));
    (alike && first.len() <= 4).then_some(before)
}

/// Numbers for the shapes of parts with all below them, equal for equal shapes.
struct Likeness {
    shape: Vec<usize>,
    children: Vec<Vec<usize>>,
}

impl Likeness {
    fn of(tree: &JointTree) -> Self {
        let parts = tree.parts();
        let mut children = vec![Vec::new(); parts.len()];
        for (index, part) in parts.iter().enumerate() {
            if let Some(parent) = part.parent {
                children[parent].push(index);
            }
        }
        for own in &mut children {
            own.sort_by_key(|&child| parts[child].outlet);
        }
        let mut numbers: BTreeMap<(Vec<JointAxis>, Vec<usize>), usize> = BTreeMap::new();
        let mut shape = vec![0; parts.len()];
        for index in (0..parts.len()).rev() {
            let mut below: Vec<usize> = children[index].iter().map(|&child| shape[child]).collect();
            below.sort_unstable();
            let next = numbers.len();
            shape[index] = *numbers.entry((parts[index].kind.axes().to_vec(), below)).or_insert(next);
        }
        Self { shape, children }
    }

    /// For every part that carries several: those by their shapes, in the order of their outlets. Branches that have
    /// a twin are not looked into: both sides of what they carry are on one side of the body.
    fn families(&self, tree: &JointTree) -> Vec<BTreeMap<usize, Vec<usize>>> {
        let mut families = Vec::new();
        let roots: Vec<usize> = (0..self.shape.len()).filter(|&part| tree.parts()[part].parent.is_none()).collect();
        let mut todo = vec![roots];
        while let Some(siblings) = todo.pop() {
            let mut family: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
            for &part in &siblings {
                family.entry(self.shape[part]).or_default().push(part);
            }
            let alone = family.values().filter(|twins| twins.len() == 1).map(|twins| twins[0]);
            todo.extend(alone.map(|part| self.children[part].clone()));
            families.push(family);
        }
        families
    }

    /// The part and all below it, in the order of their outlets.
    fn below(&self, part: usize) -> Vec<usize> {
        let mut found = Vec::new();
        let mut todo = vec![part];
        while let Some(part) = todo.pop() {
            found.push(part);
            todo.extend(self.children[part].iter().rev());
        }
        found
    }
}
