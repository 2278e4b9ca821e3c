//! Pieces of a segmentation, and chains of elements that join what must be in one piece.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::ops::ControlFlow;

use super::energy::{OUTSIDE, is_plausible, twins};
use super::error::SegmentationError;
use crate::progress::{Progress, stage};
/// Elements taken from the queue between two progress reports.
const REPORT_EVERY: usize = 8192;
/// Even an element with a winding number of one costs this share of its volume, so that of two free paths the one
/// through less volume is chosen.
const LEAST_COST: f64 = 1e-3;
const NONE: u32 = u32::MAX;

/// The pieces of inside elements that are connected through facets.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ConnectedPieces {
    /// For each element, its piece; `u32::MAX` if it is outside. Pieces are numbered by their first elements.
    pub piece_of: Vec<u32>,
    /// How many elements each piece has.
    pub sizes: Vec<usize>,
}

/// Finds the facet-connected pieces of the inside.
///
/// `inside`: a label for each of n elements; `neighbours`: n×K, the element across each facet, `u32::MAX` beyond
/// the hull.
pub fn connected_pieces<const K: usize>(
    inside: &[bool],
    neighbours: &[[u32; K]],
) -> Result<ConnectedPieces, SegmentationError> {
    right_length("labels", inside.len(), neighbours.len())?;
    twins(neighbours)?;
    Ok(pieces(inside, neighbours))
}

fn pieces<const K: usize>(inside: &[bool], neighbours: &[[u32; K]]) -> ConnectedPieces {
    let mut found = ConnectedPieces { piece_of: vec![NONE; inside.len()], sizes: Vec::new() };
    let mut stack = Vec::new();
    for seed in 0..inside.len() {
        if !inside[seed] || found.piece_of[seed] != NONE {
            continue;
        }
        let piece = found.sizes.len() as u32;
        let mut size = 0;
        found.piece_of[seed] = piece;
        stack.push(seed);
        while let Some(element) = stack.pop() {
            size += 1;
            for &next in &neighbours[element] {
                let reached = next as usize;
                if next != OUTSIDE && inside[reached] && found.piece_of[reached] == NONE {
                    found.piece_of[reached] = piece;
                    stack.push(reached);
                }
            }
        }
        found.sizes.push(size);
    }
    found
}

/// Why elements were labelled inside.
#[derive(Clone, Debug, PartialEq)]
pub struct AddedChain {
    /// The group whose vertices it joins, zero-based.
    pub group: usize,
    /// The vertex that it reaches, at whose elements it ends.
    pub vertex: u32,
    /// The elements that were outside, from the vertex to what was joined before. Empty if none was needed.
    pub elements: Vec<u32>,
    /// The volume of these elements, each times how far its winding number falls short of one: how much of what the
    /// surface leaves outside had to be included.
    pub shortfall: f64,
}

/// An inside in which every group of vertices is in one piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Connected {
    /// The labels, including the chains.
    pub inside: Vec<bool>,
    /// The chains that were needed, in the order they were added.
    pub added: Vec<AddedChain>,
    /// Group and vertex of those that no path through the elements reaches, and vertices of no element.
    pub unreachable: Vec<(usize, u32)>,
}

/// Joins each group of vertices, such as samples along the bones of one skeleton, in one facet-connected piece of the
/// inside, by labelling the cheapest chains of elements as inside.
///
/// `elements`: n×K corners; `neighbours`: n×K, the element across each facet, `u32::MAX` beyond the hull; `winding`,
/// `measures` and `inside`: n winding numbers, areas or volumes, and labels. A group starts from the piece that touches
/// most of its vertices (the largest of those), or if none does, from its first vertex. The vertices outside it are
/// then joined one after another, nearest first: an element that is inside costs nothing, any other costs its measure
/// times how far its winding number falls short of one. Inside labels stay inside. `progress` receives the fraction of
/// groups done; see [`Progress`].
pub fn connect_vertices<const K: usize>(
    elements: &[[u32; K]],
    neighbours: &[[u32; K]],
    winding: &[f64],
    measures: &[f64],
    inside: &[bool],
    groups: &[Vec<u32>],
    progress: Progress<'_>,
) -> Result<Connected, SegmentationError> {
    let count = elements.len();
    for (what, found) in [
        ("rows of neighbours", neighbours.len()),
        ("winding numbers", winding.len()),
        ("measures", measures.len()),
        ("labels", inside.len()),
    ] {
        right_length(what, found, count)?;
    }
    twins(neighbours)?;
    if let Some(element) = winding.iter().position(|&w| !is_plausible(w)) {
        return Err(SegmentationError::BadWinding { element, value: winding[element] });
    }
    if let Some(element) = measures.iter().position(|&m| !(m.is_finite() && m >= 0.0)) {
        return Err(SegmentationError::BadMeasure { element, value: measures[element] });
    }
    let largest = measures.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let short = |t: usize| (1.0 - winding[t]).max(0.0);
    // Relative to the largest: sums of malicious measures stay finite, and the unit does not matter.
    let cost = |t: usize| measures[t] / largest * (short(t) + LEAST_COST);
    let around = Around::new(elements, groups);
    let mut report = stage(progress, "joining bones");
    let mut connected = Connected { inside: inside.to_vec(), ..Connected::default() };
    for (group, vertices) in groups.iter().enumerate() {
        let mut join = |done: f64| report((group as f64 + done) / groups.len() as f64);
        let costs: Vec<f64> = (0..count).map(|t| if connected.inside[t] { 0.0 } else { cost(t) }).collect();
        join_group(group, vertices, &around, neighbours, &costs, &mut connected, &mut join)?;
    }
    for chain in &mut connected.added {
        chain.shortfall = chain.elements.iter().map(|&t| measures[t as usize] * short(t as usize)).sum();
    }
    Ok(connected)
}

fn right_length(what: &'static str, found: usize, elements: usize) -> Result<(), SegmentationError> {
    if found == elements { Ok(()) } else { Err(SegmentationError::WrongLength { what, found, elements }) }
}

/// The elements around each vertex that belongs to a group.
struct Around {
    /// The vertices, ascending.
    vertices: Vec<u32>,
    elements: Vec<Vec<u32>>,
}

impl Around {
    fn new<const K: usize>(elements: &[[u32; K]], groups: &[Vec<u32>]) -> Self {
        let mut vertices: Vec<u32> = groups.iter().flatten().copied().collect();
        vertices.sort_unstable();
        vertices.dedup();
        let mut around = Self { elements: vec![Vec::new(); vertices.len()], vertices };
        for (element, corner) in elements.iter().enumerate().flat_map(|(t, row)| row.iter().map(move |&v| (t, v))) {
            if let Ok(k) = around.vertices.binary_search(&corner) {
                around.elements[k].push(element as u32);
            }
        }
        around
    }

    fn of(&self, vertex: u32) -> &[u32] {
        self.vertices.binary_search(&vertex).map_or(&[], |k| &self.elements[k])
    }
}

/// Grows one piece until it touches all vertices of a group.
fn join_group<const K: usize>(
    group: usize,
    vertices: &[u32],
    around: &Around,
    neighbours: &[[u32; K]],
    costs: &[f64],
    connected: &mut Connected,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(), SegmentationError> {
    let mut waiting: Vec<u32> = vertices.to_vec();
    waiting.sort_unstable();
    waiting.dedup();
    let lost: Vec<u32> = waiting.extract_if(.., |&mut v| around.of(v).is_empty()).collect();
    connected.unreachable.extend(lost.into_iter().map(|v| (group, v)));
    let wanted = waiting.len().max(1);
    let mut joined = start(&waiting, vertices, around, neighbours, costs, group, connected);
    loop {
        waiting.retain(|&v| !around.of(v).iter().any(|&t| joined[t as usize]));
        if waiting.is_empty() {
            return Ok(());
        }
        if progress(1.0 - waiting.len() as f64 / wanted as f64).is_break() {
            return Err(SegmentationError::Cancelled);
        }
        let goal = |t: u32| waiting.iter().copied().find(|&v| around.of(v).contains(&t));
        let is_goal: Vec<u32> = waiting.iter().flat_map(|&v| around.of(v)).copied().collect();
        let Some(way) = cheapest_way(neighbours, costs, &joined, &is_goal, progress)? else {
            connected.unreachable.extend(waiting.iter().map(|&v| (group, v)));
            return Ok(());
        };
        let added: Vec<u32> = way.iter().copied().filter(|&t| !connected.inside[t as usize]).collect();
        let vertex = way.first().and_then(|&t| goal(t)).unwrap_or(waiting[0]);
        for &t in &way {
            connected.inside[t as usize] = true;
        }
        flood(&way, &connected.inside, neighbours, &mut joined);
        connected.added.push(AddedChain { group, vertex, elements: added, shortfall: 0.0 });
    }
}

/// The elements of the piece a group starts from.
fn start<const K: usize>(
    waiting: &[u32],
    vertices: &[u32],
    around: &Around,
    neighbours: &[[u32; K]],
    costs: &[f64],
    group: usize,
    connected: &mut Connected,
) -> Vec<bool> {
    let found = pieces(&connected.inside, neighbours);
    let mut touched = vec![0_usize; found.sizes.len()];
    for &vertex in waiting {
        let mut here: Vec<u32> = around.of(vertex).iter().map(|&t| found.piece_of[t as usize]).collect();
        here.sort_unstable();
        here.dedup();
        here.iter().filter(|&&p| p != NONE).for_each(|&p| touched[p as usize] += 1);
    }
    let best = (0..touched.len()).max_by_key(|&p| (touched[p], found.sizes[p], Reverse(p)));
    if let Some(best) = best.filter(|&p| touched[p] > 0) {
        return found.piece_of.iter().map(|&p| p == best as u32).collect();
    }
    let mut joined = vec![false; costs.len()];
    let first = vertices.iter().copied().find(|v| waiting.binary_search(v).is_ok());
    let cheapest = first.and_then(|v| {
        let least = around.of(v).iter().copied().min_by(|&a, &b| costs[a as usize].total_cmp(&costs[b as usize]));
        least.map(|t| (v, t))
    });
    if let Some((vertex, element)) = cheapest {
        connected.inside[element as usize] = true;
        connected.added.push(AddedChain { group, vertex, elements: vec![element], shortfall: 0.0 });
        flood(&[element], &connected.inside, neighbours, &mut joined);
    }
    joined
}

/// Marks all inside elements connected to the given ones.
fn flood<const K: usize>(from: &[u32], inside: &[bool], neighbours: &[[u32; K]], marked: &mut [bool]) {
    let mut stack = from.to_vec();
    while let Some(t) = stack.pop() {
        if !marked[t as usize] {
            marked[t as usize] = true;
            stack.extend(neighbours[t as usize].iter().filter(|&&n| n != OUTSIDE && inside[n as usize]));
        }
    }
}

/// Dijkstra's cheapest chain from a goal to what is joined, both ends included; `None` if there is none.
fn cheapest_way<const K: usize>(
    neighbours: &[[u32; K]],
    costs: &[f64],
    joined: &[bool],
    goals: &[u32],
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Option<Vec<u32>>, SegmentationError> {
    let mut is_goal = vec![false; costs.len()];
    goals.iter().for_each(|&t| is_goal[t as usize] = true);
    let mut distance = vec![f64::INFINITY; costs.len()];
    let mut from = vec![NONE; costs.len()];
    // Costs are not negative, and the bits of such numbers are in their order.
    let mut queue: BinaryHeap<Reverse<(u64, u32)>> = BinaryHeap::new();
    for t in (0..costs.len()).filter(|&t| joined[t]) {
        distance[t] = 0.0;
        queue.push(Reverse((0, t as u32)));
    }
    let mut taken = 0;
    while let Some(Reverse((bits, element))) = queue.pop() {
        let t = element as usize;
        if bits != distance[t].to_bits() {
            continue;
        }
        if is_goal[t] {
            let way = std::iter::successors(Some(element), |&t| Some(from[t as usize]).filter(|&f| f != NONE));
            return Ok(Some(way.collect()));
        }
        taken += 1;
        if taken % REPORT_EVERY == 0 && progress(0.0).is_break() {
            return Err(SegmentationError::Cancelled);
        }
        for &next in &neighbours[t] {
            if next == OUTSIDE {
                continue;
            }
            let there = distance[t] + costs[next as usize];
            if there < distance[next as usize] {
                distance[next as usize] = there;
                from[next as usize] = element;
                queue.push(Reverse((there.to_bits(), next)));
            }
        }
    }
    Ok(None)
}
