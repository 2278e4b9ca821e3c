//! Which tetrahedra meet at which facets.

use super::ImproveError;

/// No tetrahedron: beyond a facet of the boundary.
pub(super) const NONE: u32 = u32::MAX;

/// Corners of the facet opposite each corner, counter-clockwise seen from outside.
pub(super) const FACETS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// The facet opposite corner `k`, counter-clockwise seen from outside.
pub(super) fn facet(tetrahedron: [u32; 4], k: usize) -> [u32; 3] {
    FACETS[k].map(|i| tetrahedron[i])
}

/// Sorted corners, and whether sorting was an odd permutation.
pub(super) fn sorted([mut a, mut b, mut c]: [u32; 3]) -> ([u32; 3], bool) {
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

/// All facets, grouped by the smallest corner.
pub(super) struct Facets {
    /// Where the facets of each smallest corner begin; one more than vertices.
    begins: Vec<u32>,
    /// The other two corners, 4·tetrahedron + k, and whether sorting was odd.
    entries: Vec<(u32, u32, u32, bool)>,
}

impl Facets {
    pub(super) fn gather(vertex_count: usize, tetrahedra: &[[u32; 4]]) -> Self {
        let all = || (0..4 * tetrahedra.len()).map(|side| (side, sorted(facet(tetrahedra[side / 4], side % 4))));
        let mut begins = vec![0; vertex_count + 1];
        for (_, (key, _)) in all() {
            begins[key[0] as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            begins[v + 1] += begins[v];
        }
        let mut entries = vec![(0, 0, 0, false); 4 * tetrahedra.len()];
        let mut next = begins.clone();
        for (side, ([a, b, c], odd)) in all() {
            let place = &mut next[a as usize];
            entries[*place as usize] = (b, c, side as u32, odd);
            *place += 1;
        }
        for v in 0..vertex_count {
            entries[begins[v] as usize..begins[v + 1] as usize].sort_unstable();
        }
        Self { begins, entries }
    }

    /// For each tetrahedron what lies across the facet opposite each corner. More than two tetrahedra at a facet, and
    /// two on the same side of it, are errors.
    pub(super) fn neighbours(&self, tetrahedron_count: usize) -> Result<Vec<[u32; 4]>, ImproveError> {
        let mut neighbours = vec![[NONE; 4]; tetrahedron_count];
        for a in 0..self.begins.len() - 1 {
            let bucket = &self.entries[self.begins[a] as usize..self.begins[a + 1] as usize];
            for group in bucket.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
                let facet = [a as u32, group[0].0, group[0].1];
                match *group {
                    [_] => {}
                    [(.., s, s_odd), (.., t, t_odd)] if s_odd != t_odd => {
                        neighbours[s as usize / 4][s as usize % 4] = t / 4;
                        neighbours[t as usize / 4][t as usize % 4] = s / 4;
                    }
                    [_, _] => return Err(ImproveError::SameSide { facet }),
                    _ => return Err(ImproveError::CrowdedFacet { facet, tetrahedra: group.len() }),
                }
            }
        }
        Ok(neighbours)
    }

    /// The sides, 4·tetrahedron + k, of a facet.
    pub(super) fn sides(&self, corners: [u32; 3]) -> impl Iterator<Item = u32> {
        let ([a, b, c], _) = sorted(corners);
        let bucket = match a as usize {
            a if a + 1 < self.begins.len() => &self.entries[self.begins[a] as usize..self.begins[a + 1] as usize],
            _ => &[],
        };
        bucket.iter().filter(move |entry| (entry.0, entry.1) == (b, c)).map(|entry| entry.2)
    }
}
