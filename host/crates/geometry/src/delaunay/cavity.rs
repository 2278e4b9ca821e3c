//! Inserting a point while some facets must stay: the region that gives way does not reach across them.
//!
//! The triangulation need no longer be Delaunay, so the point may not see all of the region's boundary; whatever blocks
//! its view is taken out of the region again.

use super::region::{BoundaryFacet, Region};
use super::triangulation::{INFINITE, NONE, Triangulation};
use crate::predicates::collinear;

/// Why a point was not inserted; nothing has changed then.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Refusal {
    /// This point is at the same place.
    AtVertex(u32),
    /// The point is on or too close to a facet that must stay.
    NoRoom,
    /// There would be more tetrahedra than allowed.
    Full,
}

impl Triangulation {
    /// Inserts a new point, found by walking from the tetrahedron `start`.
    pub(crate) fn insert_constrained(&mut self, position: [f64; 3], start: u32) -> Result<u32, Refusal> {
        let start = self.locate_from(start, &position).ok_or(Refusal::NoRoom)?;
        if let Some(twin) = self.corner_at(start, &position) {
            return Err(Refusal::AtVertex(twin));
        }
        let mut region = self.lend_region();
        let inserted = self.insert_into(&mut region, position, start);
        self.keep_region(region);
        inserted
    }

    fn insert_into(&mut self, region: &mut Region, position: [f64; 3], start: u32) -> Result<u32, Refusal> {
        self.find_conflicts(start, &position, region);
        if !self.shrink_to_what_is_seen(start, &position, region) {
            return Err(Refusal::NoRoom);
        }
        if !self.has_space_for(region.boundary.len()) {
            return Err(Refusal::Full);
        }
        let point = self.add_point(position);
        self.fan_out(point, region);
        Ok(point)
    }

    /// Removes tetrahedra from the region until the point sees every facet of its boundary from inside, then gathers
    /// that boundary; false if nothing is left.
    fn shrink_to_what_is_seen(&mut self, start: u32, position: &[f64; 3], region: &mut Region) -> bool {
        loop {
            let mut hidden = false;
            for &tet in &region.tets {
                if (0..4).all(|slot| !self.is_boundary(tet, slot) || self.sees(tet, slot, position)) {
                    continue;
                }
                if tet == start {
                    return false;
                }
                self.reject(tet);
                hidden = true;
            }
            if !hidden {
                break;
            }
            self.keep_connected(start, &mut region.tets);
        }
        region.boundary.clear();
        for &inner in &region.tets {
            for slot in 0..4 {
                if self.is_boundary(inner, slot) {
                    if !self.keeps_hull_convex(inner, slot, position) {
                        return false;
                    }
                    region.boundary.push(BoundaryFacet { inner, slot: slot as u8, new: NONE });
                }
            }
        }
        true
    }

    fn is_boundary(&self, tet: u32, slot: usize) -> bool {
        !self.is_selected(self.neighbour(tet, slot)) || self.is_locked(tet, slot)
    }

    fn sees(&self, tet: u32, slot: usize, position: &[f64; 3]) -> bool {
        let at_infinity = self.infinite_slot(tet);
        at_infinity.is_some_and(|infinite| infinite != slot) || self.orientation_with(tet, slot, position) > 0.0
    }

    /// Whether a facet of the boundary that reaches to infinity makes a facet of the hull with the point.
    fn keeps_hull_convex(&self, tet: u32, slot: usize, position: &[f64; 3]) -> bool {
        let outer = self.neighbour(tet, slot);
        let Some(infinite) = self.infinite_slot(outer) else { return true };
        if self.orientation_with(outer, infinite, position) > 0.0 {
            return false;
        }
        let edge: Vec<u32> = (0..4).filter(|&k| k != slot).map(|k| self.corners(tet)[k]).collect();
        let mut ends = edge.iter().filter(|&&corner| corner != INFINITE).map(|&corner| self.point(corner));
        match (ends.next(), ends.next(), ends.next()) {
            (Some(a), Some(b), None) => !collinear(a, b, position),
            _ => true,
        }
    }

    /// Keeps those selected tetrahedra that can be reached from `start` through others.
    fn keep_connected(&mut self, start: u32, tets: &mut Vec<u32>) {
        self.begin_selection();
        tets.clear();
        tets.push(start);
        self.select(start);
        let mut looked_at = 0;
        while looked_at < tets.len() {
            let inner = tets[looked_at];
            looked_at += 1;
            for slot in 0..4 {
                let outer = self.neighbour(inner, slot);
                if self.was_selected(outer) && !self.is_locked(inner, slot) {
                    self.select(outer);
                    tets.push(outer);
                }
            }
        }
    }
}
