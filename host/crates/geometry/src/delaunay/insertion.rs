//! Inserting a point: the tetrahedra whose spheres contain it give way to a fan around it (Bowyer 1981, Watson 1981).
//!
//! The triangulation covers all of space: each facet of the hull carries a tetrahedron to a point at infinity. A
//! tetrahedron is in conflict with a point that lies *strictly* inside its sphere; one at infinity, if the point lies
//! beyond the facet, or in the facet's plane and strictly inside its circle. With exact signs, the point then sees the
//! facets around the conflicting region strictly from inside: no flat tetrahedron can arise, however many points lie on
//! one sphere, and no perturbation is needed. (If the point lay in the plane of such a facet, it would lie inside the
//! facet's circle, hence inside the spheres on both sides.)

use super::region::{BoundaryFacet, Region};
use super::triangulation::{INFINITE, NONE, Triangulation};
use crate::predicates::{in_sphere, same_place};

/// The result of inserting a point.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Inserted {
    /// It is a corner now.
    Yes,
    /// An earlier point, this one, is at the same place.
    DuplicateOf(u32),
    /// There would be more tetrahedra than allowed; nothing was changed.
    Full,
}

impl Triangulation {
    /// Makes a point a corner.
    pub(crate) fn insert(&mut self, point: u32) -> Inserted {
        let position = *self.point(point);
        let start = self.locate(&position);
        if let Some(twin) = self.corner_at(start, &position) {
            return Inserted::DuplicateOf(twin);
        }
        let mut region = self.lend_region();
        self.find_conflicts(start, &position, &mut region);
        let fits = self.has_space_for(region.boundary.len());
        if fits {
            self.fan_out(point, &mut region);
        }
        self.keep_region(region);
        if fits { Inserted::Yes } else { Inserted::Full }
    }

    /// The corner of a tetrahedron that is at `position`, if one is.
    pub(super) fn corner_at(&self, tet: u32, position: &[f64; 3]) -> Option<u32> {
        let mut finite = self.corners(tet).into_iter().filter(|&corner| corner != INFINITE);
        finite.find(|&corner| same_place(self.point(corner), position))
    }

    /// Selects the tetrahedra in conflict with `position`, found from the one that contains it, up to locked facets.
    pub(super) fn find_conflicts(&mut self, start: u32, position: &[f64; 3], region: &mut Region) {
        self.begin_selection();
        region.tets.clear();
        region.boundary.clear();
        region.tets.push(start);
        self.select(start);
        let mut looked_at = 0;
        while looked_at < region.tets.len() {
            let inner = region.tets[looked_at];
            looked_at += 1;
            for slot in 0..4 {
                let outer = self.neighbour(inner, slot);
                if !self.is_locked(inner, slot) && !self.is_decided(outer) {
                    if self.in_conflict(outer, position) {
                        self.select(outer);
                        region.tets.push(outer);
                    } else {
                        self.reject(outer);
                    }
                }
                if !self.is_selected(outer) {
                    region.boundary.push(BoundaryFacet { inner, slot: slot as u8, new: NONE });
                }
            }
        }
    }

    fn in_conflict(&self, tet: u32, position: &[f64; 3]) -> bool {
        let Some(slot) = self.infinite_slot(tet) else { return self.sphere_holds(tet, position) };
        let beyond = self.orientation_with(tet, slot, position);
        // In the plane of the facet, its circle is where the plane cuts the sphere of the tetrahedron behind it.
        beyond > 0.0 || beyond == 0.0 && self.sphere_holds(self.neighbour(tet, slot), position)
    }

    fn sphere_holds(&self, tet: u32, position: &[f64; 3]) -> bool {
        let [a, b, c, d] = self.corners(tet).map(|corner| self.point(corner));
        in_sphere(a, b, c, d, position) > 0.0
    }

    /// Replaces the tetrahedra of a region, which are the selected ones, by a fan around the point.
    pub(super) fn fan_out(&mut self, point: u32, region: &mut Region) {
        self.fill(point, &mut region.boundary);
        self.stitch(&region.boundary);
        region.tets.iter().for_each(|&tet| self.retire(tet));
    }

    /// Makes a new tetrahedron from each facet of the boundary to the point, linked to its neighbour outside.
    fn fill(&mut self, point: u32, boundary: &mut [BoundaryFacet]) {
        for BoundaryFacet { inner, slot, new } in boundary {
            let (inner, slot) = (*inner, *slot as usize);
            let outer = self.neighbour(inner, slot);
            let mut corners = self.corners(inner);
            corners[slot] = point;
            let mut neighbours = [NONE; 4];
            neighbours[slot] = outer;
            let locked = self.is_locked(inner, slot);
            *new = self.put(corners, neighbours);
            if locked {
                self.lock_new_side(*new, slot);
            }
            self.relink(outer, inner, *new);
            // From now on the link out of the region leads to the new tetrahedron.
            self.link(inner, slot, *new);
        }
    }

    /// Links the new tetrahedra with each other: two are neighbours if their facets of the boundary share an edge,
    /// which turning around that edge through the old tetrahedra finds.
    fn stitch(&mut self, boundary: &[BoundaryFacet]) {
        for &BoundaryFacet { inner, slot, new } in boundary {
            for side in (0..4).filter(|&side| side != slot as usize) {
                if self.neighbour(new, side) != NONE {
                    continue;
                }
                let (mut at, mut behind, mut ahead) = (inner, slot as usize, side);
                let mut next = self.neighbour(at, ahead);
                while self.is_selected(next) {
                    let hinge = self.corners(at)[behind];
                    behind = self.across(at, ahead).1;
                    ahead = self.slot_of(next, hinge);
                    at = next;
                    next = self.neighbour(at, ahead);
                }
                self.link(new, side, next);
                self.link(next, behind, new);
            }
        }
    }
}
