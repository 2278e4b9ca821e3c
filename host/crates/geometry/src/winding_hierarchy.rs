//! The exact winding number by a hierarchy of boxes (thesis 8.4.3, algorithms 1 and 2).

use std::cmp::Ordering;

use glam::DVec3;
use rayon::prelude::*;

use crate::turns::{FanBlock, LANES, TriangleBlock, Turns, answer_without_looking, triangle_blocks};
use crate::{MeshError, TriangleHierarchy, TriangleMesh, weld_vertices};

/// Facets below which a box is not divided further; the thesis takes about 100, but its facets cost an arctangent.
const LEAF: usize = 24;
/// By how much of its diagonal a box is widened: a point outside sees the closure from a distance at which rounding
/// cannot turn a closing triangle over.
const MARGIN: f64 = 1e-9;

/// Boxes around parts of a mesh, each with a closure of the part: triangles from its exterior edges to one vertex.
/// Seen from outside the box, part and closure have the same winding number, and the closure has far fewer triangles.
#[derive(Clone, Debug)]
pub struct WindingNumberHierarchy {
    nodes: Vec<Node>,
    fans: Vec<FanBlock>,
    facets: Vec<TriangleBlock>,
}

#[derive(Clone, Debug)]
struct Node {
    low: [f64; 3],
    high: [f64; 3],
    /// What to do for a point outside the box.
    outside: Outside,
    /// What to do for a point inside the box.
    inside: Inside,
}

#[derive(Clone, Copy, Debug)]
enum Outside {
    /// Sum these blocks of `fans` around the apex.
    Closure { first: u32, end: u32, apex: [f64; 3] },
    /// The closure is no shorter than what lies inside.
    AsInside,
}

#[derive(Clone, Copy, Debug)]
enum Inside {
    /// Sum these blocks of `facets`.
    Facets { first: u32, end: u32 },
    /// Ask both children: the node after this one, and this one.
    Children { second: u32 },
}

impl WindingNumberHierarchy {
    /// Builds the hierarchy. Vertices at exactly one place are joined first, so that seams are not exterior edges.
    pub fn precompute(mesh: &TriangleMesh) -> Result<Self, MeshError> {
        let boxes = TriangleHierarchy::new(mesh)?;
        let weld = weld_vertices(&mesh.vertices, 0.0);
        let places: Vec<[f64; 3]> = weld.representative.iter().map(|&v| mesh.vertices[v as usize]).collect();
        let triangles = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
        let mut builder = Builder { boxes, places, triangles, hierarchy: Self::empty() };
        builder.construct(0);
        Ok(builder.hierarchy)
    }

    const fn empty() -> Self {
        Self { nodes: Vec::new(), fans: Vec::new(), facets: Vec::new() }
    }

    /// The winding number at `point` (mesh unit); NaN where `point` is not finite, and on the surface that of one
    /// side or the mean of both. Agrees with [`crate::winding_number`] up to rounding.
    pub fn evaluate(&self, point: [f64; 3]) -> f64 {
        self.evaluate_with(point, &mut Vec::with_capacity(64))
    }

    /// [`Self::evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
    pub fn evaluate_many(&self, points: &[[f64; 3]]) -> Vec<f64> {
        points.par_iter().map_init(|| Vec::with_capacity(64), |stack, &p| self.evaluate_with(p, stack)).collect()
    }

    fn evaluate_with(&self, p: [f64; 3], stack: &mut Vec<u32>) -> f64 {
        if let Some(answer) = answer_without_looking(&p) {
            return answer;
        }
        let mut turns = Turns::new();
        stack.clear();
        stack.push(0);
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index as usize) else { continue };
            if let Outside::Closure { first, end, apex } = node.outside
                && is_outside(p, node)
            {
                turns.add_fan(&self.fans[first as usize..end as usize], apex, p);
                continue;
            }
            match node.inside {
                Inside::Facets { first, end } => {
                    for block in &self.facets[first as usize..end as usize] {
                        turns.add_triangles(block, p);
                    }
                }
                Inside::Children { second } => stack.extend([second, index + 1]),
            }
        }
        turns.total()
    }
}

fn is_outside(p: [f64; 3], node: &Node) -> bool {
    (0..3).any(|k| p[k] < node.low[k] || p[k] > node.high[k])
}

/// An edge from its smaller to its larger vertex, and how many more times the facets run along it that way than back.
type ExteriorEdge = ([u32; 2], i32);

struct Builder {
    boxes: TriangleHierarchy,
    places: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    hierarchy: WindingNumberHierarchy,
}

impl Builder {
    /// Algorithm 1. Appends the subtree over a box; returns its exterior edges and the number of blocks that a point
    /// outside has to sum.
    fn construct(&mut self, of_box: usize) -> (Vec<ExteriorEdge>, usize) {
        let Some((low, high)) = self.boxes.bounds_of(of_box) else { return (Vec::new(), 0) };
        let slots = self.boxes.slots_of(of_box);
        let margin = MARGIN * low.distance(high);
        let (low, high) = ((low - DVec3::splat(margin)).to_array(), (high + DVec3::splat(margin)).to_array());
        let index = self.hierarchy.nodes.len();
        let inside = Inside::Facets { first: 0, end: 0 };
        self.hierarchy.nodes.push(Node { low, high, outside: Outside::AsInside, inside });
        let facets: Vec<[u32; 3]> = slots.map(|slot| self.triangles[self.boxes.triangle_in(slot) as usize]).collect();
        let (edges, cost) = match self.boxes.second_child(of_box) {
            Some(second) if facets.len() > LEAF => {
                let (left_edges, left_cost) = self.construct(of_box + 1);
                let second_node = self.hierarchy.nodes.len() as u32;
                let (right_edges, right_cost) = self.construct(second);
                self.hierarchy.nodes[index].inside = Inside::Children { second: second_node };
                (merge(&left_edges, &right_edges), left_cost + right_cost)
            }
            _ => {
                let first = self.hierarchy.facets.len();
                let corners: Vec<_> = facets.iter().map(|t| t.map(|v| self.places[v as usize])).collect();
                self.hierarchy.facets.extend(triangle_blocks(&corners));
                let end = self.hierarchy.facets.len();
                self.hierarchy.nodes[index].inside = Inside::Facets { first: first as u32, end: end as u32 };
                (exterior_edges(&facets), end - first)
            }
        };
        let closed_cost = self.close(index, &edges, cost);
        (edges, closed_cost)
    }

    /// Stores the closure of a node if it is shorter than `cost` blocks; returns the smaller number.
    fn close(&mut self, index: usize, edges: &[ExteriorEdge], cost: usize) -> usize {
        let apex = edges.first().map_or(0, |&([v, _], _)| v);
        let mut fan: Vec<[u32; 2]> = Vec::new();
        for &([from, to], count) in edges.iter().filter(|(ends, _)| !ends.contains(&apex)) {
            let directed = if count > 0 { [from, to] } else { [to, from] };
            fan.extend(std::iter::repeat_n(directed, count.unsigned_abs() as usize));
            if fan.len() >= cost * LANES {
                return cost;
            }
        }
        let blocks = fan.len().div_ceil(LANES);
        if blocks >= cost {
            return cost;
        }
        let first = self.hierarchy.fans.len() as u32;
        for chunk in fan.chunks(LANES) {
            // Unused lanes repeat the apex, which spans nothing.
            let apex_place = self.places[apex as usize];
            let mut block = FanBlock(std::array::from_fn(|_| apex_place.map(|c| [c; LANES])));
            for (l, ends) in chunk.iter().enumerate() {
                for end in 0..2 {
                    for axis in 0..3 {
                        block.0[end][axis][l] = self.places[ends[end] as usize][axis];
                    }
                }
            }
            self.hierarchy.fans.push(block);
        }
        let apex = self.places.get(apex as usize).copied().unwrap_or_default();
        let end = self.hierarchy.fans.len() as u32;
        self.hierarchy.nodes[index].outside = Outside::Closure { first, end, apex };
        blocks
    }
}

/// Edges that the facets do not run along equally often both ways, sorted.
fn exterior_edges(facets: &[[u32; 3]]) -> Vec<ExteriorEdge> {
    let mut sides: Vec<ExteriorEdge> = Vec::with_capacity(3 * facets.len());
    for &[a, b, c] in facets {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            if from != to {
                sides.push(([from.min(to), from.max(to)], if from < to { 1 } else { -1 }));
            }
        }
    }
    sides.sort_unstable();
    let mut edges: Vec<ExteriorEdge> = Vec::new();
    for (ends, count) in sides {
        match edges.last_mut() {
            Some(last) if last.0 == ends => last.1 += count,
            _ => edges.push((ends, count)),
        }
    }
    edges.retain(|&(_, count)| count != 0);
    edges
}

/// The exterior edges of two sets of facets together.
fn merge(left: &[ExteriorEdge], right: &[ExteriorEdge]) -> Vec<ExteriorEdge> {
    let mut merged = Vec::with_capacity(left.len() + right.len());
    let (mut i, mut j) = (0, 0);
    while i < left.len() && j < right.len() {
        let ((a, m), (b, n)) = (left[i], right[j]);
        match a.cmp(&b) {
            Ordering::Equal => {
                merged.extend((m + n != 0).then_some((a, m + n)));
                (i, j) = (i + 1, j + 1);
            }
            Ordering::Less => {
                merged.push((a, m));
                i += 1;
            }
            Ordering::Greater => {
                merged.push((b, n));
                j += 1;
            }
        }
    }
    merged.extend_from_slice(&left[i..]);
    merged.extend_from_slice(&right[j..]);
    merged
}
