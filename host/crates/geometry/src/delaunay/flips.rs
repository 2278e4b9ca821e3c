//! Different tetrahedra in the same place: flips, and removing an edge.

use super::triangulation::{INFINITE, NONE, Triangulation};
use crate::facets::{facet, sorted};
use crate::predicates::orientation;

/// Edges with more tetrahedra around them are not removed.
const LARGEST_RING: usize = 12;

impl Triangulation {
    /// Replaces the two tetrahedra that share the facet of `tet` opposite its corner `slot` by three around a new edge.
    /// False, with nothing changed, if the new edge would not pass through the facet, the facet is locked or the hull
    /// is touched.
    pub(crate) fn flip_facet(&mut self, tet: u32, slot: usize) -> bool {
        let other = self.neighbour(tet, slot);
        if self.is_locked(tet, slot) || self.infinite_slot(tet).is_some() || self.infinite_slot(other).is_some() {
            return false;
        }
        let apex = self.apex_across(tet, slot);
        let position = *self.point(apex);
        let others = || (0..4).filter(|&k| k != slot);
        if others().any(|k| self.orientation_with(tet, k, &position) <= 0.0) {
            return false;
        }
        let corners = self.corners(tet);
        let new: Vec<[u32; 4]> = others()
            .map(|k| {
                let mut with_apex = corners;
                with_apex[k] = apex;
                with_apex
            })
            .collect();
        self.replace(&[tet, other], &new);
        true
    }

    /// Replaces the tetrahedra around the edge `ends` of `tet` by two for each triangle of a triangulation of the ring
    /// around it, one that has the edge or triangle `wanted` (two or three of the ring's vertices, or none). False,
    /// with nothing changed, if none gives only positive tetrahedra, or if a locked facet or the hull is in the way.
    pub(crate) fn remove_edge(&mut self, tet: u32, ends: [u32; 2], wanted: &[u32]) -> bool {
        let Some((vertices, tets)) = self.ring(tet, ends) else { return false };
        if vertices.len() > LARGEST_RING || vertices.contains(&INFINITE) {
            return false;
        }
        let spoke_locked = tets.iter().any(|&t| {
            let corners = self.corners(t);
            (0..4).any(|slot| !ends.contains(&corners[slot]) && self.is_locked(t, slot))
        });
        if spoke_locked {
            return false;
        }
        let Some(triangles) = self.triangulate_ring(&vertices, ends, wanted) else { return false };
        let new: Vec<[u32; 4]> =
            triangles.iter().flat_map(|&[a, b, c]| [[a, b, c, ends[1]], [a, c, b, ends[0]]]).collect();
        self.replace(&tets, &new);
        true
    }

    /// The vertices around an edge `u v`, such that each `u v rᵢ rᵢ₊₁` is one of the positive tetrahedra returned with
    /// them; `None` if the edge is not one of `tet`'s.
    pub(crate) fn ring(&self, tet: u32, [u, v]: [u32; 2]) -> Option<(Vec<u32>, Vec<u32>)> {
        let (mut vertices, mut tets) = (Vec::new(), Vec::new());
        let mut at = tet;
        let corners = self.corners(at);
        let rest: Vec<u32> = corners.into_iter().filter(|&c| c != u && c != v).collect();
        let &[x, y] = rest.as_slice() else { return None };
        let (mut behind, mut ahead) = if is_even(corners, [u, v, x, y]) { (x, y) } else { (y, x) };
        loop {
            vertices.push(behind);
            tets.push(at);
            let slot = self.corners(at).iter().position(|&c| c == behind)?;
            let next = self.neighbour(at, slot);
            let new = self.apex_across(at, slot);
            (at, behind, ahead) = (next, ahead, new);
            if at == tet {
                return Some((vertices, tets));
            }
            if tets.len() > 4 * LARGEST_RING && vertices.len() > self.slots() as usize {
                return None;
            }
        }
    }

    fn triangulate_ring(&self, ring: &[u32], ends: [u32; 2], wanted: &[u32]) -> Option<Vec<[u32; 3]>> {
        let mut corners: Vec<usize> = Vec::new();
        for w in wanted {
            corners.push(ring.iter().position(|r| r == w)?);
        }
        corners.sort_unstable();
        let mut triangles = Vec::new();
        if let &[a, b, c] = corners.as_slice() {
            let triangle = [ring[a], ring[b], ring[c]];
            if !self.is_positive_with(triangle, ends) {
                return None;
            }
            triangles.push(triangle);
        }
        if corners.len() < 2 {
            corners = vec![0];
        }
        for (index, &from) in corners.iter().enumerate() {
            let to = if index + 1 < corners.len() { corners[index + 1] } else { corners[0] + ring.len() };
            let to = if corners.len() == 1 { to - 1 } else { to };
            let part: Vec<u32> = (from..=to).map(|i| ring[i % ring.len()]).collect();
            triangles.extend(self.triangulate_part(&part, ends)?);
        }
        Some(triangles)
    }

    /// Triangles between a chain of the ring and its closing edge, by dynamic programming over sub-chains.
    fn triangulate_part(&self, chain: &[u32], ends: [u32; 2]) -> Option<Vec<[u32; 3]>> {
        let n = chain.len();
        // apex[i][j]: the corner of the triangle on the edge i j, if that sub-chain can be done.
        let mut apex = vec![vec![usize::MAX; n]; n];
        for length in 2..n {
            for i in 0..n - length {
                let j = i + length;
                let done = |i: usize, j: usize, apex: &[Vec<usize>]| j == i + 1 || apex[i][j] != usize::MAX;
                let found = (i + 1..j).find(|&k| {
                    done(i, k, &apex)
                        && done(k, j, &apex)
                        && self.is_positive_with([chain[i], chain[k], chain[j]], ends)
                });
                if let Some(k) = found {
                    apex[i][j] = k;
                }
            }
        }
        let mut triangles = Vec::new();
        let mut open = vec![(0, n - 1)];
        while let Some((i, j)) = open.pop() {
            if j > i + 1 {
                let k = *apex[i].get(j).filter(|&&k| k != usize::MAX)?;
                triangles.push([chain[i], chain[k], chain[j]]);
                open.extend([(i, k), (k, j)]);
            }
        }
        Some(triangles)
    }

    fn is_positive_with(&self, triangle: [u32; 3], [below, above]: [u32; 2]) -> bool {
        let [a, b, c] = triangle.map(|v| self.point(v));
        let (below, above) = (self.point(below), self.point(above));
        orientation(a, b, c, above) > 0.0 && orientation(a, c, b, below) > 0.0
    }

    /// Replaces the `old` tetrahedra by `new` ones that fill the same region, which has no locked facet inside.
    fn replace(&mut self, old: &[u32], new: &[[u32; 4]]) {
        let mut open: Vec<([u32; 3], u32, usize, bool)> = Vec::new();
        for &tet in old {
            for slot in 0..4 {
                let (outer, back) = self.across(tet, slot);
                if !old.contains(&outer) {
                    let facet = sorted(facet(self.corners(tet), slot)).0;
                    open.push((facet, outer, back, self.is_locked(tet, slot)));
                }
            }
        }
        for &tet in old {
            self.retire(tet);
        }
        for &corners in new {
            let tet = self.put(corners, [NONE; 4]);
            for slot in 0..4 {
                let facet = sorted(facet(corners, slot)).0;
                if let Some(index) = open.iter().position(|entry| entry.0 == facet) {
                    let (_, outer, back, locked) = open.swap_remove(index);
                    self.link(tet, slot, outer);
                    self.link(outer, back, tet);
                    if locked {
                        self.lock_new_side(tet, slot);
                    }
                } else {
                    open.push((facet, tet, slot, false));
                }
            }
        }
        debug_assert!(open.is_empty(), "the new tetrahedra fill another region");
    }
}

/// Whether an even number of swaps turns one order of four into the other.
fn is_even(from: [u32; 4], to: [u32; 4]) -> bool {
    let places = to.map(|v| from.iter().position(|&f| f == v).unwrap_or(0));
    let inversions = (0..4).flat_map(|i| (i + 1..4).map(move |j| (i, j))).filter(|&(i, j)| places[i] > places[j]);
    inversions.count() % 2 == 0
}
