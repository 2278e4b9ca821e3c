//! Facets of tetrahedra: their corners, and which tetrahedra share one.

use rayon::prelude::*;

/// Corners of the facet opposite each corner, counter-clockwise seen from outside.
pub(crate) const FACETS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The facet opposite corner `k`, counter-clockwise seen from outside.
pub(crate) fn facet(tetrahedron: [u32; 4], k: usize) -> [u32; 3] {
    FACETS[k].map(|i| tetrahedron[i])
}

/// Sorted corners, and whether sorting was an odd permutation.
pub(crate) fn sorted([mut a, mut b, mut c]: [u32; 3]) -> ([u32; 3], bool) {
    let mut odd = false;
    let mut order = |x: &mut u32, y: &mut u32| {
        if *x > *y {
            std::mem::swap(x, y);
            odd = !odd;
        }
    };
    order(&mut a, &mut b);
    order(&mut b, &mut c);
    order(&mut a, &mut b);
    ([a, b, c], odd)
}

/// A facet as one tetrahedron has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Side {
    /// Ascending.
    pub(crate) corners: [u32; 3],
    pub(crate) tetrahedron: u32,
    /// The corner opposite the facet.
    pub(crate) opposite: u8,
    /// Whether its corners, counter-clockwise seen from outside, are an odd permutation of the ascending ones: two
    /// tetrahedra that share a facet and do not overlap differ in this.
    pub(crate) odd: bool,
}

/// All sides of all tetrahedra, sorted, so that the sides of one facet are consecutive.
pub(crate) fn sorted_sides(tetrahedra: &[[u32; 4]]) -> Vec<Side> {
    let side = |(tetrahedron, &t): (usize, &[u32; 4]), k: usize| {
        let (corners, odd) = sorted(facet(t, k));
        Side { corners, tetrahedron: tetrahedron as u32, opposite: k as u8, odd }
    };
    let mut sides: Vec<Side> = tetrahedra.iter().enumerate().flat_map(|t| (0..4).map(move |k| side(t, k))).collect();
    sides.par_sort_unstable();
    sides
}

/// Pairs of tetrahedra that share a facet.
pub(crate) fn neighbour_pairs(tetrahedra: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let sides = sorted_sides(tetrahedra);
    let same = sides.windows(2).filter(|pair| pair[0].corners == pair[1].corners);
    same.map(|pair| [pair[0].tetrahedron, pair[1].tetrahedron]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shared_facet_is_odd_on_one_side() {
        let tetrahedra = [[0, 1, 2, 3], [4, 2, 1, 3]];
        assert_eq!(neighbour_pairs(&tetrahedra), [[0, 1]]);
        let sides = sorted_sides(&tetrahedra);
        let shared: Vec<&Side> = sides.iter().filter(|s| s.corners == [1, 2, 3]).collect();
        assert_eq!(shared.iter().map(|s| (s.tetrahedron, s.opposite)).collect::<Vec<_>>(), [(0, 0), (1, 0)]);
        assert_ne!(shared[0].odd, shared[1].odd);
        assert_eq!(sides.len(), 8);
    }
}
