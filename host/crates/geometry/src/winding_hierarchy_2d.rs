//! The exact winding number of curves in the plane by a hierarchy of boxes (thesis 8.4.3, in two dimensions: the
//! closure joins exterior vertices instead of exterior edges).

use std::ops::Range;

use glam::DVec2;
use rayon::prelude::*;

use crate::turns::{LANES, Turns, answer_without_looking};
use crate::winding_number::{SegmentBlock, add_segments, segment_blocks, validate_2d};
use crate::{MeshError, weld_vertices};

/// Segments below which a box is not divided further.
const LEAF: usize = 16;
/// By how much of its diagonal a box is widened, so that rounding cannot turn a closing segment over.
const MARGIN: f64 = 1e-9;

/// Boxes around parts of a set of directed segments, each with a closure of the part.
#[derive(Clone, Debug)]
pub struct WindingNumberHierarchy2d {
    nodes: Vec<Node>,
    blocks: Vec<SegmentBlock>,
}

#[derive(Clone, Debug)]
struct Node {
    low: DVec2,
    high: DVec2,
    /// Blocks to sum for a point outside the box; `None` if they are no fewer than what lies inside.
    closure: Option<Range<usize>>,
    /// Blocks to sum for a point inside the box of a leaf.
    segments: Range<usize>,
    /// The second child; the first is the node after this one. `None` for a leaf.
    second: Option<usize>,
}

impl WindingNumberHierarchy2d {
    /// Builds the hierarchy over segments that name their start and end in `vertices`. Vertices at exactly one place
    /// are joined first.
    pub fn precompute(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Result<Self, MeshError> {
        validate_2d(vertices, segments)?;
        let weld = weld_vertices(&vertices.iter().map(|&[x, y]| [x, y, 0.0]).collect::<Vec<_>>(), 0.0);
        let places: Vec<[f64; 2]> = weld.representative.iter().map(|&v| vertices[v as usize]).collect();
        let mut segments: Vec<[u32; 2]> = segments.iter().map(|s| s.map(|v| weld.welded_of[v as usize])).collect();
        let mut hierarchy = Self { nodes: Vec::new(), blocks: Vec::new() };
        hierarchy.construct(&places, &mut segments);
        Ok(hierarchy)
    }

    /// The winding number at `point`; NaN where `point` is not finite, and on the curve that of one side or the mean
    /// of both. Agrees with [`crate::winding_number_2d`] up to rounding.
    pub fn evaluate(&self, point: [f64; 2]) -> f64 {
        self.evaluate_with(point, &mut Vec::with_capacity(64))
    }

    /// [`Self::evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
    pub fn evaluate_many(&self, points: &[[f64; 2]]) -> Vec<f64> {
        points.par_iter().map_init(|| Vec::with_capacity(64), |stack, &p| self.evaluate_with(p, stack)).collect()
    }

    fn evaluate_with(&self, p: [f64; 2], stack: &mut Vec<usize>) -> f64 {
        if let Some(answer) = answer_without_looking(&p) {
            return answer;
        }
        let mut turns = Turns::new();
        stack.clear();
        stack.push(0);
        while let Some(index) = stack.pop() {
            let Some(node) = self.nodes.get(index) else { continue };
            let place = DVec2::from(p);
            let is_outside = place.cmplt(node.low).any() || place.cmpgt(node.high).any();
            let blocks = match (&node.closure, node.second) {
                (Some(closure), _) if is_outside => closure,
                (_, Some(second)) => {
                    stack.extend([second, index + 1]);
                    continue;
                }
                _ => &node.segments,
            };
            add_segments(&mut turns, &self.blocks[blocks.clone()], p);
        }
        turns.total()
    }

    /// Appends the subtree over `segments`; returns how many more of them end than start at each exterior vertex,
    /// and the number of blocks that a point outside has to sum.
    fn construct(&mut self, places: &[[f64; 2]], segments: &mut [[u32; 2]]) -> (Vec<(u32, i64)>, usize) {
        let at = |v: u32| DVec2::from(places[v as usize]);
        let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = segments.iter().flatten().fold(none, |(low, high), &v| (low.min(at(v)), high.max(at(v))));
        let margin = DVec2::splat(MARGIN * low.distance(high));
        let index = self.nodes.len();
        self.nodes.push(Node { low: low - margin, high: high + margin, closure: None, segments: 0..0, second: None });
        let (exterior, cost) = if segments.len() > LEAF {
            let axis = usize::from(high.y - low.y > high.x - low.x);
            let middle = segments.len() / 2;
            let centre = |s: &[u32; 2]| at(s[0])[axis] + at(s[1])[axis];
            segments.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
            let (left, right) = segments.split_at_mut(middle);
            let (mut exterior, left_cost) = self.construct(places, left);
            self.nodes[index].second = Some(self.nodes.len());
            let (more, right_cost) = self.construct(places, right);
            exterior.extend(more);
            (add_up(exterior), left_cost + right_cost)
        } else {
            self.nodes[index].segments = self.store(places, segments);
            let ends = segments.iter().flat_map(|&[from, to]| [(from, -1), (to, 1)]).collect();
            (add_up(ends), self.nodes[index].segments.len())
        };
        let closing: usize = exterior.iter().skip(1).map(|(_, count)| count.unsigned_abs() as usize).sum();
        if closing.div_ceil(LANES) >= cost {
            return (exterior, cost);
        }
        let apex = exterior.first().map_or(0, |&(v, _)| v);
        let closure: Vec<[u32; 2]> = exterior
            .iter()
            .skip(1)
            .flat_map(|&(v, count)| {
                std::iter::repeat_n(if count > 0 { [apex, v] } else { [v, apex] }, count.unsigned_abs() as usize)
            })
            .collect();
        self.nodes[index].closure = Some(self.store(places, &closure));
        (exterior, closing.div_ceil(LANES))
    }

    fn store(&mut self, places: &[[f64; 2]], segments: &[[u32; 2]]) -> Range<usize> {
        let first = self.blocks.len();
        self.blocks.extend(segment_blocks(places, segments));
        first..self.blocks.len()
    }
}

/// One entry for each vertex whose counts do not cancel, ascending.
fn add_up(mut counts: Vec<(u32, i64)>) -> Vec<(u32, i64)> {
    counts.sort_unstable();
    counts.dedup_by(|next, kept| {
        let same = next.0 == kept.0;
        kept.1 += if same { next.1 } else { 0 };
        same
    });
    counts.retain(|&(_, count)| count != 0);
    counts
}
