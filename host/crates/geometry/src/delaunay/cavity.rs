//! One point more where some facets have to stay: the region that gives way does not reach across them.
//!
//! The triangulation need not be Delaunay any more, so that the region may lack a clear view of all of its boundary;
//! what hides some of it is taken out of the region again.

use super::insertion::{BoundaryFacet, NONE, Triangulation};
use crate::predicates::{collinear, same_place};

/// Why a point was not inserted; nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// This point lies at the same place.
    AtVertex(u32),
    /// The point lies on or too near a facet that has to stay.
    NoRoom,
    /// There would be more tetrahedra than allowed.
    Full,
}

impl Triangulation {
    /// Begins to keep a tetrahedron for every point, and to allow locked facets.
    pub(crate) fn track(&mut self) {
        self.locked = vec![0; self.corners.len()];
        self.tet_of = vec![NONE; self.points.len()];
        for tet in 0..self.corners.len() as u32 {
            if self.is_alive(tet) {
                for corner in self.corners[tet as usize] {
                    if let Some(entry) = self.tet_of.get_mut(corner as usize) {
                        *entry = tet;
                    }
                }
            }
        }
    }

    /// A tetrahedron at a point; [`NONE`] for a point that is no corner.
    pub(crate) fn tet_at(&self, point: u32) -> u32 {
        self.tet_of.get(point as usize).copied().unwrap_or(NONE)
    }

    /// Locks or unlocks a facet, on both of its sides.
    pub(crate) fn set_locked(&mut self, tet: u32, slot: usize, lock: bool) {
        let other = self.neighbours[tet as usize][slot];
        let back = super::insertion::position_of(&self.neighbours[other as usize], tet);
        for (tet, slot) in [(tet, slot), (other, back)] {
            let bits = &mut self.locked[tet as usize];
            *bits = if lock { *bits | 1 << slot } else { *bits & !(1 << slot) };
        }
    }

    /// A new point, found by walking from the tetrahedron `start`.
    pub(crate) fn insert_constrained(&mut self, position: [f64; 3], start: u32) -> Result<u32, Refusal> {
        let start = self.locate_from(start, &position).ok_or(Refusal::NoRoom)?;
        let twin = |&&corner: &&u32| self.points.get(corner as usize).is_some_and(|p| same_place(p, &position));
        if let Some(&twin) = self.corners[start as usize].iter().find(twin) {
            return Err(Refusal::AtVertex(twin));
        }
        self.find_conflicts(start, &position);
        if !self.shrink_to_what_is_seen(start, &position) {
            return Err(Refusal::NoRoom);
        }
        if self.corners.len() + self.boundary.len() > self.most {
            return Err(Refusal::Full);
        }
        let point = self.points.len() as u32;
        self.points.push(position);
        self.tet_of.push(NONE);
        self.fan_out(point);
        Ok(point)
    }

    /// Takes tetrahedra out of the conflicts until the point sees every facet of their boundary from inside, then
    /// gathers that boundary; false if nothing is left.
    fn shrink_to_what_is_seen(&mut self, start: u32, position: &[f64; 3]) -> bool {
        loop {
            let mut hidden = false;
            for index in 0..self.conflicts.len() {
                let tet = self.conflicts[index];
                if (0..4).all(|slot| !self.is_boundary(tet, slot) || self.sees(tet, slot, position)) {
                    continue;
                }
                if tet == start {
                    return false;
                }
                self.mark[tet as usize] = self.stamp + 1;
                hidden = true;
            }
            if !hidden {
                break;
            }
            self.keep_connected(start);
        }
        self.boundary.clear();
        for index in 0..self.conflicts.len() {
            let inner = self.conflicts[index];
            for slot in 0..4 {
                if self.is_boundary(inner, slot) {
                    if !self.keeps_hull_convex(inner, slot, position) {
                        return false;
                    }
                    self.boundary.push(BoundaryFacet { inner, slot: slot as u8, new: NONE });
                }
            }
        }
        true
    }

    fn is_boundary(&self, tet: u32, slot: usize) -> bool {
        self.mark[self.neighbours[tet as usize][slot] as usize] != self.stamp || self.is_locked(tet, slot)
    }

    fn sees(&self, tet: u32, slot: usize, position: &[f64; 3]) -> bool {
        let at_infinity = self.infinite_slot(tet);
        at_infinity.is_some_and(|infinite| infinite != slot) || self.orientation_with(tet, slot, position) > 0.0
    }

    /// Whether a facet of the boundary that reaches to infinity makes a facet of the hull with the point.
    fn keeps_hull_convex(&self, tet: u32, slot: usize, position: &[f64; 3]) -> bool {
        let outer = self.neighbours[tet as usize][slot];
        let Some(infinite) = self.infinite_slot(outer) else { return true };
        if self.orientation_with(outer, infinite, position) > 0.0 {
            return false;
        }
        let edge: Vec<u32> = (0..4).filter(|&k| k != slot).map(|k| self.corners[tet as usize][k]).collect();
        let mut ends = edge.iter().filter_map(|&corner| self.points.get(corner as usize));
        match (ends.next(), ends.next(), ends.next()) {
            (Some(a), Some(b), None) => !collinear(a, b, position),
            _ => true,
        }
    }

    /// Keeps of the conflicts what can be reached from `start` through themselves.
    fn keep_connected(&mut self, start: u32) {
        let before = self.stamp;
        self.stamp += 2;
        self.conflicts.clear();
        self.conflicts.push(start);
        self.mark[start as usize] = self.stamp;
        let mut looked_at = 0;
        while looked_at < self.conflicts.len() {
            let inner = self.conflicts[looked_at];
            looked_at += 1;
            for slot in 0..4 {
                let outer = self.neighbours[inner as usize][slot];
                if self.mark[outer as usize] == before && !self.is_locked(inner, slot) {
                    self.mark[outer as usize] = self.stamp;
                    self.conflicts.push(outer);
                }
            }
        }
    }
}
