//! A graded octree: as fine as required at some points, and neighbours never differ by more than one level.

use rayon::prelude::*;

/// Levels below the root; cells of the last are 2⁻²⁰ of the box, and three of these numbers fit into 64 bits.
pub(super) const DEEPEST: u32 = 20;

/// A recursively subdivided cube.
#[derive(Debug)]
pub(super) struct Octree {
    low: [f64; 3],
    /// Side of the root.
    size: f64,
    /// For each level, the keys of the subdivided cells, ascending.
    cut: Vec<Vec<u64>>,
}

/// A cell that is not subdivided.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Leaf {
    pub(super) centre: [f64; 3],
    pub(super) size: f64,
}

impl Octree {
    /// The octree in which the cell of each point is no larger than that point's size, as far as `deepest` levels allow
    /// (at most [`DEEPEST`]), and each subdivided cell has all its 26 neighbours.
    pub(super) fn new(low: [f64; 3], high: [f64; 3], points: &[([f64; 3], f64)], deepest: u32) -> Self {
        let extent = (0..3).map(|k| high[k] - low[k]).fold(0.0, f64::max);
        // A power of two, so that centres of cells lie on a lattice without rounding.
        let size = libm::exp2(libm::ceil(libm::log2(extent * 1.0625).max(-1000.0)));
        let snapped = low.map(|c| libm::floor(c / size * 1024.0) / 1024.0 * size);
        let mut tree = Self { low: snapped, size, cut: Vec::new() };
        let mut cut: Vec<Vec<u64>> = vec![Vec::new(); DEEPEST as usize + 1];
        for &(point, wanted) in points {
            let level = libm::ceil(libm::log2(size / wanted)).clamp(0.0, f64::from(deepest.min(DEEPEST))) as u32;
            if level > 0 {
                // Its parent has to be cut.
                cut[level as usize - 1].push(key(tree.cell_at(point, level - 1)));
            }
        }
        for level in (0..=DEEPEST as usize).rev() {
            cut[level].par_sort_unstable();
            cut[level].dedup();
            if level > 0 {
                let parents = balanced_parents(&cut[level], level as u32);
                cut[level - 1].extend(parents);
            }
        }
        while cut.last().is_some_and(Vec::is_empty) {
            cut.pop();
        }
        tree.cut = cut;
        tree
    }

    /// Levels of cells below the root.
    pub(super) fn depth(&self) -> u32 {
        self.cut.len() as u32
    }

    fn cell_at(&self, point: [f64; 3], level: u32) -> [u32; 3] {
        let cells = f64::from(1_u32 << level);
        std::array::from_fn(|k| ((point[k] - self.low[k]) / self.size * cells).clamp(0.0, cells - 1.0) as u32)
    }

    fn is_cut(&self, cell: [u32; 3], level: u32) -> bool {
        self.cut.get(level as usize).is_some_and(|cut| cut.binary_search(&key(cell)).is_ok())
    }

    /// Side of the cell that holds a point.
    pub(super) fn size_at(&self, point: [f64; 3]) -> f64 {
        let level = (0..DEEPEST).find(|&level| !self.is_cut(self.cell_at(point, level), level)).unwrap_or(DEEPEST);
        self.size / f64::from(1_u32 << level)
    }

    /// All cells that are not cut, level by level.
    pub(super) fn leaves(&self) -> Vec<Leaf> {
        let mut leaves = Vec::new();
        for (level, cut) in self.cut.iter().enumerate() {
            let level = level as u32 + 1;
            let size = self.size / f64::from(1_u32 << level);
            for parent in cut.iter().map(|&k| cell(k)) {
                for child in 0..8_u32 {
                    let at: [u32; 3] = std::array::from_fn(|k| 2 * parent[k] + (child >> k & 1));
                    if !self.is_cut(at, level) {
                        let centre = std::array::from_fn(|k| self.low[k] + (f64::from(at[k]) + 0.5) * size);
                        leaves.push(Leaf { centre, size });
                    }
                }
            }
        }
        leaves
    }
}

/// The parents of the cells and of all their neighbours.
fn balanced_parents(cut: &[u64], level: u32) -> Vec<u64> {
    let last = (1_u32 << level) - 1;
    let mut parents: Vec<u64> = cut
        .par_iter()
        .flat_map_iter(|&at| {
            let at = cell(at);
            (0..8_u32).map(move |corner| {
                key(std::array::from_fn(|k| {
                    // Neighbours reach one cell beyond on the side of the parent that the cell lies on.
                    let towards = corner >> k & 1;
                    if towards == 0 {
                        at[k] >> 1
                    } else if at[k] & 1 == 0 {
                        at[k].saturating_sub(1) >> 1
                    } else {
                        (at[k] + 1).min(last) >> 1
                    }
                }))
            })
        })
        .collect();
    parents.par_sort_unstable();
    parents.dedup();
    parents
}

fn key([x, y, z]: [u32; 3]) -> u64 {
    u64::from(x) << 42 | u64::from(y) << 21 | u64::from(z)
}

fn cell(key: u64) -> [u32; 3] {
    [(key >> 42) as u32, (key >> 21) as u32 & 0x1f_ffff, key as u32 & 0x1f_ffff]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_as_fine_as_asked_and_graded() {
        let point = [0.3, 0.3, 0.3];
        let tree = Octree::new([0.0; 3], [1.0; 3], &[(point, 0.01)], DEEPEST);
        assert!(tree.size_at(point) <= 0.01 && tree.size_at([0.9; 3]) > 0.1);
        let leaves = tree.leaves();
        let volume: f64 = leaves.iter().map(|leaf| leaf.size.powi(3)).sum();
        assert!((volume - 8.0).abs() < 1e-12, "the leaves fill the root of side 2: {volume}");
        for a in &leaves {
            for b in &leaves {
                let apart = (0..3).map(|k| (a.centre[k] - b.centre[k]).abs()).fold(0.0, f64::max);
                if apart <= 0.5 * (a.size + b.size) * (1.0 + 1e-9) {
                    assert!(a.size <= 2.0 * b.size && b.size <= 2.0 * a.size);
                }
            }
        }
    }
}
