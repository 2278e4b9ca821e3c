//! The winding number of curves in the plane by expansions (Barill, Dickson, Schmidt, Levin and Jacobson 2018, in two
//! dimensions): distant geometry is represented by a few moments.
//!
//! With points as complex numbers, a segment from `a` to `b` turns by the imaginary part of `log((b - p) / (a - p))`,
//! so around a centre `c` all derivatives of the dipole field are powers: `-Σ_k ((b - c)^k - (a - c)^k) / (k (p -
//! c)^k)`.

use glam::DVec2;
use pulp::Simd;

use super::expansion_tree::{BLOCK, Child, Groups, usable_opening, visit};
use super::lanes::{LANES, Lane};
use super::queries::{Field, evaluate, evaluate_many};
use super::segments::{SegmentBlock, add_segments, segment_blocks, validate_2d};
use super::turns::Turns;
use crate::MeshError;

/// The approximate winding number of directed segments: near segments by their angles, distant groups of segments by
/// the first moments of their dipole field.
///
/// Worth its error where outlines have gaps or are soups: 300,000 segments, a third of them missing, take 0.5 µs per
/// point, and [`crate::winding::WindingNumberHierarchy2d`] takes 240 µs. On connected outlines the latter is exact and
/// faster, as the closure of a piece of a curve is a single segment.
#[derive(Clone, Debug)]
pub struct FastWindingNumber2d {
    /// Four groups at a time; the first node is the root.
    nodes: Vec<Wide>,
    segments: Vec<SegmentBlock>,
}

/// Moments kept for each group: the dipole, the quadrupole and six more, which cost little in two dimensions. With an
/// opening of 2 each halves the error.
const MOMENTS: usize = 8;

/// Four groups of segments, one in each lane.
#[derive(Clone, Copy, Debug)]
struct Wide {
    centre: [Lane; 2],
    /// The farthest end's distance from the centre.
    radius: Lane,
    /// Squared distance beyond which the expansion is used; negative in unused lanes, whose moments are zero.
    near: Lane,
    /// Real and imaginary part of `Σ ((b - c)^k - (a - c)^k) / k` in units of the radius, for k = 1, 2, ...
    moments: [[Lane; 2]; MOMENTS],
    child: [Child; LANES],
}

impl FastWindingNumber2d {
    /// By default, expansions are used beyond this many radii of a group. Outlines with or without gaps and randomly
    /// scattered segments are then off by less than 3e-4; rough curves a thousand times longer than the figure by 1e-3.
    pub const OPENING: f64 = 2.0;

    /// Builds the tree of expansions over segments whose start and end are indices into `vertices`, with an opening
    /// parameter of [`Self::OPENING`].
    pub fn precompute(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Result<Self, MeshError> {
        Self::precompute_with_opening(vertices, segments, Self::OPENING)
    }

    /// Builds the tree of expansions. `opening` is the distance from a group's centre, in radii of the group, beyond
    /// which its expansion is used; it is at least 1, where expansions begin to converge, and NaN means
    /// [`Self::OPENING`].
    pub fn precompute_with_opening(
        vertices: &[[f64; 2]],
        segments: &[[u32; 2]],
        opening: f64,
    ) -> Result<Self, MeshError> {
        validate_2d(vertices, segments)?;
        let opening = usable_opening(opening, Self::OPENING);
        let mut segments = segments.to_vec();
        let fast = Self { nodes: Vec::new(), segments: Vec::new() };
        let mut builder = Builder { vertices, opening, fast };
        builder.add(vec![&mut segments]);
        Ok(builder.fast)
    }

    /// The winding number at `point` (the outline's unit), NaN if `point` is not finite, and on the curve that of one
    /// side or the mean of both.
    pub fn evaluate(&self, point: [f64; 2]) -> f64 {
        evaluate(self, point)
    }

    /// [`Self::evaluate`] at every point, in parallel; the numbers do not depend on the number of threads.
    pub fn evaluate_many(&self, points: &[[f64; 2]]) -> Vec<f64> {
        evaluate_many(self, points)
    }
}

impl Field<2> for FastWindingNumber2d {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, point: [f64; 2], stack: &mut Vec<u32>) -> f64 {
        let mut turns = Turns::new(simd);
        let far = visit(
            &self.nodes,
            point,
            stack,
            #[inline(always)]
            |block| {
                add_segments(&mut turns, &self.segments[block..=block], point);
            },
        );
        turns.total() - far.iter().sum::<f64>() / std::f64::consts::TAU
    }
}

impl Groups<2, LANES> for Wide {
    type Number = f64;

    /// With the sign reversed.
    #[inline(always)]
    fn expand(&self, p: [f64; 2]) -> (Lane, u32) {
        let (mut values, mut too_near) = ([0.0; LANES], [0; LANES]);
        for l in 0..LANES {
            let (x, y) = (p[0] - self.centre[0][l], p[1] - self.centre[1][l]);
            let squared = x * x + y * y;
            let is_near = squared <= self.near[l];
            // The radius over the offset, as a complex number.
            let scale = self.radius[l] / squared.max(f64::MIN_POSITIVE);
            let (u, v) = (x * scale, -y * scale);
            let (mut re, mut im) = (0.0, 0.0);
            for k in (0..MOMENTS).rev() {
                let (a, b) = (re + self.moments[k][0][l], im + self.moments[k][1][l]);
                (re, im) = (a * u - b * v, a * v + b * u);
            }
            values[l] = if is_near { 0.0 } else { im };
            too_near[l] = u32::from(is_near) << l;
        }
        (values, too_near.iter().fold(0, |all, one| all | one))
    }

    #[inline(always)]
    fn children(&self) -> &[Child; LANES] {
        &self.child
    }
}

struct Builder<'a> {
    vertices: &'a [[f64; 2]],
    opening: f64,
    fast: FastWindingNumber2d,
}

impl Builder<'_> {
    /// Appends a node over up to four groups and everything below; returns its index.
    fn add(&mut self, groups: Vec<&mut [[u32; 2]]>) -> u32 {
        let index = self.fast.nodes.len();
        let mut wide = Wide::empty();
        for (l, group) in groups.iter().enumerate() {
            self.store(group, &mut wide, l);
        }
        self.fast.nodes.push(wide);
        for (l, group) in groups.into_iter().enumerate() {
            let child = if group.len() <= LANES {
                self.fast.segments.extend(segment_blocks(self.vertices, group));
                BLOCK | (self.fast.segments.len() as u32 - 1)
            } else {
                let (left, right) = self.halves(group);
                let mut below = Vec::with_capacity(LANES);
                for half in [left, right] {
                    if half.len() <= LANES {
                        below.push(half);
                    } else {
                        let (one, two) = self.halves(half);
                        below.extend([one, two]);
                    }
                }
                self.add(below)
            };
            self.fast.nodes[index].child[l] = child;
        }
        index as u32
    }

    fn at(&self, vertex: u32) -> DVec2 {
        self.vertices[vertex as usize].into()
    }

    /// Two groups with about as many segments, side by side along the longer side of the box.
    fn halves<'s>(&self, segments: &'s mut [[u32; 2]]) -> (&'s mut [[u32; 2]], &'s mut [[u32; 2]]) {
        let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let places = segments.iter().flatten().map(|&v| self.at(v));
        let (low, high) = places.fold(none, |(low, high), p| (low.min(p), high.max(p)));
        let axis = usize::from(high.y - low.y > high.x - low.x);
        // Whole blocks on the left, so that few have unused lanes.
        let middle = (segments.len() / 2).next_multiple_of(LANES).min(segments.len() - 1);
        let centre = |s: &[u32; 2]| self.at(s[0])[axis] + self.at(s[1])[axis];
        segments.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
        segments.split_at_mut(middle)
    }

    fn store(&self, group: &[[u32; 2]], wide: &mut Wide, l: usize) {
        let ends = || group.iter().flatten().map(|&v| self.at(v));
        let none = (DVec2::INFINITY, DVec2::NEG_INFINITY);
        let (low, high) = ends().fold(none, |(low, high), p| (low.min(p), high.max(p)));
        let centre = 0.5 * low + 0.5 * high;
        let radius = ends().map(|p| p.distance(centre)).fold(0.0, f64::max);
        let mut moments = [DVec2::ZERO; MOMENTS];
        if radius > 0.0 {
            for ends in group {
                let [a, b] = ends.map(|v| (self.at(v) - centre) / radius);
                let (mut a_k, mut b_k) = (a, b);
                for (k, moment) in moments.iter_mut().enumerate() {
                    *moment += (b_k - a_k) / (k + 1) as f64;
                    // Complex products.
                    (a_k, b_k) = (a.rotate(a_k), b.rotate(b_k));
                }
            }
        }
        [wide.centre[0][l], wide.centre[1][l]] = centre.to_array();
        wide.radius[l] = radius;
        wide.near[l] = self.opening * self.opening * radius * radius;
        for k in 0..MOMENTS {
            [wide.moments[k][0][l], wide.moments[k][1][l]] = moments[k].to_array();
        }
    }
}

impl Wide {
    const fn empty() -> Self {
        let none = [0.0; LANES];
        Self {
            centre: [none; 2],
            radius: none,
            near: [-1.0; LANES],
            moments: [[none; 2]; MOMENTS],
            child: [BLOCK; LANES],
        }
    }
}
