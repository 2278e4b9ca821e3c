//! The cheapest way to align the puppet's tree of joints with the skeleton's tree of bones.
//!
//! A constrained edit distance between two rooted trees (Zhang 1996), by dynamic programming from the leaves: joints
//! and bones may be skipped, several joints in a row may share a bone, siblings are assigned to siblings by the
//! Hungarian method, and ancestry is preserved. A bone without length (a hub) is transparent: its children may be
//! counted as its parent's. So is, at a price, a bone of the trunk (a spider's legs are all attached to one joint, a
//! human's limbs along a spine) and a chain of joints between two branches.

use super::assignment::assign;

/// Leaving a joint unused while something below or beside it is used.
pub(super) const SKIP_JOINT: f64 = 3.0;
/// A joint that shares the bone of the joint before it; less if the two are one-axis parts with different axes, nothing
/// if a twist follows a bend, which is how an elbow with its forearm is built.
const SHARE_BONE: f64 = 1.0;
const SHARE_BONE_OTHER_AXIS: f64 = 0.5;
/// A third joint on a bone costs this besides; there is no fourth.
const SHARE_AS_THIRD: f64 = 0.75;
const MOST_SHARED: usize = 3;
/// A joint of a chain that is passed over so that what it carries counts as its parent's.
const OPEN_CHAIN: f64 = 1.5;
/// A twist that follows a bend but has its own bone.
const SEPARATE_TWIST: f64 = 0.5;
/// A joint that branches on a bone that does not.
const BRANCH_ON_CHAIN: f64 = 0.4;
/// A joint on a bone without length; the second value is for one at an end.
const HUB: f64 = 0.1;
const END_MARKER: f64 = 0.5;
/// Sibling joints on sibling bones out of order, per place of difference.
const OUT_OF_ORDER: f64 = 0.1;
/// The cost of a match that is ruled out; large, but finite for the assignment.
const RULED_OUT: f64 = 1e6;
/// Sibling hubs beyond this number are opened all together or not at all.
const HUBS_OPENED_ONE_BY_ONE: usize = 3;

/// What the alignment needs to know about a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct JointShape {
    pub(super) bends: bool,
    pub(super) one_axis: bool,
    /// Whether it is plugged directly into the joint before it, without a splitter.
    pub(super) straight: bool,
}

/// What the alignment needs to know about a bone.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoneShape {
    /// Cost of leaving the bone without a joint; 0 for a hub.
    pub(super) importance: f64,
    pub(super) hub: bool,
    /// Whether it carries limbs of both sides.
    pub(super) trunk: bool,
}

/// A rooted tree; node `len()` is a root above all roots. Children have larger numbers than their parents
/// (that root excepted), in the order of [`ChildOrder`](crate::ChildOrder).
#[derive(Clone, Debug)]
pub(super) struct Tree<T> {
    pub(super) nodes: Vec<T>,
    pub(super) parent: Vec<Option<usize>>,
    /// One longer than `nodes`; the last lists the roots.
    pub(super) children: Vec<Vec<usize>>,
}

impl<T> Tree<T> {
    pub(super) fn root(&self) -> usize {
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

/// Lowest costs of aligning one joint's subtree with one bone's.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    /// The joint and everything below it somewhere in the bone's subtree.
    node: f64,
    /// Everything below the joint somewhere below the bone.
    forest: f64,
    /// The same, or the joint's only child shares the bone, of which this joint is the first, second or third.
    inside: [f64; MOST_SHARED],
}

/// A list of children, and the price of having passed over what is above them.
pub(super) type Variant = (Vec<usize>, f64);

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

/// What an alignment is made of.
#[derive(Clone, Copy)]
pub(super) struct Input<'a> {
    pub(super) joints: &'a Tree<JointShape>,
    pub(super) bones: &'a Tree<BoneShape>,
    /// For every joint (and the root above all) its lists of children, chains closed or opened.
    pub(super) joint_variants: &'a [Vec<Variant>],
    /// For every bone (and the root above all) its lists of children, hubs and trunk closed or opened.
    pub(super) bone_variants: &'a [Vec<Variant>],
    /// What it costs, by all else that is known, that a joint drives a bone: row by row one joint.
    pub(super) extra: &'a [f64],
}

/// The two trees and the table of costs.
pub(super) struct Alignment<'a> {
    input: Input<'a>,
    joint_drop: Vec<f64>,
    bone_drop: Vec<f64>,
    cells: Vec<Cell>,
    ruled_out: Option<(usize, usize)>,
}

/// The children of every bone with any of the hubs among them replaced by their own children.
pub(super) fn hub_variants(bones: &Tree<BoneShape>, sort: impl Fn(&mut [usize], Option<usize>)) -> Vec<Vec<Variant>> {
    let expand = |children: &[usize], opened: &dyn Fn(usize) -> bool| -> Vec<usize> {
        let mut list = Vec::new();
        let mut todo: Vec<usize> = children.iter().rev().copied().collect();
        while let Some(child) = todo.pop() {
            let transparent = !bones.children[child].is_empty() && opened(child);
            if transparent { todo.extend(bones.children[child].iter().rev()) } else { list.push(child) }
        }
        list
    };
    let of_bone = |bone: usize| {
        let children = &bones.children[bone];
        let is_hub = |child: usize| bones.nodes[child].hub && !bones.children[child].is_empty();
        let hubs: Vec<usize> = children.iter().copied().filter(|&child| is_hub(child)).collect();
        let mut lists = vec![(children.clone(), 0.0)];
        let subsets = if hubs.len() <= HUBS_OPENED_ONE_BY_ONE { 1_usize << hubs.len() } else { 2 };
        for subset in 1..subsets {
            // A hub below an opened hub is opened with it.
            let closed = |child: usize| {
                hubs.iter().position(|&h| h == child).is_some_and(|i| hubs.len() <= 3 && subset & (1 << i) == 0)
            };
            let mut list = expand(children, &|child| bones.nodes[child].hub && !closed(child));
            sort(&mut list, (bone < bones.nodes.len()).then_some(bone));
            lists.push((list, 0.0));
        }
        // Along the trunk, one bone more each time; hubs are opened on the way.
        let mut opened: Vec<usize> = Vec::new();
        loop {
            let is_open = |child: usize| bones.nodes[child].hub || opened.contains(&child);
            let list = expand(children, &is_open);
            let Some(&next) = list.iter().find(|&&child| bones.nodes[child].trunk && !bones.nodes[child].hub) else {
                break;
            };
            opened.push(next);
            let is_open = |child: usize| bones.nodes[child].hub || opened.contains(&child);
            let mut list = expand(children, &is_open);
            sort(&mut list, (bone < bones.nodes.len()).then_some(bone));
            lists.push((list, opened.iter().map(|&child| bones.nodes[child].importance).sum()));
        }
        lists
    };
    (0..=bones.nodes.len()).map(of_bone).collect()
}

/// The children of every joint, also with one of the chains that lead to another branching passed over.
pub(super) fn chain_variants(joints: &Tree<JointShape>) -> Vec<Vec<Variant>> {
    let of_joint = |joint: usize| {
        let children = &joints.children[joint];
        let mut lists = vec![(children.clone(), 0.0)];
        if children.len() < 2 {
            return lists;
        }
        for (place, &child) in children.iter().enumerate() {
            let mut chain = vec![child];
            while let [only] = joints.children[chain[chain.len() - 1]][..] {
                chain.push(only);
            }
            let carried = &joints.children[chain[chain.len() - 1]];
            if carried.len() > 1 {
                let list = [&children[..place], carried, &children[place + 1..]].concat();
                lists.push((list, OPEN_CHAIN * chain.len() as f64));
            }
        }
        lists
    };
    (0..=joints.nodes.len()).map(of_joint).collect()
}

impl<'a> Alignment<'a> {
    /// An upper bound on the number of steps that [`new`](Self::new) takes.
    pub(super) fn work(joints: &Tree<JointShape>, bones: &Tree<BoneShape>) -> f64 {
        let many = |children: &[Vec<usize>]| children.iter().map(|c| (c.len() as f64).powi(2)).sum::<f64>();
        let cells = joints.children.len() as f64 * bones.children.len() as f64;
        let widest = bones.children.iter().map(Vec::len).max().unwrap_or(0) as f64;
        cells + many(&joints.children) * (bones.children.len() as f64 + widest) * 8.0
    }

    /// Fills the table.
    pub(super) fn new(input: Input<'a>) -> Self {
        let Input { joints, bones, .. } = input;
        let mut alignment = Self {
            input,
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
    pub(super) fn cost(&self) -> f64 {
        self.at(self.input.joints.root(), self.input.bones.root()).forest
    }

    /// For every joint, its bone in the best alignment.
    pub(super) fn bones_of_joints(&self) -> Vec<Option<usize>> {
        let mut found = vec![None; self.input.joints.nodes.len()];
        let mut forests = vec![(self.input.joints.root(), self.input.bones.root())];
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

    /// Records the joint and those after it that share the bone; returns where to continue.
    fn share(&self, joint: usize, bone: usize, found: &mut [Option<usize>]) -> (usize, usize) {
        let mut joint = joint;
        for place in 0.. {
            found[joint] = Some(bone);
            match self.shared_inside(joint, bone, place) {
                Some((cost, child)) if cost < self.at(joint, bone).forest => joint = child,
                _ => break,
            }
        }
        (joint, bone)
    }

    /// The best alignment in which this joint does not drive this bone: its cost and the joint's bone in it.
    pub(super) fn without(&mut self, joint: usize, bone: usize) -> (f64, Option<usize>) {
        let joint_path = self.input.joints.upwards(joint);
        let bone_path = self.input.bones.upwards(bone);
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
        joint * (self.input.bones.nodes.len() + 1) + bone
    }

    fn at(&self, joint: usize, bone: usize) -> Cell {
        self.cells[self.index(joint, bone)]
    }

    fn fill(&mut self, joint: usize, bone: usize) {
        let index = self.index(joint, bone);
        let forest = self.choose_forest(joint, bone).0;
        self.cells[index].forest = forest;
        if joint == self.input.joints.root() || bone == self.input.bones.root() {
            return;
        }
        for place in 0..MOST_SHARED {
            let shared = self.shared_inside(joint, bone, place).map_or(f64::INFINITY, |(cost, _)| cost);
            self.cells[index].inside[place] = forest.min(shared);
        }
        self.cells[index].node = self.choose_node(joint, bone).0;
    }

    fn choose_node(&self, joint: usize, bone: usize) -> (f64, NodeChoice) {
        let mut best = (self.match_cost(joint, bone) + self.at(joint, bone).inside[0], NodeChoice::Match);
        let children = &self.input.bones.children[bone];
        let all: f64 = children.iter().map(|&c| self.bone_drop[c]).sum();
        for &child in children {
            let cost =
                self.input.bones.nodes[bone].importance + all - self.bone_drop[child] + self.at(joint, child).node;
            if cost < best.0 {
                best = (cost, NodeChoice::PassBone(child));
            }
        }
        let children = &self.input.joints.children[joint];
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
        for (joints, skipped) in &self.input.joint_variants[joint] {
            for (bones, passed) in &self.input.bone_variants[bone] {
                let (cost, pairs) = self.assign_siblings(joints, bones);
                if cost + skipped + passed < best.0 {
                    best = (cost + skipped + passed, ForestChoice::Pairs(pairs));
                }
            }
        }
        if self.input.joints.children[joint].is_empty() {
            return best;
        }
        let children = &self.input.bones.children[bone];
        let all: f64 = children.iter().map(|&c| self.bone_drop[c]).sum();
        for &child in children {
            let opened = self.input.bones.nodes[child].importance + self.at(joint, child).forest;
            let cost = all - self.bone_drop[child] + opened;
            if cost < best.0 {
                best = (cost, ForestChoice::OpenBone(child));
            }
        }
        let children = &self.input.joints.children[joint];
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

    /// The cost if the joint's only child shares the bone, including everything below.
    /// `place`: how many joints are on the bone before this one.
    fn shared_inside(&self, joint: usize, bone: usize, place: usize) -> Option<(f64, usize)> {
        if place + 1 >= MOST_SHARED {
            return None;
        }
        let &[child] = self.input.joints.children[joint].as_slice() else { return None };
        let (first, second) = (self.input.joints.nodes[joint], self.input.joints.nodes[child]);
        let other_axis = first.one_axis && second.one_axis && first.bends != second.bends;
        let share = match (other_axis && second.straight, second.bends) {
            (true, false) => 0.0,
            (true, true) => SHARE_BONE_OTHER_AXIS,
            (false, _) => SHARE_BONE,
        };
        let ruled_out = if self.ruled_out == Some((child, bone)) { RULED_OUT } else { 0.0 };
        let third = if place > 0 { SHARE_AS_THIRD } else { 0.0 };
        Some((share + third + ruled_out + self.extra(child, bone) + self.at(child, bone).inside[place + 1], child))
    }

    fn extra(&self, joint: usize, bone: usize) -> f64 {
        self.input.extra[joint * self.input.bones.nodes.len() + bone]
    }

    fn match_cost(&self, joint: usize, bone: usize) -> f64 {
        let shape = self.input.joints.nodes[joint];
        let mut cost = if self.ruled_out == Some((joint, bone)) { RULED_OUT } else { 0.0 };
        cost += self.extra(joint, bone);
        let ends = self.input.bones.children[bone].is_empty();
        if self.input.bones.nodes[bone].hub {
            cost += if ends { END_MARKER } else { HUB };
        }
        if self.input.joints.children[joint].len() > 1 && self.input.bones.children[bone].len() < 2 {
            cost += BRANCH_ON_CHAIN;
        }
        let before = self.input.joints.parent[joint].map(|parent| self.input.joints.nodes[parent]);
        let follows_bend = before.is_some_and(|parent| parent.one_axis && parent.bends);
        if follows_bend && shape.straight && shape.one_axis && !shape.bends {
            cost += SEPARATE_TWIST;
        }
        cost
    }
}

/// Convex, so that keeping the order is cheapest; only grows linearly, so that shape outweighs a puppet that was
/// plugged together in a different order.
fn out_of_order(places: f64) -> f64 {
    OUT_OF_ORDER * if places <= 1.0 { places * places } else { 2.0 * places - 1.0 }
}
