//! The exact winding number of curves in the plane with a hierarchy of boxes (thesis 8.4.3, in two dimensions: the
//! closure joins exterior vertices instead of exterior edges).

use std::ops::Range;

use glam::DVec2;
use pulp::Simd;

use super::closure_tree::{Exterior, Inside, MARGIN, Node, Part, merged, summed, visit};
use super::lanes::LANES;
use super::queries::{Field, evaluate, evaluate_many};
use super::segments::{SegmentBlock, add_segments, segment_blocks, validate_2d};
use super::turns::Turns;
use crate::MeshError;
use crate::surface::weld_vertices;

/// A box with fewer segments than this is not divided further.
const LEAF: usize = 16;

/// Boxes around parts of a set of directed segments, each with a closure of the part.
#[derive(Clone, Debug)]
pub struct WindingNumberHierarchy2d {
    nodes: Vec<Node<2, Range<usize>>>,
    blocks: Vec<SegmentBlock>,
}

impl WindingNumberHierarchy2d {
    /// Builds the hierarchy over segments whose start and end are indices into `vertices`. Vertices at exactly one
    /// place are merged first.
    pub fn precompute(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Result<Self, MeshError> {
        validate_2d(vertices, segments)?;
        let weld = weld_vertices(&vertices.iter().map(|&[x, y]| [x, y, 0.0]).collect::<Vec<_>>(), 0.0);
        let places: Vec<[f64; 2]> = weld.representative.iter().map(|&v| vertices[v as usize]).collect();
        let mut segments: Vec<[u32; 2]> = segments.iter().map(|s| s.map(|v| weld.welded_of[v as usize])).collect();
        let mut hierarchy = Self { nodes: Vec::new(), blocks: Vec::new() };
        hierarchy.construct(&places, &mut segments);
        Ok(hierarchy)
    }

    /// The winding number at `point`, NaN if `point` is not finite, and on the curve that of one side or the mean of
    /// both. Agrees with [`crate::winding::winding_number_2d`] up to rounding.
    pub fn evaluate(&self, point: [f64; 2]) -> f64 {
        evaluate(self, point)
    }

    /// [`Self::evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
    pub fn evaluate_many(&self, points: &[[f64; 2]]) -> Vec<f64> {
        evaluate_many(self, points)
    }

    /// Appends the subtree over `segments`; returns how many more of them end than start at each exterior vertex, and
    /// the number of blocks that a point outside has to sum.
    fn construct(&mut self, places: &[[f64; 2]], segments: &mut [[u32; 2]]) -> (Exterior<u32>, usize) {
        let at = |v: u32| DVec2::from(places[v as usize]);
        let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = segments.iter().flatten().fold(none, |(low, high), &v| (low.min(at(v)), high.max(at(v))));
        let margin = DVec2::splat(MARGIN * low.distance(high));
        let index = self.nodes.len();
        let (widened_low, widened_high) = ((low - margin).to_array(), (high + margin).to_array());
        let inside = Inside::Blocks(0..0);
        self.nodes.push(Node { low: widened_low, high: widened_high, closure: None, inside });
        let (exterior, cost) = if segments.len() > LEAF {
            let axis = usize::from(high.y - low.y > high.x - low.x);
            let middle = segments.len() / 2;
            let centre = |s: &[u32; 2]| at(s[0])[axis] + at(s[1])[axis];
            segments.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
            let (left, right) = segments.split_at_mut(middle);
            let (left_exterior, left_cost) = self.construct(places, left);
            let second = self.nodes.len() as u32;
            self.nodes[index].inside = Inside::Children { second };
            let (right_exterior, right_cost) = self.construct(places, right);
            (merged(&left_exterior, &right_exterior), left_cost + right_cost)
        } else {
            let blocks = self.store(places, segments);
            let cost = blocks.len();
            self.nodes[index].inside = Inside::Blocks(blocks);
            let ends = segments.iter().flat_map(|&[from, to]| [(from, -1), (to, 1)]).collect();
            (summed(ends), cost)
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

impl Field<2> for WindingNumberHierarchy2d {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, point: [f64; 2], stack: &mut Vec<u32>) -> f64 {
        let mut turns = Turns::new(simd);
        visit(
            &self.nodes,
            point,
            stack,
            #[inline(always)]
            |part| {
                let blocks = match part {
                    Part::Closure(blocks) => blocks.clone(),
                    Part::Blocks(blocks) => blocks,
                };
                add_segments(&mut turns, &self.blocks[blocks], point);
            },
        );
        turns.total()
    }
}
