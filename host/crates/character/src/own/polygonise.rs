//! A fine closed triangle mesh of a field's zero set: naive surface nets (one vertex per crossed cell, one quad per
//! crossed grid edge), on those blocks of the grid that the surface can reach.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use super::field::{Field, STEEPEST};
use super::surface::Surface;

/// Cells per side of a block.
const BLOCK: i32 = 8;
/// Grid points that a block samples per side.
const POINTS: usize = BLOCK as usize + 1;

/// Where grid points are. For a symmetric field, the first column of cells straddles x = 0.
struct Grid {
    origin: DVec3,
    spacing: f64,
    blocks: IVec3,
}

/// What one block adds: crossed cells with the surface's place in them, and quads over cells.
#[derive(Default)]
struct Patch {
    vertices: Vec<(u64, DVec3)>,
    quads: Vec<[u64; 4]>,
}

/// The zero set of `field` on cells of the given size; for a symmetric field only the half x ≥ 0, with its seam at
/// exactly x = 0.
pub(super) fn polygonise(field: &Field, spacing: f64) -> Surface {
    let grid = Grid::around(field, spacing);
    let block_count = (grid.blocks.x * grid.blocks.y * grid.blocks.z) as usize;
    let patches: Vec<Patch> = (0..block_count)
        .into_par_iter()
        .with_min_len(16)
        .map(|block| grid.patch(field, grid.block(block as i32)))
        .collect();

    let mut vertices: Vec<(u64, DVec3)> = patches.iter().flat_map(|p| p.vertices.iter().copied()).collect();
    vertices.sort_unstable_by_key(|v| v.0);
    let positions: Vec<DVec3> = vertices.iter().map(|v| v.1).collect();
    let index = |key: u64| vertices.binary_search_by_key(&key, |v| v.0).ok().map(|i| i as u32);
    let mut triangles = Vec::new();
    for quad in patches.iter().flat_map(|p| &p.quads) {
        // Every corner exists as long as the field is no steeper than STEEPEST; a test counts the holes.
        let [Some(a), Some(b), Some(c), Some(d)] = quad.map(index) else { continue };
        let at = |v: u32| positions[v as usize];
        if at(a).distance_squared(at(c)) <= at(b).distance_squared(at(d)) {
            triangles.extend([[a, b, c], [a, c, d]]);
        } else {
            triangles.extend([[a, b, d], [b, c, d]]);
        }
    }
    Surface::new(positions, triangles)
}

impl Grid {
    fn around(field: &Field, spacing: f64) -> Self {
        let (low, high) = field.bounds();
        let margin = DVec3::splat(2.0 * spacing);
        let mut origin = low - margin;
        if field.symmetric {
            origin.x = -spacing / 2.0;
        }
        let blocks = ((high + margin - origin) / (spacing * f64::from(BLOCK))).ceil().as_ivec3();
        Self { origin, spacing, blocks: blocks.max(IVec3::ONE) }
    }

    /// First cell of a block.
    fn block(&self, index: i32) -> IVec3 {
        let (x, rest) = (index % self.blocks.x, index / self.blocks.x);
        IVec3::new(x, rest % self.blocks.y, rest / self.blocks.y) * BLOCK
    }

    fn point(&self, at: IVec3) -> DVec3 {
        self.origin + at.as_dvec3() * self.spacing
    }

    /// A number for every cell, including the row before the first.
    fn key(&self, cell: IVec3) -> u64 {
        let size = (self.blocks * BLOCK + IVec3::ONE).as_i64vec3();
        let cell = cell.as_i64vec3() + 1;
        ((cell.z * size.y + cell.y) * size.x + cell.x) as u64
    }

    fn patch(&self, field: &Field, first: IVec3) -> Patch {
        let half = f64::from(BLOCK) * self.spacing / 2.0;
        let reach = half * 3.0_f64.sqrt() * STEEPEST;
        let mut patch = Patch::default();
        if field.distance(self.point(first) + DVec3::splat(half)).abs() > reach {
            return patch;
        }
        let near = field.near(self.point(first) + DVec3::splat(half), half * 3.0_f64.sqrt());
        let mut values = Vec::with_capacity(POINTS.pow(3));
        for z in 0..=BLOCK {
            for y in 0..=BLOCK {
                values.extend((0..=BLOCK).map(|x| near.distance(self.point(first + IVec3::new(x, y, z)))));
            }
        }
        let value = |at: IVec3| values[(at.z as usize * POINTS + at.y as usize) * POINTS + at.x as usize];
        for index in 0..BLOCK.pow(3) {
            let cell = IVec3::new(index % BLOCK, index / BLOCK % BLOCK, index / BLOCK / BLOCK);
            let corners = std::array::from_fn(|k| value(cell + corner(k)));
            if let Some(inside) = crossing(corners) {
                let mut position = self.point(first + cell) + inside * self.spacing;
                if field.symmetric && first.x + cell.x == 0 {
                    position.x = 0.0;
                }
                patch.vertices.push((self.key(first + cell), position));
            }
            self.quads_at(field, first + cell, corners, &mut patch.quads);
        }
        patch
    }

    /// The quads across the three grid edges that start at a cell's first corner.
    fn quads_at(&self, field: &Field, cell: IVec3, corners: [f64; 8], quads: &mut Vec<[u64; 4]>) {
        if field.symmetric && cell.x == 0 {
            return;
        }
        for axis in 0..3 {
            let (inside, next_inside) = (corners[0] < 0.0, corners[1 << axis] < 0.0);
            if inside == next_inside {
                continue;
            }
            let (mut b, mut c) = (IVec3::ZERO, IVec3::ZERO);
            b[(axis + 1) % 3] = 1;
            c[(axis + 2) % 3] = 1;
            let ring = [cell - b - c, cell - c, cell, cell - b].map(|cell| self.key(cell));
            quads.push(if inside { ring } else { [ring[3], ring[2], ring[1], ring[0]] });
        }
    }
}

fn corner(k: usize) -> IVec3 {
    IVec3::new((k & 1) as i32, (k >> 1 & 1) as i32, (k >> 2 & 1) as i32)
}

/// The mean of the places where the surface crosses a cell's edges, in the cell's own coordinates.
fn crossing(corners: [f64; 8]) -> Option<DVec3> {
    let mut sum = DVec3::ZERO;
    let mut count = 0;
    for k in 0..8 {
        for axis in 0..3 {
            let other = k | 1 << axis;
            if other == k || (corners[k] < 0.0) == (corners[other] < 0.0) {
                continue;
            }
            let mut at = corner(k).as_dvec3();
            at[axis] = corners[k] / (corners[k] - corners[other]);
            sum += at;
            count += 1;
        }
    }
    (count > 0).then(|| sum / f64::from(count))
}
