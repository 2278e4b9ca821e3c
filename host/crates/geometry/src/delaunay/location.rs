//! Walking to the tetrahedron that holds a point.

use super::insertion::{NONE, Triangulation};

impl Triangulation {
    /// A tetrahedron that holds `position`, on its boundary counts; or one at infinity whose facet it lies beyond.
    ///
    /// Steps through any facet that has the point strictly behind it, except the one just come through (Devillers,
    /// Pion, Teillaud 2002). In a Delaunay triangulation with exact signs the walk cannot go round in circles.
    pub(super) fn locate(&self, position: &[f64; 3]) -> u32 {
        let mut from = NONE;
        let mut tet = match self.infinite_slot(self.last) {
            Some(slot) => self.neighbours[self.last as usize][slot],
            None => self.last,
        };
        while self.infinite_slot(tet).is_none() {
            let across = self.neighbours[tet as usize];
            let behind = |&slot: &usize| across[slot] != from && self.orientation_with(tet, slot, position) < 0.0;
            let Some(slot) = (0..4).find(behind) else { return tet };
            from = tet;
            tet = across[slot];
        }
        tet
    }
}
