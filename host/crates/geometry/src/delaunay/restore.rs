//! Restores the Delaunay property around changes, as far as locked facets and kept edges allow flips (Lawson 1977).

use super::triangulation::Triangulation;
use crate::predicates::in_sphere;

impl Triangulation {
    /// Flips facets that are not locked and have the vertex across inside their sphere, around all tetrahedra made
    /// since [`Triangulation::track`], until no such flip is possible. Each flip lowers the lifted triangulation, so
    /// this terminates. Edges for which `keeps` is true stay. Returns how many facets remain that should have been
    /// flipped.
    pub(crate) fn restore_delaunay(&mut self, keeps: impl Fn(u32, u32) -> bool) -> usize {
        let mut stuck = Vec::new();
        let mut left = 0;
        while let Some(tet) = self.next_changed() {
            if !self.is_alive(tet) || self.infinite_slot(tet).is_some() {
                continue;
            }
            for slot in 0..4 {
                if !self.is_alive(tet) || !self.violates(tet, slot) {
                    continue;
                }
                if self.flip_facet(tet, slot) || self.flip_reflex_edge(tet, slot, &keeps) {
                    break;
                }
                stuck.push((tet, slot, self.corners(tet)));
            }
        }
        // Later flips may have freed, or removed, what was stuck.
        for (tet, slot, corners) in stuck {
            left += usize::from(self.corners(tet) == corners && self.violates(tet, slot));
        }
        left
    }

    /// Whether a facet between two finite tetrahedra is neither locked nor locally Delaunay.
    pub(crate) fn violates(&self, tet: u32, slot: usize) -> bool {
        let other = self.neighbour(tet, slot);
        if self.is_locked(tet, slot) || self.infinite_slot(tet).is_some() || self.infinite_slot(other).is_some() {
            return false;
        }
        let apex = self.apex_across(tet, slot);
        let [a, b, c, d] = self.corners(tet).map(|corner| self.point(corner));
        in_sphere(a, b, c, d, self.point(apex)) > 0.0
    }

    fn flip_reflex_edge(&mut self, tet: u32, slot: usize, keeps: &impl Fn(u32, u32) -> bool) -> bool {
        let apex = self.apex_across(tet, slot);
        let position = *self.point(apex);
        let corners = self.corners(tet);
        (0..4).filter(|&k| k != slot).any(|k| {
            if self.orientation_with(tet, k, &position) >= 0.0 {
                return false;
            }
            let ends: Vec<u32> = (0..4).filter(|&j| j != slot && j != k).map(|j| corners[j]).collect();
            let is_ring_of_three = self.ring(tet, [ends[0], ends[1]]).is_some_and(|(ring, _)| ring.len() == 3);
            is_ring_of_three && !keeps(ends[0], ends[1]) && self.remove_edge(tet, [ends[0], ends[1]], &[])
        })
    }
}
