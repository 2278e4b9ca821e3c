//! Boundary recovery: makes the facets of a surface facets of the tetrahedra (thesis 8.5).
//!
//! First by flips, which leave the surface whole; then, where flips are stuck, by new points on it. Two facets that
//! cross get a point at their crossing. Facets that are still missing then are given up and reported.

use std::ops::ControlFlow;

use glam::DVec3;

use super::constraints::{Constraints, State};
use crate::delaunay::{Crossing, Refusal, Triangulation};

/// Flips tried for one edge or facet.
const MOST_FLIPS: usize = 40;
/// How often a facet is cut before it is given up; parts of the fifth generation are some six times shorter.
const DEEPEST: u8 = 5;
/// Coordinates closer to zero than exact signs allow are set to zero.
const SMALLEST: f64 = f64::from_bits((1023 - 162) << 52);
const REPORT_EVERY: usize = 2048;

/// What blocks an edge or a facet.
enum Obstacle {
    /// No flip worked; a new point here, on the edge or inside the triangle, would help.
    Stuck,
    /// This vertex is on the edge.
    Vertex(u32),
    /// Another required facet crosses the edge.
    CrossesFacet([u32; 3]),
    /// Another required edge crosses the edge or the triangle.
    CrossesEdge([u32; 2]),
    /// Nothing can be done.
    Hopeless,
}

impl Obstacle {
    fn is_a_crossing(&self) -> bool {
        matches!(self, Self::CrossesFacet(_) | Self::CrossesEdge(_))
    }
}

/// The effort spent on missing facets.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Most new points.
    pub(super) most_points: usize,
    /// Whether facets that cross are split at the crossing; otherwise the second of them is given up.
    pub(super) cut_crossings: bool,
}

/// Recovers as much as possible. The locked facets are then those that are present.
pub(super) fn recover(
    triangulation: &mut Triangulation,
    constraints: &mut Constraints,
    effort: Effort,
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> ControlFlow<()> {
    triangulation.track();
    let first_new = triangulation.points().len();
    let mut work = Recovery { triangulation, constraints, star: Vec::new(), first_new };
    let mut open: Vec<u32> = Vec::new();
    let count = work.constraints.triangles.len();
    for triangle in 0..count as u32 {
        if (triangle as usize).is_multiple_of(REPORT_EVERY) {
            progress(0.5 * f64::from(triangle) / count as f64)?;
        }
        if !work.lock_if_present(triangle) {
            open.push(triangle);
        }
    }
    let mut stuck = Vec::new();
    for (index, &triangle) in open.iter().enumerate() {
        if index.is_multiple_of(REPORT_EVERY) {
            progress(0.5 + 0.25 * index as f64 / open.len() as f64)?;
        }
        if work.by_flips(triangle).is_err() {
            stuck.push(triangle);
        }
    }
    work.by_points(stuck, effort, progress)?;
    let constraints = &*work.constraints;
    work.triangulation.restore_delaunay(|a, b| constraints.needs_edge(a, b));
    ControlFlow::Continue(())
}

struct Recovery<'a> {
    triangulation: &'a mut Triangulation,
    constraints: &'a mut Constraints,
    star: Vec<u32>,
    /// Points from here on are new ones on the surface.
    first_new: usize,
}

impl Recovery<'_> {
    fn lock_if_present(&mut self, triangle: u32) -> bool {
        let corners = self.constraints.triangles[triangle as usize];
        let Some((tet, slot)) = self.triangulation.find_facet(corners, &mut self.star) else { return false };
        self.triangulation.set_locked(tet, slot, true);
        self.constraints.state[triangle as usize] = State::Locked;
        true
    }

    /// Recovers the edges of a triangle, then itself; on failure returns the edge where it got stuck, or `None` for the
    /// inside.
    fn by_flips(&mut self, triangle: u32) -> Result<(), (Option<[u32; 2]>, Obstacle)> {
        let [a, b, c] = self.constraints.triangles[triangle as usize];
        for edge in [[a, b], [b, c], [c, a]] {
            self.edge_by_flips(edge).map_err(|obstacle| (Some(edge), obstacle))?;
        }
        self.facet_by_flips([a, b, c]).map_err(|obstacle| (None, obstacle))?;
        if self.lock_if_present(triangle) { Ok(()) } else { Err((None, Obstacle::Hopeless)) }
    }

    fn edge_by_flips(&mut self, [a, b]: [u32; 2]) -> Result<(), Obstacle> {
        let mut from_other_end = false;
        for _ in 0..MOST_FLIPS {
            let way = if from_other_end { [b, a] } else { [a, b] };
            let done = match self.triangulation.first_crossing(way, &mut self.star) {
                Crossing::Present(_) => return Ok(()),
                Crossing::Nowhere => return Err(Obstacle::Hopeless),
                Crossing::Vertex(v) => return Err(Obstacle::Vertex(v)),
                Crossing::Edge(tet, edge) => {
                    if self.constraints.needs_edge(edge[0], edge[1]) {
                        return Err(Obstacle::CrossesEdge(edge));
                    }
                    self.triangulation.remove_edge(tet, edge, &[])
                }
                Crossing::Facet(tet, slot) => {
                    if self.triangulation.is_locked(tet, slot) {
                        return Err(Obstacle::CrossesFacet(self.facet(tet, slot)));
                    }
                    self.triangulation.flip_facet(tet, slot) || self.remove_reflex_edge(tet, slot)
                }
            };
            if !done {
                if from_other_end {
                    return Err(Obstacle::Stuck);
                }
                from_other_end = true;
            }
        }
        Err(Obstacle::Stuck)
    }

    /// Removes an edge of a facet at which it and the tetrahedra on its two sides turn inwards.
    fn remove_reflex_edge(&mut self, tet: u32, slot: usize) -> bool {
        let apex = self.triangulation.apex_across(tet, slot);
        let Some(&position) = self.triangulation.points().get(apex as usize) else { return false };
        let corners = self.triangulation.corners(tet);
        for k in (0..4).filter(|&k| k != slot) {
            if self.triangulation.orientation_with(tet, k, &position) > 0.0 {
                continue;
            }
            let ends: Vec<u32> = (0..4).filter(|&j| j != slot && j != k).map(|j| corners[j]).collect();
            if !self.constraints.needs_edge(ends[0], ends[1])
                && self.triangulation.remove_edge(tet, [ends[0], ends[1]], &[])
            {
                return true;
            }
        }
        false
    }

    fn facet_by_flips(&mut self, [a, b, c]: [u32; 3]) -> Result<(), Obstacle> {
        for _ in 0..MOST_FLIPS {
            let Some((tet, edge)) = self.piercing_edge([a, b, c]) else { return Ok(()) };
            if self.constraints.needs_edge(edge[0], edge[1]) {
                return Err(Obstacle::CrossesEdge(edge));
            }
            if !self.triangulation.remove_edge(tet, edge, &[a, b, c]) && !self.triangulation.remove_edge(tet, edge, &[])
            {
                return Err(Obstacle::Stuck);
            }
        }
        Err(Obstacle::Stuck)
    }

    /// An edge that passes through the inside of a triangle whose edges are present.
    fn piercing_edge(&mut self, [a, b, c]: [u32; 3]) -> Option<(u32, [u32; 2])> {
        let tet = self.triangulation.find_edge([a, b], &mut self.star)?;
        self.triangulation.wedge_towards(tet, [a, b], c)
    }

    fn facet(&self, tet: u32, slot: usize) -> [u32; 3] {
        let corners = self.triangulation.corners(tet);
        [corners[(slot + 1) % 4], corners[(slot + 2) % 4], corners[(slot + 3) % 4]]
    }

    fn by_points(
        &mut self,
        mut open: Vec<u32>,
        effort: Effort,
        progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        open.reverse();
        let mut steps = 0_usize;
        while let Some(triangle) = open.pop() {
            steps += 1;
            if steps.is_multiple_of(REPORT_EVERY) {
                progress(0.75 + 0.25 * steps as f64 / (steps + open.len()) as f64)?;
            }
            if self.constraints.state[triangle as usize] != State::Missing {
                continue;
            }
            let Err((edge, obstacle)) = self.by_flips(triangle) else { continue };
            let used = self.triangulation.points().len() - self.first_new;
            let may_cut = used < effort.most_points
                && self.constraints.depth[triangle as usize] < DEEPEST
                && (effort.cut_crossings || !obstacle.is_a_crossing());
            if !may_cut || !self.cut(triangle, edge, &obstacle, &mut open) {
                self.constraints.state[triangle as usize] = State::GivenUp;
            }
        }
        ControlFlow::Continue(())
    }

    /// Splits a triangle, with everything that shares the place, where something blocks it.
    fn cut(&mut self, triangle: u32, edge: Option<[u32; 2]>, obstacle: &Obstacle, open: &mut Vec<u32>) -> bool {
        let corners = self.constraints.triangles[triangle as usize];
        let position = match (edge, obstacle) {
            (_, Obstacle::Hopeless) => return false,
            (Some(edge), &Obstacle::Vertex(v)) => {
                self.split_edge(edge, v, open);
                return true;
            }
            (Some(edge), Obstacle::Stuck) => self.point_on_edge(edge),
            (Some(edge), &Obstacle::CrossesFacet(facet)) => self.crossing(edge, facet),
            (Some(edge), &Obstacle::CrossesEdge(other)) => self.nearest_on(edge, other),
            (None, &Obstacle::CrossesEdge(other)) => self.crossing(other, corners),
            (None, _) => match self.piercing_edge(corners) {
                Some((_, other)) => self.crossing(other, corners),
                None => None,
            },
        };
        let Some(position) = position else { return false };
        let position = position.to_array().map(|c| if c.abs() < SMALLEST { 0.0 } else { c });
        // A facet that the new point will split must let it in.
        let cut_facets = match *obstacle {
            Obstacle::CrossesFacet(facet) => self.constraints.find(facet).into_iter().collect(),
            Obstacle::CrossesEdge([a, b]) => self.constraints.around(a, b),
            _ => Vec::new(),
        };
        for &facet in &cut_facets {
            self.unlock(facet);
        }
        let start = self.triangulation.tet_at(corners[0]);
        let vertex = match self.triangulation.insert_constrained(position, start) {
            Ok(vertex) => vertex,
            Err(Refusal::AtVertex(vertex)) if !corners.contains(&vertex) => vertex,
            Err(_) => {
                for &facet in &cut_facets {
                    if !self.lock_if_present(facet) {
                        open.push(facet);
                    }
                }
                return false;
            }
        };
        match *obstacle {
            Obstacle::CrossesFacet(facet) => {
                if let Some(other) = self.constraints.find(facet) {
                    self.constraints.split_triangle(other, vertex, open);
                }
            }
            Obstacle::CrossesEdge(other) => self.split_edge(other, vertex, open),
            _ => {}
        }
        match edge {
            Some(edge) => self.split_edge(edge, vertex, open),
            None => self.constraints.split_triangle(triangle, vertex, open),
        }
        true
    }

    fn split_edge(&mut self, edge: [u32; 2], vertex: u32, open: &mut Vec<u32>) {
        for triangle in self.constraints.around(edge[0], edge[1]) {
            self.unlock(triangle);
        }
        self.constraints.split_edge(edge, vertex, open);
    }

    fn unlock(&mut self, triangle: u32) {
        if self.constraints.state[triangle as usize] == State::Locked {
            let corners = self.constraints.triangles[triangle as usize];
            if let Some((tet, slot)) = self.triangulation.find_facet(corners, &mut self.star) {
                self.triangulation.set_locked(tet, slot, false);
            }
            self.constraints.state[triangle as usize] = State::Missing;
        }
    }

    fn at(&self, vertex: u32) -> DVec3 {
        DVec3::from(*self.triangulation.point(vertex))
    }

    /// Near the middle. The distance from a given vertex is a power of two, so that edges that meet at a small angle
    /// are split alike and do not split each other further (Ruppert 1995).
    fn point_on_edge(&self, [a, b]: [u32; 2]) -> Option<DVec3> {
        let (a, b) = if (b as usize) < self.first_new && a as usize >= self.first_new { (b, a) } else { (a, b) };
        let (from, to) = (self.at(a), self.at(b));
        let length = from.distance(to);
        let share = if (a as usize) < self.first_new {
            // A power of two between a third and two thirds of the length.
            libm::exp2(libm::floor(libm::log2(length * 2.0 / 3.0))) / length
        } else {
            0.5
        };
        let point = from + (to - from) * share;
        point.is_finite().then_some(point)
    }

    /// Where an edge passes through the plane of a facet.
    fn crossing(&self, [a, b]: [u32; 2], facet: [u32; 3]) -> Option<DVec3> {
        let [p, q, r] = facet.map(|v| self.at(v));
        let (a, b) = (self.at(a), self.at(b));
        let normal = (q - p).cross(r - p).try_normalize()?;
        let (before, behind) = ((a - p).dot(normal), (b - p).dot(normal));
        let share = (before / (before - behind)).clamp(0.0, 1.0);
        let point = a + (b - a) * share;
        point.is_finite().then_some(point)
    }

    /// The point of the first edge nearest to the second.
    fn nearest_on(&self, [a, b]: [u32; 2], [c, d]: [u32; 2]) -> Option<DVec3> {
        let (a, b, c, d) = (self.at(a), self.at(b), self.at(c), self.at(d));
        let (along, other, between) = (b - a, d - c, a - c);
        let (aa, ab, bb) = (along.length_squared(), along.dot(other), other.length_squared());
        let share = (ab * between.dot(other) - bb * between.dot(along)) / (aa * bb - ab * ab);
        let point = a + along * share.clamp(0.0, 1.0);
        point.is_finite().then_some(point)
    }
}
