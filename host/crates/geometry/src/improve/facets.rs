//! Which tetrahedra meet at which facets.

use super::error::ImproveError;
use crate::facets::{Side, sorted, sorted_sides};

/// No tetrahedron: beyond a facet of the boundary.
pub(super) const NONE: u32 = u32::MAX;

/// All facets of all tetrahedra.
pub(super) struct Facets(Vec<Side>);

impl Facets {
    pub(super) fn gather(tetrahedra: &[[u32; 4]]) -> Self {
        Self(sorted_sides(tetrahedra))
    }

    /// For each tetrahedron, what is across the facet opposite each corner. More than two tetrahedra at a facet, or two
    /// on the same side of it, are errors.
    pub(super) fn neighbours(&self, tetrahedron_count: usize) -> Result<Vec<[u32; 4]>, ImproveError> {
        let mut neighbours = vec![[NONE; 4]; tetrahedron_count];
        for group in self.0.chunk_by(|x, y| x.corners == y.corners) {
            let facet = group[0].corners;
            match group {
                [_] => {}
                [s, t] if s.odd != t.odd => {
                    neighbours[s.tetrahedron as usize][s.opposite as usize] = t.tetrahedron;
                    neighbours[t.tetrahedron as usize][t.opposite as usize] = s.tetrahedron;
                }
                [_, _] => return Err(ImproveError::SameSide { facet }),
                _ => return Err(ImproveError::CrowdedFacet { facet, tetrahedra: group.len() }),
            }
        }
        Ok(neighbours)
    }

    /// The sides of a facet, its corners in any order.
    pub(super) fn sides(&self, corners: [u32; 3]) -> &[Side] {
        let (corners, _) = sorted(corners);
        let first = self.0.partition_point(|side| side.corners < corners);
        let count = self.0[first..].iter().take_while(|side| side.corners == corners).count();
        &self.0[first..first + count]
    }
}
