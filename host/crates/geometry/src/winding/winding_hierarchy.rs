//! The exact winding number with a hierarchy of boxes (thesis 8.4.3, algorithms 1 and 2).

use std::ops::Range;

use glam::DVec3;
use pulp::Simd;

use super::closure_tree::{Exterior, Inside, MARGIN, Node, Part, merged, summed, visit};
use super::lanes::LANES;
use super::queries::{Field, evaluate, evaluate_many};
use super::turns::{FanBlock, TriangleBlock, Turns, fan_blocks, triangle_blocks};
use crate::search::TriangleHierarchy;
use crate::surface::weld_vertices;
use crate::{MeshError, TriangleMesh};

/// A box with fewer facets than this is not divided further; the thesis uses about 100, but its facets cost an
/// arctangent.
const LEAF: usize = 24;
/// The cost of a block of four triangles relative to a block of four edges with a common apex.
const TRIANGLES: usize = 5;
const FAN: usize = 4;
/// Loops with at most this many edges are closed by triangles of their own, two fewer than edges; longer ones use the
/// apex of the fan.
const SHORT: usize = 9;

/// Boxes around parts of a mesh, each with a closure of the part: triangles between its exterior edges. Seen from
/// outside the box, part and closure have the same winding number, and the closure has far fewer triangles.
#[derive(Clone, Debug)]
pub struct WindingNumberHierarchy {
    nodes: Vec<Node<3, Closure>>,
    fans: Vec<FanBlock>,
    triangles: Vec<TriangleBlock>,
}

/// Triangles that close a part.
#[derive(Clone, Debug)]
struct Closure {
    /// These blocks of `fans`, around the apex.
    fan: Range<usize>,
    apex: [f64; 3],
    /// And these of `triangles`.
    triangles: Range<usize>,
}

impl WindingNumberHierarchy {
    /// Builds the hierarchy. Vertices at exactly one place are merged first, so that seams are not exterior edges.
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
        Self { nodes: Vec::new(), fans: Vec::new(), triangles: Vec::new() }
    }

    /// The winding number at `point` (mesh unit), NaN if `point` is not finite, and on the surface that of one side or
    /// the mean of both. Agrees with [`crate::winding::winding_number`] up to rounding.
    pub fn evaluate(&self, point: [f64; 3]) -> f64 {
        evaluate(self, point)
    }

    /// [`Self::evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
    pub fn evaluate_many(&self, points: &[[f64; 3]]) -> Vec<f64> {
        evaluate_many(self, points)
    }
}

impl Field<3> for WindingNumberHierarchy {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, point: [f64; 3], stack: &mut Vec<u32>) -> f64 {
        let mut turns = Turns::new(simd);
        visit(
            &self.nodes,
            point,
            stack,
            #[inline(always)]
            |part| {
                let blocks = match part {
                    Part::Closure(closure) => {
                        turns.add_fan(&self.fans[closure.fan.clone()], closure.apex, point);
                        closure.triangles.clone()
                    }
                    Part::Blocks(blocks) => blocks,
                };
                turns.add_triangles(&self.triangles[blocks], point);
            },
        );
        turns.total()
    }
}

struct Builder {
    boxes: TriangleHierarchy,
    places: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
    hierarchy: WindingNumberHierarchy,
}

impl Builder {
    /// Algorithm 1. Appends the subtree over a box; returns its exterior edges and the cost for a point outside.
    fn construct(&mut self, of_box: usize) -> (Exterior<[u32; 2]>, usize) {
        let Some((low, high)) = self.boxes.bounds_of(of_box) else { return (Vec::new(), 0) };
        let slots = self.boxes.slots_of(of_box);
        let margin = DVec3::splat(MARGIN * low.distance(high));
        let (low, high) = ((low - margin).to_array(), (high + margin).to_array());
        let index = self.hierarchy.nodes.len();
        self.hierarchy.nodes.push(Node { low, high, closure: None, inside: Inside::Blocks(0..0) });
        let (edges, cost) = match self.boxes.second_child(of_box) {
            Some(second_box) if slots.len() > LEAF => {
                let (left_edges, left_cost) = self.construct(of_box + 1);
                let second = self.hierarchy.nodes.len() as u32;
                self.hierarchy.nodes[index].inside = Inside::Children { second };
                let (right_edges, right_cost) = self.construct(second_box);
                (merged(&left_edges, &right_edges), left_cost + right_cost)
            }
            _ => {
                let facets: Vec<[u32; 3]> = slots.map(|s| self.triangles[self.boxes.triangle_in(s) as usize]).collect();
                let blocks = self.store(&facets);
                let cost = TRIANGLES * blocks.len();
                self.hierarchy.nodes[index].inside = Inside::Blocks(blocks);
                (exterior_edges(&facets), cost)
            }
        };
        let cost = self.close(index, &edges, cost);
        (edges, cost)
    }

    /// Stores the closure of a node if it costs less than `cost`; returns the lower cost.
    fn close(&mut self, index: usize, edges: &[([u32; 2], i64)], cost: usize) -> usize {
        let count: u64 = edges.iter().map(|(_, count)| count.unsigned_abs()).sum();
        // Too expensive even if all loops were triangles.
        if TRIANGLES as u64 * (count / 3).div_ceil(LANES as u64) >= cost as u64 {
            return cost;
        }
        let (long, short): (Vec<_>, Vec<_>) = loops(edges).into_iter().partition(|around| around.len() > SHORT);
        let triangles: Vec<[u32; 3]> =
            short.iter().flat_map(|around| around[1..].windows(2).map(|pair| [around[0], pair[0], pair[1]])).collect();
        let apex = long.first().map_or(0, |around| around[0]);
        let next = |around: &[u32], k: usize| around[(k + 1) % around.len()];
        let fan: Vec<[u32; 2]> = long
            .iter()
            .flat_map(|around| (0..around.len()).map(move |k| [around[k], next(around, k)]))
            .filter(|ends| !ends.contains(&apex))
            .collect();
        let closed = FAN * fan.len().div_ceil(LANES) + TRIANGLES * triangles.len().div_ceil(LANES);
        if closed >= cost {
            return cost;
        }
        let apex = self.places.get(apex as usize).copied().unwrap_or_default();
        let edges: Vec<[[f64; 3]; 2]> = fan.iter().map(|ends| ends.map(|v| self.places[v as usize])).collect();
        let first = self.hierarchy.fans.len();
        self.hierarchy.fans.extend(fan_blocks(&edges, apex));
        let fan = first..self.hierarchy.fans.len();
        let triangles = self.store(&triangles);
        self.hierarchy.nodes[index].closure = Some(Closure { fan, apex, triangles });
        closed
    }

    fn store(&mut self, triangles: &[[u32; 3]]) -> Range<usize> {
        let corners: Vec<_> = triangles.iter().map(|t| t.map(|v| self.places[v as usize])).collect();
        let first = self.hierarchy.triangles.len();
        self.hierarchy.triangles.extend(triangle_blocks(&corners));
        first..self.hierarchy.triangles.len()
    }
}

/// Loops that together run along each exterior edge as often as it counts, none passing twice through a vertex. They
/// exist because as many sides of facets arrive at a vertex as leave it.
fn loops(edges: &[([u32; 2], i64)]) -> Vec<Vec<u32>> {
    let mut steps: Vec<[u32; 2]> = Vec::new();
    for &([from, to], count) in edges {
        let directed = if count > 0 { [from, to] } else { [to, from] };
        steps.extend(std::iter::repeat_n(directed, count.unsigned_abs() as usize));
    }
    steps.sort_unstable();
    let vertices: Vec<u32> = steps.chunk_by(|s, t| s[0] == t[0]).map(|same| same[0][0]).collect();
    let number = |v: u32| vertices.partition_point(|&other| other < v);
    // The remaining steps from each vertex: the first of them, and one past the last.
    let mut left: Vec<[usize; 2]> = Vec::with_capacity(vertices.len());
    for same in steps.chunk_by(|s, t| s[0] == t[0]) {
        let first = left.last().map_or(0, |last| last[1]);
        left.push([first, first + same.len()]);
    }
    let mut on_path: Vec<Option<usize>> = vec![None; vertices.len()];
    let mut loops = Vec::new();
    for start in 0..vertices.len() {
        let mut path = vec![start];
        on_path[start] = Some(0);
        while let Some(&at) = path.last() {
            let [next, end] = left[at];
            if next == end {
                // This happens only at the start, from where no step is left.
                on_path[at] = None;
                path.pop();
                continue;
            }
            left[at][0] += 1;
            let to = number(steps[next][1]);
            if let Some(before) = on_path.get(to).copied().flatten() {
                let around = path.split_off(before + 1);
                around.iter().for_each(|&v| on_path[v] = None);
                loops.push(std::iter::once(to).chain(around).map(|v| vertices[v]).collect());
            } else if to < vertices.len() {
                on_path[to] = Some(path.len());
                path.push(to);
            }
        }
    }
    loops
}

/// Edges, each from its smaller to its larger vertex, along which the facets do not run equally often both ways.
fn exterior_edges(facets: &[[u32; 3]]) -> Exterior<[u32; 2]> {
    let mut sides = Vec::with_capacity(3 * facets.len());
    for &[a, b, c] in facets {
        for (from, to) in [(a, b), (b, c), (c, a)].into_iter().filter(|(from, to)| from != to) {
            sides.push(([from.min(to), from.max(to)], if from < to { 1 } else { -1 }));
        }
    }
    summed(sides)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loops_run_along_every_exterior_edge_and_through_no_vertex_twice() {
        // Two triangles and a square that all meet in vertex 0, and an edge that counts twice.
        let facets = [[0, 1, 2], [0, 3, 4], [0, 5, 6], [0, 6, 7], [8, 9, 10], [8, 9, 11]];
        let edges = exterior_edges(&facets);
        let loops = loops(&edges);
        let mut counted: Exterior<[u32; 2]> = Vec::new();
        for around in &loops {
            let mut vertices = around.clone();
            vertices.sort_unstable();
            vertices.dedup();
            assert_eq!(vertices.len(), around.len(), "{around:?} passes twice through a vertex");
            for (k, &from) in around.iter().enumerate() {
                let to = around[(k + 1) % around.len()];
                counted.push(([from.min(to), from.max(to)], if from < to { 1 } else { -1 }));
            }
        }
        assert_eq!(summed(counted), edges);
        let mut lengths: Vec<usize> = loops.iter().map(Vec::len).collect();
        lengths.sort_unstable();
        assert_eq!(lengths, [3, 3, 3, 3, 4]);
    }

    #[test]
    fn a_closed_part_costs_nothing_outside() {
        let tetrahedron = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
        assert!(exterior_edges(&tetrahedron).is_empty() && loops(&[]).is_empty());
    }
}
