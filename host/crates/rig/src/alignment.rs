//! The cheapest way to lay the puppet's tree of joints over the skeleton's tree of bones.
//!
//! A constrained edit distance between two rooted trees (Zhang 1996), by dynamic programming from the leaves:
//! joints and bones may be left out, several joints in a row may share a bone, siblings are assigned to siblings
//! by the Hungarian method, and who comes below whom is kept. A bone without length (a hub) is transparent: its
//! children may be counted as its parent's.

use crate::assignment::assign;

/// Leaving a joint unused while something below or beside it is used.
const SKIP_JOINT: f64 = 3.0;
/// A joint that shares the bone of the joint before it; less where the two are one-axis parts of different
/// axes, nothing where a twist follows a bend, which is how an elbow with its forearm is built.
const SHARE_BONE: f64 = 1.0;
const SHARE_BONE_OTHER_AXIS: f64 = 0.5;
/// A twist that follows a bend and yet has a bone of its own.
const SEPARATE_TWIST: f64 = 0.5;
/// A joint that branches on a bone that does not.
const BRANCH_ON_CHAIN: f64 = 0.4;
/// A joint on a bone without length; the second is for one at an end.
const HUB: f64 = 0.1;
const END_MARKER: f64 = 0.5;
/// Sibling joints on sibling bones out of order, for a difference of one place.
const OUT_OF_ORDER: f64 = 0.1;
/// In place of a match that is ruled out; large, but finite for the assignment.
const RULED_OUT: f64 = 1e6;
/// Sibling hubs beyond this number are opened all together or not at all.
const HUBS_OPENED_ONE_BY_ONE: usize = 3;

/// What the alignment has to know of a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct JointShape {
    pub(crate) bends: bool,
    pub(crate) one_axis: bool,
    /// Whether it is plugged straight into the joint before it, without a splitter.
    pub(crate) straight: bool,
}

/// What the alignment has to know of a bone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BoneShape {
    /// Price of leaving the bone without a joint; 0 for a hub.
    pub(crate) importance: f64,
    pub(crate) hub: bool,
}

/// A rooted tree; node `len()` is a root above all roots. Children have larger numbers than their parents
/// (that root excepted), in the order of [`ChildOrder`](crate::ChildOrder).
#[derive(Clone, Debug)]
pub(crate) struct Tree<T> {
    pub(crate) nodes: Vec<T>,
    pub(crate) parent: Vec<Option<usize>>,
    /// One longer than `nodes`; the last lists the roots.
    pub(crate) children: Vec<Vec<usize>>,
}

impl<T> Tree<T> {
    fn root(&self) -> usize {
        self.nodes.len()
    }

    fn bottom_up(&self) -> impl Iterator<Item = usize> {
        (0..self.nodes.len()).rev().chain([self.root()])
    }

    /// The node and all above it, lowest first, ending with the root above all.
    fn upwards(&self, node: usize) -> Vec<usize> {
        let mut path: Vec<usize> = std::iter::successors(Some(node), |&n| self.parent[n]).collect();
        path.push(self.root());
        path
    }

    fn subtree_sums(&self, value: impl Fn(&T) -> f64) -> Vec<f64> {
        let mut sums: Vec<f64> = self.nodes.iter().map(value).collect();
        for node in (0..sums.len()).rev() {
            if let Some(parent) = self.parent[node] {
                sums[parent] += sums[node];
            }
        }
        sums
    }
}

/// Cheapest costs of laying one joint's subtree over one bone's.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// The joint and all below somewhere in the bone's subtree.
    node: f64,
    /// All below the joint somewhere below the bone.
    forest: f64,
    /// The same, or the joint's only child shares the bone.
    inside: f64,
}

enum NodeChoice {
    Match,
    PassBone(usize),
    PassJoint(usize),
}

enum ForestChoice {
    Pairs(Vec<(usize, usize)>),
    OpenBone(usize),
    OpenJoint(usize),
}

/// The two trees and the table of costs.
pub(crate) struct Alignment<'a> {
    joints: &'a Tree<JointShape>,
    bones: &'a Tree<BoneShape>,
    /// For every bone (and the root above all) its lists of children, hubs closed or opened.
    variants: &'a [Vec<Vec<usize>>],
    joint_drop: Vec<f64>,
    bone_drop: Vec<f64>,
    cells: Vec<Cell>,
    ruled_out: Option<(usize, usize)>,
}

/// The children of every bone with any of the hubs among them replaced by their own children.
pub(crate) fn hub_variants(
    bones: &Tree<BoneShape>,
    sort: impl Fn(&mut [usize], Option<usize>),
) -> Vec<Vec<Vec<usize>>> {
    let expand = |children: &[usize], opened: &dyn Fn(usize) -> bool| -> Vec<usize> {
        let mut list = Vec::new();
        let mut todo: Vec<usize> = children.iter().rev().copied().collect();
        while let Some(child) = todo.pop() {
            let transparent = bones.nodes[child].hub && !bones.children[child].is_empty() && opened(child);
            if transparent { todo.extend(bones.children[child].iter().rev()) } else { list.push(child) }
        }
        list
    };
    let of_bone = |bone: usize| {
        let children = &bones.children[bone];
        let is_hub = |child: usize| bones.nodes[child].hub && !bones.children[child].is_empty();
        let hubs: Vec<usize> = children.iter().copied().filter(|&child| is_hub(child)).collect();
        let mut lists = vec![children.clone()];
        let subsets = if hubs.len() <= HUBS_OPENED_ONE_BY_ONE { 1_usize << hubs.len() } else { 2 };
        for subset in 1..subsets {
            // A hub below an opened hub is opened with it.
            let closed = |child: usize| {
                hubs.iter().position(|&h| h == child).is_some_and(|i| hubs.len() <= 3 && subset & (1 << i) == 0)
            };
            let mut list = expand(children, &|child| !closed(child));
            sort(&mut list, (bone < bones.nodes.len()).then_some(bone));
            lists.push(list);
        }
        lists
    };
    (0..=bones.nodes.len()).map(of_bone).collect()
}

impl<'a> Alignment<'a> {
    /// A bound on the number of steps that [`new`](Self::new) takes.
    pub(crate) fn work(joints: &Tree<JointShape>, bones: &Tree<BoneShape>) -> f64 {
        let many = |children: &[Vec<usize>]| children.iter().map(|c| (c.len() as f64).powi(2)).sum::<f64>();
        let cells = joints.children.len() as f64 * bones.children.len() as f64;
        let widest = bones.children.iter().map(Vec::len).max().unwrap_or(0) as f64;
        cells + many(&joints.children) * (bones.children.len() as f64 + widest) * 8.0
    }

    /// Fills the table.
    pub(crate) fn new(
        joints: &'a Tree<JointShape>,
        bones: &'a Tree<BoneShape>,
        variants: &'a [Vec<Vec<usize>>],
    ) -> Self {
        let mut alignment = Self {
            joints,
            bones,
            variants,
            joint_drop: joints.subtree_sums(|_| SKIP_JOINT),
            bone_drop: bones.subtree_sums(|bone| bone.importance),
            cells: vec![Cell::default(); (joints.nodes.len() + 1) * (bones.nodes.len() + 1)],
            ruled_out: None,
        };
        for joint in joints.bottom_up() {
            for bone in bones.bottom_up() {
                alignment.fill(joint, bone);
            }
        }
        alignment
    }

    /// Cost of the best alignment.
    pub(crate) fn cost(&self) -> f64 {
        self.at(self.joints.root(), self.bones.root()).forest
    }

    /// For every joint its bone in the best alignment.
    pub(crate) fn bones_of_joints(&self) -> Vec<Option<usize>> {
        let mut found = vec![None; self.joints.nodes.len()];
        let mut forests = vec![(self.joints.root(), self.bones.root())];
        let mut nodes: Vec<(usize, usize)> = Vec::new();
        loop {
            if let Some((joint, bone)) = nodes.pop() {
                match self.choose_node(joint, bone).1 {
                    NodeChoice::Match => forests.push(self.share(joint, bone, &mut found)),
                    NodeChoice::PassBone(child) => nodes.push((joint, child)),
                    NodeChoice::PassJoint(child) => nodes.push((child, bone)),
                }
            } else if let Some((joint, bone)) = forests.pop() {
                match self.choose_forest(joint, bone).1 {
                    ForestChoice::Pairs(pairs) => nodes.extend(pairs),
                    ForestChoice::OpenBone(child) => forests.push((joint, child)),
                    ForestChoice::OpenJoint(child) => forests.push((child, bone)),
                }
            } else {
                return found;
            }
        }
    }

    /// Notes the joint and those after it that share the bone; returns where to go on.
    fn share(&self, joint: usize, bone: usize, found: &mut [Option<usize>]) -> (usize, usize) {
        let mut joint = joint;
        loop {
            found[joint] = Some(bone);
            match self.shared_inside(joint, bone) {
                Some((cost, child)) if cost < self.at(joint, bone).forest => joint = child,
                _ => return (joint, bone),
            }
        }
    }

    /// The best alignment in which this joint does not drive this bone: its cost and the joint's bone then.
    pub(crate) fn without(&mut self, joint: usize, bone: usize) -> (f64, Option<usize>) {
        let joint_path = self.joints.upwards(joint);
        let bone_path = self.bones.upwards(bone);
        let cells = || joint_path.iter().flat_map(|&j| bone_path.iter().map(move |&b| (j, b)));
        let before: Vec<Cell> = cells().map(|(j, b)| self.at(j, b)).collect();
        self.ruled_out = Some((joint, bone));
        for (j, b) in cells() {
            self.fill(j, b);
        }
        let cost = self.cost();
        let elsewhere = self.bones_of_joints()[joint];
        self.ruled_out = None;
        for ((j, b), cell) in cells().zip(before) {
            let index = self.index(j, b);
            self.cells[index] = cell;
        }
        (cost, elsewhere)
    }

    fn index(&self, joint: usize, bone: usize) -> usize {
        joint * (self.bones.nodes.len() + 1) + bone
    }

    fn at(&self, joint: usize, bone: usize) -> Cell {
        self.cells[self.index(joint, bone)]
    }

    fn fill(&mut self, joint: usize, bone: usize) {
        let index = self.index(joint, bone);
        let forest = self.choose_forest(joint, bone).0;
        self.cells[index].forest = forest;
        if joint == self.joints.root() || bone == self.bones.root() {
            return;
        }
        let shared = self.shared_inside(joint, bone).map_or(f64::INFINITY, |(cost, _)| cost);
        self.cells[index].inside = forest.min(shared);
        self.cells[index].node = self.choose_node(joint, bone).0;
    }

    fn choose_node(&self, joint: usize, bone: usize) -> (f64, NodeChoice) {
        let mut best = (self.match_cost(joint, bone) + self.at(joint, bone).inside, NodeChoice::Match);
        let children = &self.bones.children[bone];
        let all: f64 = children.iter().map(|&c| self.bone_drop[c]).sum();
        for &child in children {
            let cost = self.bones.nodes[bone].importance + all - self.bone_drop[child] + self.at(joint, child).node;
            if cost < best.0 {
                best = (cost, NodeChoice::PassBone(child));
            }
        }
        let children = &self.joints.children[joint];
        let all: f64 = children.iter().map(|&c| self.joint_drop[c]).sum();
        for &child in children {
            let cost = SKIP_JOINT + all - self.joint_drop[child] + self.at(child, bone).node;
            if cost < best.0 {
                best = (cost, NodeChoice::PassJoint(child));
            }
        }
        best
    }

    fn choose_forest(&self, joint: usize, bone: usize) -> (f64, ForestChoice) {
        let mut best = (f64::INFINITY, ForestChoice::Pairs(Vec::new()));
        for list in &self.variants[bone] {
            let (cost, pairs) = self.assign_siblings(&self.joints.children[joint], list);
            if cost < best.0 {
                best = (cost, ForestChoice::Pairs(pairs));
            }
        }
        if self.joints.children[joint].is_empty() {
            return best;
        }
        let children = &self.bones.children[bone];
        let all: f64 = children.iter().map(|&c| self.bone_drop[c]).sum();
        for &child in children {
            let opened = self.bones.nodes[child].importance + self.at(joint, child).forest;
            let cost = all - self.bone_drop[child] + opened;
            if cost < best.0 {
                best = (cost, ForestChoice::OpenBone(child));
            }
        }
        let children = &self.joints.children[joint];
        let all: f64 = children.iter().map(|&c| self.joint_drop[c]).sum();
        for &child in children {
            let cost = all - self.joint_drop[child] + SKIP_JOINT + self.at(child, bone).forest;
            if cost < best.0 {
                best = (cost, ForestChoice::OpenJoint(child));
            }
        }
        best
    }

    fn assign_siblings(&self, joints: &[usize], bones: &[usize]) -> (f64, Vec<(usize, usize)>) {
        let dropped: f64 = bones.iter().map(|&b| self.bone_drop[b]).sum();
        let unused = bones.len()..bones.len() + joints.len();
        let costs: Vec<Vec<f64>> = joints
            .iter()
            .enumerate()
            .map(|(place, &joint)| {
                let expected = (place as f64 + 0.5) * bones.len() as f64 / joints.len() as f64 - 0.5;
                let used = bones.iter().enumerate().map(|(at, &bone)| {
                    self.at(joint, bone).node - self.bone_drop[bone] + out_of_order((at as f64 - expected).abs())
                });
                used.chain(unused.clone().map(|_| self.joint_drop[joint])).collect()
            })
            .collect();
        let columns = assign(&costs);
        let cost = dropped + columns.iter().enumerate().map(|(row, &column)| costs[row][column]).sum::<f64>();
        let pairs = joints.iter().zip(columns).filter(|(_, column)| *column < bones.len());
        (cost, pairs.map(|(&joint, column)| (joint, bones[column])).collect())
    }

    /// The cost of the joint's only child sharing the bone, with all below.
    fn shared_inside(&self, joint: usize, bone: usize) -> Option<(f64, usize)> {
        let &[child] = self.joints.children[joint].as_slice() else { return None };
        let (first, second) = (self.joints.nodes[joint], self.joints.nodes[child]);
        let other_axis = first.one_axis && second.one_axis && first.bends != second.bends;
        let share = match (other_axis && second.straight, second.bends) {
            (true, false) => 0.0,
            (true, true) => SHARE_BONE_OTHER_AXIS,
            (false, _) => SHARE_BONE,
        };
        let ruled_out = if self.ruled_out == Some((child, bone)) { RULED_OUT } else { 0.0 };
        Some((share + ruled_out + self.at(child, bone).inside, child))
    }

    fn match_cost(&self, joint: usize, bone: usize) -> f64 {
        let shape = self.joints.nodes[joint];
        let mut cost = if self.ruled_out == Some((joint, bone)) { RULED_OUT } else { 0.0 };
        let ends = self.bones.children[bone].is_empty();
        if self.bones.nodes[bone].hub {
            cost += if ends { END_MARKER } else { HUB };
        }
        if self.joints.children[joint].len() > 1 && self.bones.children[bone].len() < 2 {
            cost += BRANCH_ON_CHAIN;
        }
        let before = self.joints.parent[joint].map(|parent| self.joints.nodes[parent]);
        let follows_bend = before.is_some_and(|parent| parent.one_axis && parent.bends);
        if follows_bend && shape.straight && shape.one_axis && !shape.bends {
            cost += SEPARATE_TWIST;
        }
        cost
    }
}

/// Convex, so that keeping the order is cheapest; grows only linearly, so that shape outweighs a puppet that was
/// plugged together in another order.
fn out_of_order(places: f64) -> f64 {
    OUT_OF_ORDER * if places <= 1.0 { places * places } else { 2.0 * places - 1.0 }
}
