//! Shared by this crate's tests: real models, synthetic weights, seeded numbers.

#![allow(dead_code, reason = "every test file uses a part of this")]

use armature_test_support::{Volume, read_mesh, read_npy, shared};

pub(crate) struct Dice(pub(crate) u64);

impl Dice {
    /// Numbers in [-1, 1), the same in every run.
    pub(crate) fn roll(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 / (1_u64 << 52) as f64) - 1.0
    }

    pub(crate) fn vector(&mut self) -> [f64; 3] {
        [self.roll(), self.roll(), self.roll()]
    }
}

/// The tetrahedral hand: 7,234 vertices, 29,998 tetrahedra.
pub(crate) fn hand() -> Option<Volume> {
    shared("hand.mesh").map(|path| read_mesh(&path))
}

/// The hand's bounded biharmonic weights, n×20, rows summing to one.
pub(crate) fn hand_weights() -> Option<Vec<f64>> {
    let read = read_npy(&shared("../reference/hand-bbw-w.npy")?);
    assert_eq!((read.columns, read.values.len()), (20, 7234 * 20));
    let at = |vertex: usize, handle: usize| {
        let weight = read.values[handle * 7234 + vertex];
        if weight > 1e-5 { weight } else { 0.0 }
    };
    let mut weights = Vec::new();
    for vertex in 0..7234 {
        let sum: f64 = (0..20).map(|h| at(vertex, h)).sum();
        weights.extend((0..20).map(|h| at(vertex, h) / sum));
    }
    Some(weights)
}

/// Where a handle's weights are largest: a place to hold it by.
pub(crate) fn middle_of_handles(positions: &[[f64; 3]], weights: &[f64], count: usize) -> Vec<[f64; 3]> {
    let middle = |handle: usize| {
        let mut sum = [0.0; 4];
        for (p, row) in positions.iter().zip(weights.chunks_exact(count)) {
            let w = row[handle].powi(4);
            (0..3).for_each(|axis| sum[axis] += w * p[axis]);
            sum[3] += w;
        }
        [0, 1, 2].map(|axis| sum[axis] / sum[3])
    };
    (0..count).map(middle).collect()
}

/// A bar along x of `n[0]`×`n[1]`×`n[2]` cubes of six tetrahedra each, somewhat crooked.
pub(crate) fn bar(n: [usize; 3]) -> (Vec<[f64; 3]>, Vec<[u32; 4]>) {
    let dice = &mut Dice(12);
    let mut positions = Vec::new();
    for x in 0..=n[0] {
        for y in 0..=n[1] {
            for z in 0..=n[2] {
                let shift = dice.vector().map(|c| 0.1 * c);
                positions.push([x as f64 + shift[0], y as f64 + shift[1], z as f64 + shift[2]]);
            }
        }
    }
    let at = |x: usize, y: usize, z: usize| ((x * (n[1] + 1) + y) * (n[2] + 1) + z) as u32;
    let mut tetrahedra = Vec::new();
    for x in 0..n[0] {
        for y in 0..n[1] {
            for z in 0..n[2] {
                for [a, b] in [[4, 6], [6, 2], [2, 3], [3, 1], [1, 5], [5, 4]] {
                    let corner = |bits: usize| at(x + (bits >> 2 & 1), y + (bits >> 1 & 1), z + (bits & 1));
                    tetrahedra.push([corner(0), corner(a), corner(b), corner(7)]);
                }
            }
        }
    }
    (positions, tetrahedra)
}

/// The triangles that belong to only one tetrahedron, facing outwards or not.
pub(crate) fn boundary(tetrahedra: &[[u32; 4]]) -> Vec<[u32; 3]> {
    let mut faces: Vec<([u32; 3], [u32; 3])> = Vec::new();
    for &[a, b, c, d] in tetrahedra {
        for face in [[a, b, c], [a, d, b], [b, d, c], [c, d, a]] {
            let mut key = face;
            key.sort_unstable();
            faces.push((key, face));
        }
    }
    faces.sort_unstable();
    let alone =
        |i: usize| (i == 0 || faces[i - 1].0 != faces[i].0) && (i + 1 == faces.len() || faces[i + 1].0 != faces[i].0);
    (0..faces.len()).filter(|&i| alone(i)).map(|i| faces[i].1).collect()
}

/// Smooth weights that sum to one, from distances to handle points.
pub(crate) fn smooth_weights(positions: &[[f64; 3]], points: &[[f64; 3]]) -> Vec<f64> {
    let mut weights = Vec::new();
    for p in positions {
        let near = |h: &[f64; 3]| {
            let squared: f64 = (0..3).map(|axis| (p[axis] - h[axis]).powi(2)).sum();
            1.0 / (squared + 0.05).powi(2)
        };
        let row: Vec<f64> = points.iter().map(near).collect();
        let sum: f64 = row.iter().sum();
        weights.extend(row.iter().map(|w| w / sum));
    }
    weights
}
