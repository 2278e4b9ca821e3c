//! One edge collapse: where to, at what cost, and whether the surface is preserved.

use std::cell::Cell;

use glam::DVec3;

use super::quadric::Quadric;
use super::surface::Surface;
use crate::search::box_tree::Bounds;
use crate::surface::self_intersections::{Facet, meet};

/// More triangles around a vertex than any sound surface needs; beyond this, every step would cost as much as the mesh.
const MOST_IN_STAR: usize = 48;
/// Cosine by which a triangle may turn in one collapse.
const MOST_TURN: f64 = 0.25;
/// Lowest quality of a triangle, where 1 is equilateral, unless the collapse improves on the present one.
const LEAST_QUALITY: f64 = 0.12;
/// Fraction of the distance to a facing sheet by which a vertex may leave the planes it represents: the two sheets
/// together use up half of it.
const SHARE_OF_GAP: f64 = 0.25;

/// Why a collapse is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// The surface's topology would change.
    Topology,
    /// A triangle would flip, become a needle or meet another, or two sheets would come too close.
    Geometry,
    /// The edge no longer exists.
    Stale,
}

/// A triangle after the collapse.
#[derive(Clone, Copy, Debug)]
struct Changed {
    names: [u32; 3],
    corners: [DVec3; 3],
    normal: DVec3,
    bounds: Bounds,
}

/// Reusable storage for evaluating a collapse.
#[derive(Debug)]
pub(super) struct Bench {
    /// Stamps of the vertices around the first and the second end, and of triangles.
    marks: [Vec<u32>; 2],
    triangle_marks: Vec<u32>,
    stamp: u32,
    counts: [Vec<(u32, u32)>; 2],
    changed: Vec<Changed>,
    near: Vec<u32>,
    /// Pairs of triangles tested so far.
    pub(super) pairs: usize,
}

impl Bench {
    pub(super) fn new(surface: &Surface) -> Self {
        let none = vec![0; surface.positions.len()];
        Self {
            marks: [none.clone(), none],
            triangle_marks: vec![0; surface.triangles.len()],
            stamp: 0,
            counts: [Vec::new(), Vec::new()],
            changed: Vec::new(),
            near: Vec::new(),
            pairs: 0,
        }
    }

    /// Whether the surface keeps its topology when an edge becomes a vertex: the link condition, for surfaces with
    /// open and non-manifold edges.
    pub(super) fn keeps_topology(&mut self, surface: &Surface, ends: [u32; 2]) -> Result<(), Refusal> {
        if surface.star_bound(ends[0]) + surface.star_bound(ends[1]) > 4 * MOST_IN_STAR {
            return Err(Refusal::Topology);
        }
        self.stamp += 1;
        for side in 0..2 {
            let counts = &mut self.counts[side];
            counts.clear();
            for t in surface.star(ends[side]) {
                for &v in surface.triangles[t as usize].iter().filter(|&&v| v != ends[side]) {
                    match counts.iter_mut().find(|(other, _)| *other == v) {
                        Some((_, count)) => *count += 1,
                        None => counts.push((v, 1)),
                    }
                }
            }
            for &(v, _) in &self.counts[side] {
                self.marks[side][v as usize] = self.stamp;
            }
        }
        let on_edge = count_of(&self.counts[0], ends[1]);
        if on_edge == 0 {
            return Err(Refusal::Stale);
        }
        let [is_feature, other_is_feature] = [0, 1].map(|side| self.counts[side].iter().any(|&(_, count)| count != 2));
        if is_feature && other_is_feature && on_edge == 2 {
            return Err(Refusal::Topology);
        }
        let is_common = |v: u32| self.marks.iter().all(|marks| marks[v as usize] == self.stamp);
        let common = self.counts[0].iter().filter(|&&(v, _)| is_common(v)).count() as u32;
        let mut size = 0;
        for t in surface.star(ends[0]) {
            let corners = surface.triangles[t as usize];
            if let Some(&apex) = corners.iter().find(|v| !ends.contains(v)).filter(|_| corners.contains(&ends[1])) {
                // A triangle attached only by this edge would become an edge without a triangle.
                if count_of(&self.counts[0], apex) == 1 && count_of(&self.counts[1], apex) == 1 {
                    return Err(Refusal::Topology);
                }
            } else if corners.iter().all(|&v| v == ends[0] || is_common(v)) {
                // Closed over by a triangle of the other end, the two would lie on top of each other.
                let rest = |u: u32| corners.contains(&u);
                let closed = surface.star(ends[1]).any(|s| {
                    surface.triangles[s as usize].iter().filter(|&&v| v != ends[1] && rest(v) && v != ends[0]).count()
                        == 2
                });
                if closed {
                    return Err(Refusal::Topology);
                }
            }
            size += 1;
        }
        size += surface.star(ends[1]).count();
        let size = size - 2 * on_edge as usize;
        if common != on_edge || size == 0 || size > MOST_IN_STAR {
            return Err(Refusal::Topology);
        }
        Ok(())
    }

    /// Whether the surface may have the edge's ends at `place`, after [`Self::keeps_topology`].
    pub(super) fn keeps_shape(&mut self, surface: &Surface, ends: [u32; 2], place: DVec3) -> Result<(), Refusal> {
        self.changed.clear();
        let (mut least, mut least_before) = (f64::INFINITY, f64::INFINITY);
        for vertex in ends {
            for t in surface.star(vertex) {
                let names = surface.triangles[t as usize];
                if names.contains(&ends[0]) && names.contains(&ends[1]) {
                    continue;
                }
                let old = surface.corners(t);
                let corners = std::array::from_fn(|k| if ends.contains(&names[k]) { place } else { old[k] });
                let normal = area_vector(&corners);
                let before = area_vector(&old);
                let (length, length_before) = (normal.length(), before.length());
                // A triangle without area cannot turn; one with area may neither flip nor lose it.
                if normal.dot(before) < MOST_TURN * length * length_before || (length <= 0.0 && length_before > 0.0) {
                    return Err(Refusal::Geometry);
                }
                least = least.min(quality(&corners, length));
                least_before = least_before.min(quality(&old, length_before));
                let names = names.map(|v| if v == ends[1] { ends[0] } else { v });
                let bounds = Bounds::around(&corners);
                self.changed.push(Changed { names, corners, normal, bounds });
            }
        }
        if least < LEAST_QUALITY && least < least_before {
            return Err(Refusal::Geometry);
        }
        self.meets_no_more(surface, ends)
    }

    /// Whether the changed triangles meet no more triangles than before.
    fn meets_no_more(&mut self, surface: &Surface, ends: [u32; 2]) -> Result<(), Refusal> {
        self.stamp += 1;
        for t in surface.star(ends[0]).chain(surface.star(ends[1])) {
            self.triangle_marks[t as usize] = self.stamp;
        }
        let around = self.changed.iter().fold(Bounds::NONE, |b, c| b.join(c.bounds));
        self.near.clear();
        let (marks, stamp, near) = (&self.triangle_marks, self.stamp, &mut self.near);
        let mut looked_at = 0;
        surface.visit(
            |b| b.overlaps(&around),
            |t| {
                looked_at += 1;
                if marks[t as usize] != stamp {
                    near.push(t);
                }
            },
        );
        self.pairs += looked_at;
        let mut met = 0;
        for &t in &self.near {
            let corners = surface.corners(t);
            let bounds = Bounds::around(&corners);
            if !bounds.overlaps(&around) {
                continue;
            }
            let other =
                Changed { names: surface.triangles[t as usize], corners, normal: area_vector(&corners), bounds };
            for changed in self.changed.iter().filter(|changed| changed.bounds.overlaps(&bounds)) {
                self.pairs += 1;
                met += usize::from(crosses(changed, &other));
            }
        }
        for (index, changed) in self.changed.iter().enumerate() {
            for other in &self.changed[..index] {
                self.pairs += 1;
                met += usize::from(crosses(changed, other));
            }
        }
        if met > 0 && met > self.met_before(surface, ends, met) { Err(Refusal::Geometry) } else { Ok(()) }
    }

    /// How many pairs met before, counted up to `enough`.
    fn met_before(&mut self, surface: &Surface, ends: [u32; 2], enough: usize) -> usize {
        let mut star: Vec<u32> = surface.star(ends[0]).chain(surface.star(ends[1])).collect();
        star.sort_unstable();
        star.dedup();
        let facet = |t: u32| Facet::new(surface.triangles[t as usize], surface.corners(t).map(|p| p.to_array()));
        let (met, mut pairs) = (Cell::new(0), 0);
        for (index, &t) in star.iter().enumerate() {
            let (this, bounds) = (facet(t), Bounds::around(&surface.corners(t)));
            let later = &star[index + 1..];
            surface.visit(
                |b| met.get() < enough && b.overlaps(&bounds),
                |other| {
                    pairs += 1;
                    let is_new = star.binary_search(&other).is_err() || later.binary_search(&other).is_ok();
                    if is_new && Bounds::around(&surface.corners(other)).overlaps(&bounds) && meet(&this, &facet(other))
                    {
                        met.set(met.get() + 1);
                    }
                },
            );
        }
        self.pairs += pairs;
        met.get()
    }
}

fn count_of(counts: &[(u32, u32)], vertex: u32) -> u32 {
    counts.iter().find(|(v, _)| *v == vertex).map_or(0, |&(_, count)| count)
}

fn area_vector([a, b, c]: &[DVec3; 3]) -> DVec3 {
    (*b - *a).cross(*c - *a)
}

/// Area over squared edges, 1 for an equilateral triangle and 0 for one without area; `length` is twice the area.
fn quality([a, b, c]: &[DVec3; 3], length: f64) -> f64 {
    let edges = a.distance_squared(*b) + b.distance_squared(*c) + c.distance_squared(*a);
    if edges > 0.0 { 2.0 * 3.0_f64.sqrt() * length / edges } else { 0.0 }
}

fn crosses(a: &Changed, b: &Changed) -> bool {
    if is_beside(a, b) || is_beside(b, a) {
        return false;
    }
    let facet = |c: &Changed| Facet::new(c.names, c.corners.map(|p| p.to_array()));
    meet(&facet(a), &facet(b))
}

/// Whether all corners of `b` that are not corners of `a` are on one side of the plane of `a`, far enough for rounding
/// not to matter. There is at least one unless the two have the same corners, which never counts.
fn is_beside(a: &Changed, b: &Changed) -> bool {
    let reach = (b.bounds.high.max(a.bounds.high) - b.bounds.low.min(a.bounds.low)).max_element();
    let rounding = 1e-14 * reach * reach * reach;
    let mut sides = (true, true);
    for (name, corner) in b.names.iter().zip(&b.corners) {
        if !a.names.contains(name) {
            let height = a.normal.dot(*corner - a.corners[0]);
            sides = (sides.0 && height > rounding, sides.1 && height < -rounding);
        }
    }
    sides.0 || sides.1
}

/// Where the two ends of an edge may become one vertex, and what that costs: the best place first, then, for later
/// attempts, the ends and their midpoint from cheapest to most expensive.
pub(super) fn placement(joined: &Quadric, ends: [DVec3; 2], origin: DVec3, attempt: u8) -> Option<(f64, DVec3)> {
    let [p, q] = ends.map(|end| end - origin);
    let reach = 2.0 * p.distance(q);
    let best = joined.best_place().filter(|x| x.distance(p) <= reach && x.distance(q) <= reach);
    let mut places = [p, q, 0.5 * (p + q)].map(|x| (joined.cost(x), x));
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let place = match (best, attempt) {
        (Some(x), 0) => Some((joined.cost(x), x)),
        (Some(_), k) => places.get(k as usize - 1).copied(),
        (None, k) => places.get(k as usize).copied(),
    };
    place.map(|(cost, x)| (cost, x + origin))
}

/// Whether a vertex at `place` leaves the planes it represents by more than the sheets facing it allow.
pub(super) fn leaves_gap(joined: &Quadric, place: DVec3, origin: DVec3, gap: f64) -> bool {
    joined.distance(place - origin) > SHARE_OF_GAP * gap
}
