//! Maximum flow and minimum cut on graphs of elements.
//!
//! Boykov and Kolmogorov's augmenting paths (*An Experimental Comparison of Min-Cut/Max-Flow Algorithms for Energy
//! Minimization in Vision*, 2004): two trees, one from the source and one from the sink, grow until they touch, the
//! path between them is saturated, and the nodes this cuts off are adopted again. Capacities are integers, so that flow
//! and cut agree exactly, and every node has at most `K` arcs, so that the arcs need no index.

use std::collections::VecDeque;
use std::ops::ControlFlow;

/// Augmenting paths between two progress reports.
const REPORT_EVERY: u64 = 1024;
const NONE: u32 = u32::MAX;
/// Values of `parent` that are not arcs of the node.
const ORPHAN: u8 = u8::MAX;
const TERMINAL: u8 = u8::MAX - 1;

/// A graph whose nodes have slots for `K` arcs each; every arc has a twin in the other direction.
#[derive(Debug)]
pub(super) struct FlowGraph<'a, const K: usize> {
    /// n×K: the node at the other end, `u32::MAX` for no arc.
    pub heads: &'a [[u32; K]],
    /// n×K: which of the other end's arcs comes back.
    pub twins: &'a [[u8; K]],
    /// n×K, not negative: what an arc can carry.
    pub capacities: Vec<[i64; K]>,
    /// n: capacity from the source if positive, to the sink if negative.
    pub terminals: Vec<i64>,
}

/// A minimum cut, and the flow that proves it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MinimumCut {
    /// Whether a node is on the source's side: all that cannot reach the sink, so the largest of the minimum cuts.
    pub source_side: Vec<bool>,
    /// The maximum flow, counted path by path.
    pub flow: i64,
    /// The capacity of the cut, summed over its arcs. Equal to `flow`, or the cut is not minimal.
    pub cut: i64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Tree {
    Free,
    Source,
    Sink,
}

struct Search<'a, const K: usize> {
    heads: &'a [[u32; K]],
    twins: &'a [[u8; K]],
    residual: Vec<[i64; K]>,
    terminal: Vec<i64>,
    tree: Vec<Tree>,
    /// The arc of a node in a tree that leads towards its root.
    parent: Vec<u8>,
    /// Steps to the root, valid as of `time`.
    distance: Vec<u32>,
    time: Vec<u32>,
    now: u32,
    active: VecDeque<u32>,
    is_active: Vec<bool>,
    orphans: VecDeque<u32>,
    flow: i64,
}

/// The maximum flow of a graph and its minimum cut; `None` if `progress` stopped it.
///
/// The sum of all capacities must stay below 2⁶². `progress` receives the flow as a fraction of the most that the
/// terminals could carry.
pub(super) fn max_flow<const K: usize>(
    graph: &FlowGraph<K>,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Option<MinimumCut> {
    let mut search = Search::new(graph);
    let ends = |sign: i64| graph.terminals.iter().map(|&t| (sign * t).max(0)).sum::<i64>();
    let most = ends(1).min(ends(-1)).max(1);
    let mut paths = 0;
    while let Some((from, arc)) = search.grow() {
        search.augment(from, arc);
        search.adopt();
        paths += 1;
        if paths % REPORT_EVERY == 0 && progress(search.flow as f64 / most as f64).is_break() {
            return None;
        }
    }
    let source_side = search.source_side();
    let cut = cut_capacity(graph, &source_side);
    Some(MinimumCut { source_side, flow: search.flow, cut })
}

/// The capacity of all arcs from the source's side to the sink's.
fn cut_capacity<const K: usize>(graph: &FlowGraph<K>, source_side: &[bool]) -> i64 {
    let mut cut = 0;
    for (node, &inside) in source_side.iter().enumerate() {
        cut += if inside { -graph.terminals[node].min(0) } else { graph.terminals[node].max(0) };
        for k in 0..K {
            let head = graph.heads[node][k];
            if inside && head != NONE && !source_side[head as usize] {
                cut += graph.capacities[node][k];
            }
        }
    }
    cut
}

impl<'a, const K: usize> Search<'a, K> {
    fn new(graph: &FlowGraph<'a, K>) -> Self {
        let count = graph.heads.len();
        let tree = graph.terminals.iter().map(|&t| match t {
            1.. => Tree::Source,
            0 => Tree::Free,
            _ => Tree::Sink,
        });
        let roots = (0..count as u32).filter(|&node| graph.terminals[node as usize] != 0);
        Self {
            heads: graph.heads,
            twins: graph.twins,
            residual: graph.capacities.clone(),
            terminal: graph.terminals.clone(),
            tree: tree.collect(),
            parent: graph.terminals.iter().map(|&t| if t == 0 { ORPHAN } else { TERMINAL }).collect(),
            distance: vec![1; count],
            time: vec![0; count],
            now: 1,
            active: roots.collect(),
            is_active: graph.terminals.iter().map(|&t| t != 0).collect(),
            orphans: VecDeque::new(),
            flow: 0,
        }
    }

    /// The node at the other end of an arc and its arc back.
    fn across(&self, node: u32, arc: usize) -> Option<(u32, usize)> {
        let head = self.heads[node as usize][arc];
        (head != NONE).then(|| (head, self.twins[node as usize][arc] as usize))
    }

    /// What can still flow between a node of a tree and a neighbour, away from the source and towards the sink.
    fn room(&self, tree: Tree, node: u32, arc: usize, head: u32, twin: usize) -> i64 {
        if tree == Tree::Source { self.residual[node as usize][arc] } else { self.residual[head as usize][twin] }
    }

    fn activate(&mut self, node: u32) {
        if !self.is_active[node as usize] {
            self.is_active[node as usize] = true;
            self.active.push_back(node);
        }
    }

    /// Lets both trees grow until they touch: the touching arc, seen from the source's tree.
    fn grow(&mut self) -> Option<(u32, usize)> {
        while let Some(&node) = self.active.front() {
            let tree = self.tree[node as usize];
            for arc in 0..K {
                let Some((head, twin)) = self.across(node, arc) else { continue };
                if tree == Tree::Free || self.room(tree, node, arc, head, twin) == 0 {
                    continue;
                }
                let h = head as usize;
                if self.tree[h] == Tree::Free {
                    self.tree[h] = tree;
                    self.hang(head, twin, node);
                    self.activate(head);
                } else if self.tree[h] != tree {
                    // The node stays active: it may touch the other tree elsewhere.
                    return Some(if tree == Tree::Source { (node, arc) } else { (head, twin) });
                } else if self.time[h] <= self.time[node as usize] && self.distance[h] > self.distance[node as usize] {
                    self.hang(head, twin, node);
                }
            }
            self.active.pop_front();
            self.is_active[node as usize] = false;
        }
        None
    }

    fn hang(&mut self, node: u32, arc: usize, below: u32) {
        self.parent[node as usize] = arc as u8;
        self.time[node as usize] = self.time[below as usize];
        self.distance[node as usize] = self.distance[below as usize] + 1;
    }

    /// Sends as much as possible along the path from source to sink through an arc.
    fn augment(&mut self, from: u32, arc: usize) {
        let (to, twin) = (self.heads[from as usize][arc], self.twins[from as usize][arc] as usize);
        let mut amount = self.residual[from as usize][arc];
        for (tree, start) in [(Tree::Source, from), (Tree::Sink, to)] {
            let mut node = start;
            while self.parent[node as usize] != TERMINAL {
                let up = self.parent[node as usize] as usize;
                let (above, down) = (self.heads[node as usize][up], self.twins[node as usize][up] as usize);
                // The source's flow comes down to the node, the sink's goes up from it.
                amount = amount.min(self.room(tree, above, down, node, up));
                node = above;
            }
            amount = amount.min(self.terminal[node as usize].abs());
        }
        self.residual[from as usize][arc] -= amount;
        self.residual[to as usize][twin] += amount;
        for (tree, start) in [(Tree::Source, from), (Tree::Sink, to)] {
            self.send(tree, start, amount);
        }
        self.flow += amount;
    }

    /// Subtracts `amount` from the residual capacity between a node and the root of its tree.
    fn send(&mut self, tree: Tree, start: u32, amount: i64) {
        let mut node = start;
        while self.parent[node as usize] != TERMINAL {
            let up = self.parent[node as usize] as usize;
            let (above, down) = (self.heads[node as usize][up], self.twins[node as usize][up] as usize);
            let signed = if tree == Tree::Source { amount } else { -amount };
            self.residual[above as usize][down] -= signed;
            self.residual[node as usize][up] += signed;
            if self.room(tree, above, down, node, up) == 0 {
                self.parent[node as usize] = ORPHAN;
                self.orphans.push_front(node);
            }
            node = above;
        }
        self.terminal[node as usize] -= if tree == Tree::Source { amount } else { -amount };
        if self.terminal[node as usize] == 0 {
            self.parent[node as usize] = ORPHAN;
            self.orphans.push_front(node);
        }
    }

    /// Finds new parents for all orphans in their own trees, or sets them free.
    fn adopt(&mut self) {
        self.now += 1;
        while let Some(orphan) = self.orphans.pop_front() {
            let tree = self.tree[orphan as usize];
            let mut nearest: Option<(u32, usize)> = None;
            for arc in 0..K {
                let Some((head, twin)) = self.across(orphan, arc) else { continue };
                if self.tree[head as usize] != tree || self.room(tree, head, twin, orphan, arc) == 0 {
                    continue;
                }
                if let Some(distance) = self.distance_to_root(head)
                    && nearest.is_none_or(|(least, _)| distance < least)
                {
                    nearest = Some((distance, arc));
                }
            }
            let o = orphan as usize;
            if let Some((distance, arc)) = nearest {
                self.parent[o] = arc as u8;
                self.time[o] = self.now;
                self.distance[o] = distance + 1;
            } else {
                self.set_free(orphan, tree);
            }
        }
    }

    /// Steps from a node to the root of its tree, `None` if an orphan is on the way.
    fn distance_to_root(&mut self, start: u32) -> Option<u32> {
        let (mut node, mut steps) = (start as usize, 0);
        let total = loop {
            if self.time[node] == self.now {
                break steps + self.distance[node];
            }
            match self.parent[node] {
                ORPHAN => return None,
                TERMINAL => break steps + 1,
                up => {
                    steps += 1;
                    node = self.heads[node][up as usize] as usize;
                }
            }
        };
        // The distance is stored along the whole path, so that no step is walked twice.
        let (mut node, mut left) = (start as usize, total);
        while self.time[node] != self.now {
            self.time[node] = self.now;
            self.distance[node] = left;
            left -= 1;
            if self.parent[node] != TERMINAL {
                node = self.heads[node][self.parent[node] as usize] as usize;
            }
        }
        Some(total)
    }

    /// An orphan without a new parent leaves its tree: neighbours may take it, its children are orphans.
    fn set_free(&mut self, orphan: u32, tree: Tree) {
        for arc in 0..K {
            let Some((head, twin)) = self.across(orphan, arc) else { continue };
            if self.tree[head as usize] != tree {
                continue;
            }
            if self.room(tree, head, twin, orphan, arc) > 0 {
                self.activate(head);
            }
            if self.parent[head as usize] as usize == twin {
                self.parent[head as usize] = ORPHAN;
                self.orphans.push_back(head);
            }
        }
        self.tree[orphan as usize] = Tree::Free;
        self.parent[orphan as usize] = ORPHAN;
    }

    /// All nodes from which the sink cannot be reached any more.
    fn source_side(&self) -> Vec<bool> {
        let mut side: Vec<bool> = self.terminal.iter().map(|&t| t >= 0).collect();
        let mut queue: Vec<u32> = (0..side.len() as u32).filter(|&node| !side[node as usize]).collect();
        while let Some(node) = queue.pop() {
            for arc in 0..K {
                if let Some((head, twin)) = self.across(node, arc)
                    && side[head as usize]
                    && self.residual[head as usize][twin] > 0
                {
                    side[head as usize] = false;
                    queue.push(head);
                }
            }
        }
        side
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type Arcs = (Vec<[u32; 4]>, Vec<[u8; 4]>, Vec<[i64; 4]>);

    /// Nodes with random arcs between free places, and what they can carry.
    fn random_graph(count: usize, arcs: &[(usize, usize, i64, i64)]) -> Arcs {
        let (mut heads, mut twins) = (vec![[NONE; 4]; count], vec![[0; 4]; count]);
        let mut capacities = vec![[0; 4]; count];
        for &(a, b, forth, back) in arcs {
            let (a, b) = (a % count, b % count);
            let place = |heads: &[[u32; 4]], node: usize| heads[node].iter().position(|&h| h == NONE);
            let (Some(k), Some(l)) = (place(&heads, a), place(&heads, b)) else { continue };
            if a == b {
                continue;
            }
            (heads[a][k], twins[a][k], capacities[a][k]) = (b as u32, l as u8, forth);
            (heads[b][l], twins[b][l], capacities[b][l]) = (a as u32, k as u8, back);
        }
        (heads, twins, capacities)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1500))]
        #[test]
        fn finds_the_cut_that_trying_all_finds(
            count in 1_usize..11,
            arcs in prop::collection::vec((0_usize..11, 0_usize..11, 0_i64..20, 0_i64..20), 0..24),
            terminals in prop::collection::vec(-30_i64..30, 11),
        ) {
            let (heads, twins, capacities) = random_graph(count, &arcs);
            let terminals = terminals[..count].to_vec();
            let graph = FlowGraph { heads: &heads, twins: &twins, capacities, terminals };
            let found = max_flow(&graph, &mut |_| ControlFlow::Continue(())).unwrap();
            prop_assert_eq!(found.flow, found.cut);
            let sides = |bits: u32| (0..count).map(|node| bits >> node & 1 == 1).collect::<Vec<_>>();
            let all: Vec<_> = (0..1_u32 << count).map(|bits| (cut_capacity(&graph, &sides(bits)), bits)).collect();
            let least = all.iter().map(|&(cut, _)| cut).min().unwrap();
            prop_assert_eq!(found.cut, least);
            // The union of all minimum cuts is the largest of them.
            let union = all.iter().filter(|&&(cut, _)| cut == least).fold(0, |bits, &(_, more)| bits | more);
            prop_assert_eq!(found.source_side, sides(union));
        }
    }
}
