//! Walking to the tetrahedron that contains a point.

use super::triangulation::{NONE, Triangulation};

impl Triangulation {
    /// A tetrahedron that contains `position`, boundary included; or one at infinity whose facet `position` is beyond.
    ///
    /// Steps through any facet that has the point strictly behind it, except the one it just came through (Devillers,
    /// Pion, Teillaud 2002). In a Delaunay triangulation with exact signs the walk cannot cycle.
    pub(super) fn locate(&self, position: &[f64; 3]) -> u32 {
        let mut from = NONE;
        let mut tet = match self.infinite_slot(self.last()) {
            Some(slot) => self.neighbour(self.last(), slot),
            None => self.last(),
        };
        while self.infinite_slot(tet).is_none() {
            let across = self.neighbours(tet);
            let behind = |&slot: &usize| across[slot] != from && self.orientation_with(tet, slot, position) < 0.0;
            let Some(slot) = (0..4).find(behind) else { return tet };
            from = tet;
            tet = across[slot];
        }
        tet
    }
}
