//! What surrounds a vertex, an edge or a facet, and what a segment passes through first.

use super::triangulation::{NONE, Triangulation};
use crate::predicates::orientation;

/// What the segment from one vertex to another passes through first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Crossing {
    /// Nothing: the segment is an edge of this tetrahedron.
    Present(u32),
    /// The inside of the facet of this tetrahedron opposite this corner, which is where the segment starts.
    Facet(u32, usize),
    /// An edge of this tetrahedron.
    Edge(u32, [u32; 2]),
    /// This vertex is on the segment.
    Vertex(u32),
    /// The start is not a corner, or the segment leaves the hull.
    Nowhere,
}

impl Triangulation {
    /// The tetrahedra around a vertex, including those at infinity.
    pub(crate) fn star(&mut self, vertex: u32, star: &mut Vec<u32>) {
        star.clear();
        let first = self.tet_at(vertex);
        if first == NONE {
            return;
        }
        self.begin_selection();
        star.push(first);
        self.select(first);
        let mut looked_at = 0;
        while looked_at < star.len() {
            let tet = star[looked_at];
            looked_at += 1;
            for slot in 0..4 {
                let next = self.neighbour(tet, slot);
                if self.corners(tet)[slot] != vertex && !self.is_selected(next) {
                    self.select(next);
                    star.push(next);
                }
            }
        }
    }

    /// A tetrahedron with this edge.
    pub(crate) fn find_edge(&mut self, [a, b]: [u32; 2], star: &mut Vec<u32>) -> Option<u32> {
        self.star(a, star);
        star.iter().copied().find(|&tet| self.corners(tet).contains(&b))
    }

    /// A tetrahedron with this facet and the corner opposite.
    pub(crate) fn find_facet(&mut self, [a, b, c]: [u32; 3], star: &mut Vec<u32>) -> Option<(u32, usize)> {
        self.star(a, star);
        let holds = |&tet: &u32| {
            let corners = self.corners(tet);
            corners.contains(&b) && corners.contains(&c)
        };
        let tet = star.iter().copied().find(holds)?;
        let slot = self.corners(tet).iter().position(|&v| v != a && v != b && v != c)?;
        Some((tet, slot))
    }

    /// What comes first on the way from vertex `a` to vertex `b`.
    pub(crate) fn first_crossing(&mut self, [a, b]: [u32; 2], star: &mut Vec<u32>) -> Crossing {
        if let Some(tet) = self.find_edge([a, b], star) {
            return Crossing::Present(tet);
        }
        let goal = *self.point(b);
        for &tet in star.iter() {
            if self.infinite_slot(tet).is_some() {
                continue;
            }
            let corners = self.corners(tet);
            let Some(apex) = corners.iter().position(|&v| v == a) else { continue };
            let others = || (0..4).filter(|&k| k != apex);
            let signs: Vec<(usize, f64)> = others().map(|k| (k, self.orientation_with(tet, k, &goal))).collect();
            if signs.iter().any(|&(_, sign)| sign < 0.0) {
                continue;
            }
            let ahead: Vec<u32> = signs.iter().filter(|s| s.1 > 0.0).map(|s| corners[s.0]).collect();
            return match *ahead.as_slice() {
                [v] => Crossing::Vertex(v),
                [p, q] => Crossing::Edge(tet, [p, q]),
                _ => Crossing::Facet(tet, apex),
            };
        }
        Crossing::Nowhere
    }

    /// A tetrahedron that contains `position`, or one at infinity if it is outside the hull, in any triangulation.
    pub(crate) fn locate_from(&self, start: u32, position: &[f64; 3]) -> Option<u32> {
        let start = if start != NONE && self.is_alive(start) { start } else { self.last() };
        let mut tet = match self.infinite_slot(start) {
            Some(slot) => self.neighbour(start, slot),
            None => start,
        };
        let mut from = NONE;
        // Without the Delaunay property a walk may cycle; rotating the order of trials ends that.
        let mut turn = 0x9e37_79b9_u32;
        for _ in 0..self.slots() {
            if self.infinite_slot(tet).is_some() {
                return Some(tet);
            }
            turn = turn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let across = self.neighbours(tet);
            let behind = |&slot: &usize| across[slot] != from && self.orientation_with(tet, slot, position) < 0.0;
            let first = (turn >> 30) as usize;
            let Some(slot) = (0..4).map(|k| (first + k) % 4).find(behind) else { return Some(tet) };
            from = tet;
            tet = across[slot];
        }
        None
    }

    /// The tetrahedron around the edge `ends` whose wedge contains `goal`, and its two other corners; `None` if there
    /// already is a facet towards `goal`.
    pub(crate) fn wedge_towards(&self, tet: u32, ends: [u32; 2], goal: u32) -> Option<(u32, [u32; 2])> {
        let (vertices, tets) = self.ring(tet, ends)?;
        if vertices.contains(&goal) {
            return None;
        }
        let at = |v: u32| self.point(v);
        let [u, v] = ends;
        for (index, &tet) in tets.iter().enumerate() {
            let (r, s) = (vertices[index], vertices[(index + 1) % vertices.len()]);
            if self.infinite_slot(tet).is_none()
                && orientation(at(u), at(v), at(r), at(goal)) > 0.0
                && orientation(at(u), at(v), at(goal), at(s)) > 0.0
            {
                return Some((tet, [r, s]));
            }
        }
        None
    }
}
