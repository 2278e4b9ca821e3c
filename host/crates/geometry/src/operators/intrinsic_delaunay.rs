//! The Laplacian of a surface's intrinsic Delaunay triangulation: the same surface with different edges.
//!
//! The cotangent Laplacian of a mesh with obtuse triangles has negative conductances, and diffusion on it may leave the
//! range of its sources. Flipping edges *within* the surface until every edge is Delaunay (Bobenko & Springborn 2007;
//! Fisher et al. 2007) removes them without moving anything. Open and non-manifold meshes are first doubled into a
//! closed one (the tufted cover), and triangles without area get one by lengthening every edge slightly
//! (mollification), both after Sharp & Crane 2020, "A Laplacian for Nonmanifold Triangle Meshes".

use glam::{DVec2, DVec3};

use super::cotangent_laplacian::graph_laplacian;
use super::lumped_mass::{Lumping, shares_of_intrinsic_triangle};
use super::sparse_matrix::SparseMatrix;
use crate::vectors::area_of_lengths;
use crate::{MeshError, TriangleMesh};

/// Every triangle's two shorter sides exceed its longest by at least this fraction of the mean edge.
/// Keeps cotangents below about a thousand on average-sized triangles, and leaves good meshes untouched.
const MOLLIFICATION: f64 = 1e-6;

/// An edge is left alone if its conductance is above this: flipping at rounding level may never end.
const NEGATIVE: f64 = -1e-9;

/// Average number of flips per side before giving up. Real meshes need less than one.
const FLIPS_PER_SIDE: usize = 64;

/// Laplacian and mass of an intrinsic Delaunay triangulation.
#[derive(Clone, Debug, PartialEq)]
pub struct IntrinsicLaplacian {
    /// n×n, same sign as [`crate::operators::cotangent_laplacian`]; off-diagonal entries are not negative.
    pub matrix: SparseMatrix,
    /// Area of each vertex, mesh unit squared; n long, zero for vertices in no triangle.
    pub mass: Vec<f64>,
    /// Edges flipped.
    pub flips: usize,
    /// Triangles skipped because two of their corners are the same vertex.
    pub omitted_triangles: usize,
    /// Triangles that needed lengthened edges to have an area.
    pub degenerate_triangles: usize,
    /// Edges whose conductance was still negative when flipping ended, and was set to zero.
    pub clamped_edges: usize,
    /// Whether the mesh was doubled because it is open, non-manifold, or not oriented consistently.
    pub doubled: bool,
}

/// Builds both operators for a mesh in any state that passes `validate`.
pub fn intrinsic_delaunay_laplacian(mesh: &TriangleMesh, lumping: Lumping) -> Result<IntrinsicLaplacian, MeshError> {
    mesh.validate()?;
    let squared = |a: u32, b: u32| {
        DVec3::from(mesh.vertices[a as usize]).distance_squared(DVec3::from(mesh.vertices[b as usize]))
    };
    let triangles: Vec<[u32; 3]> =
        mesh.triangles.iter().filter(|[a, b, c]| a != b && b != c && c != a).copied().collect();
    let omitted_triangles = mesh.triangles.len() - triangles.len();
    let mut lengths: Vec<[f64; 3]> =
        triangles.iter().map(|&[a, b, c]| [squared(a, b), squared(b, c), squared(c, a)].map(f64::sqrt)).collect();
    let degenerate_triangles = mollify(&mut lengths);
    let (mut surface, doubled) = Sides::glue(triangles, lengths);
    let flips = surface.flip_to_delaunay();
    let (matrix, clamped_edges) = surface.laplacian(mesh.vertices.len(), if doubled { 0.5 } else { 1.0 });
    let mut mass = vec![0.0; mesh.vertices.len()];
    for (corners, lengths) in surface.corners.iter().zip(&surface.lengths) {
        for (&vertex, share) in corners.iter().zip(shares_of_intrinsic_triangle(*lengths, lumping)) {
            mass[vertex as usize] += if doubled { 0.5 * share } else { share };
        }
    }
    Ok(IntrinsicLaplacian { matrix, mass, flips, omitted_triangles, degenerate_triangles, clamped_edges, doubled })
}

/// Lengthens all edges by one amount so that every triangle inequality holds with a margin; returns how many did not.
fn mollify(lengths: &mut [[f64; 3]]) -> usize {
    let mean = lengths.iter().flatten().sum::<f64>() / (3 * lengths.len()).max(1) as f64;
    // All vertices at one place: any length will do.
    let room = if mean > 0.0 { MOLLIFICATION * mean } else { 1.0 };
    let lacking = |[a, b, c]: &[f64; 3]| room - (a + b - c).min(b + c - a).min(c + a - b);
    let degenerate = lengths.iter().filter(|triangle| lacking(triangle) > 0.0).count();
    let longer_by = lengths.iter().map(lacking).fold(0.0, f64::max);
    lengths.iter_mut().flatten().for_each(|length| *length += longer_by);
    degenerate
}

/// A closed triangulation by its sides. Side `3 f + k` runs from corner `k` of triangle `f` to the next corner.
struct Sides {
    corners: Vec<[u32; 3]>,
    lengths: Vec<[f64; 3]>,
    /// The side on the other triangle that runs the opposite way along the same edge.
    glued: Vec<u32>,
}

impl Sides {
    /// Glues triangles along their edges; doubles them if they do not form a closed surface.
    fn glue(mut corners: Vec<[u32; 3]>, mut lengths: Vec<[f64; 3]>) -> (Self, bool) {
        let mut stars: Vec<(u32, u32, u32, bool)> = Vec::with_capacity(3 * corners.len());
        for (face, triangle) in corners.iter().enumerate() {
            for k in 0..3 {
                let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
                stars.push((from.min(to), from.max(to), (3 * face + k) as u32, from < to));
            }
        }
        stars.sort_unstable();
        let same_edge = |a: &(u32, u32, u32, bool), b: &(u32, u32, u32, bool)| (a.0, a.1) == (b.0, b.1);
        let closes = |star: &[(u32, u32, u32, bool)]| star.len() == 2 && star[0].3 != star[1].3;
        let doubled = !stars.chunk_by(same_edge).all(closes);
        let single = corners.len() as u32;
        if doubled {
            let backs: Vec<_> = corners.iter().map(|&[a, b, c]| [a, c, b]).collect();
            corners.extend(backs);
            let backs: Vec<_> = lengths.iter().map(|&[ab, bc, ca]| [ca, bc, ab]).collect();
            lengths.extend(backs);
        }
        let back_of = |side: u32| 3 * (single + side / 3) + 2 - side % 3;
        let mut glued = vec![0; 3 * corners.len()];
        for star in stars.chunk_by(same_edge) {
            for (index, &(_, _, side, forward)) in star.iter().enumerate() {
                let (_, _, next, next_forward) = star[(index + 1) % star.len()];
                // Around an edge, the forward side of each triangle meets the backward side of the next.
                let (here, there) = if doubled {
                    (if forward { side } else { back_of(side) }, if next_forward { back_of(next) } else { next })
                } else {
                    (side, next)
                };
                glued[here as usize] = there;
                glued[there as usize] = here;
            }
        }
        (Self { corners, lengths, glued }, doubled)
    }

    /// Flips edges until all are Delaunay; returns the number of flips.
    fn flip_to_delaunay(&mut self) -> usize {
        let mut waiting: Vec<u32> = (0..self.glued.len() as u32).rev().collect();
        let mut is_waiting = vec![true; self.glued.len()];
        let mut flips = 0;
        let limit = FLIPS_PER_SIDE * self.glued.len();
        while let Some(side) = waiting.pop() {
            is_waiting[side as usize] = false;
            let other = self.glued[side as usize];
            let conductance = self.cotangent_opposite(side) + self.cotangent_opposite(other);
            // The two sides of one triangle glued to each other cannot be flipped, and need not be.
            if conductance >= NEGATIVE || side / 3 == other / 3 || flips == limit {
                continue;
            }
            let Some(touched) = self.flip(side, other) else { continue };
            flips += 1;
            for side in touched {
                if !is_waiting[side as usize] {
                    is_waiting[side as usize] = true;
                    waiting.push(side);
                }
            }
        }
        flips
    }

    /// Replaces the edge between `i` and `j` of the triangles `ijk` and `jil` by one between `k` and `l`.
    /// Returns the four sides around it; `None`, changing nothing, if rounding left no proper triangles.
    fn flip(&mut self, side: u32, other: u32) -> Option<[u32; 4]> {
        let (ij, jk, ki) = (side, next(side), next(next(side)));
        let (ji, il, lj) = (other, next(other), next(next(other)));
        let [base, length_jk, length_ki, length_il, length_lj] = [ij, jk, ki, il, lj].map(|s| self.length(s));
        // The two triangles laid flat: i at the origin, j to the right, k above, l below.
        let apex = |from_i: f64, from_j: f64| {
            let x = (base * base + (from_i - from_j) * (from_i + from_j)) / (2.0 * base);
            DVec2::new(x, 2.0 * area_of_lengths([base, from_i, from_j]) / base)
        };
        let (above, below) = (apex(length_ki, length_jk), apex(length_il, length_lj));
        let length_kl = above.distance(DVec2::new(below.x, -below.y));
        let sound = |lengths| area_of_lengths(lengths) > 0.0;
        if !sound([length_kl, length_lj, length_jk]) || !sound([length_kl, length_ki, length_il]) {
            return None;
        }
        let [i, j, k, l] = [ij, ji, ki, lj].map(|s| self.corners[s as usize / 3][s as usize % 3]);
        let (left, right) = (side / 3, other / 3);
        let moved = [(lj, 3 * left + 1), (jk, 3 * left + 2), (ki, 3 * right + 1), (il, 3 * right + 2)];
        let partners = moved.map(|(old, _)| {
            let partner = self.glued[old as usize];
            // A partner may itself be one of the four.
            moved.iter().find(|(old, _)| *old == partner).map_or(partner, |&(_, new)| new)
        });
        self.corners[left as usize] = [k, l, j];
        self.corners[right as usize] = [l, k, i];
        self.lengths[left as usize] = [length_kl, length_lj, length_jk];
        self.lengths[right as usize] = [length_kl, length_ki, length_il];
        self.glued[3 * left as usize] = 3 * right;
        self.glued[3 * right as usize] = 3 * left;
        for ((_, new), partner) in moved.into_iter().zip(partners) {
            self.glued[new as usize] = partner;
            self.glued[partner as usize] = new;
        }
        Some(moved.map(|(_, new)| new))
    }

    /// Sums conductances by edge, sets what is still negative to zero, and scales all by `factor`.
    fn laplacian(&self, vertex_count: usize, factor: f64) -> (SparseMatrix, usize) {
        let mut edges = Vec::with_capacity(self.glued.len() / 2);
        let mut clamped = 0;
        for side in 0..self.glued.len() as u32 {
            let other = self.glued[side as usize];
            if side > other {
                continue;
            }
            let conductance = 0.5 * (self.cotangent_opposite(side) + self.cotangent_opposite(other));
            clamped += usize::from(conductance < NEGATIVE);
            let corner = |s: u32| self.corners[s as usize / 3][s as usize % 3];
            edges.push((corner(side), corner(next(side)), factor * conductance.max(0.0)));
        }
        (graph_laplacian(vertex_count, &edges), clamped)
    }

    fn length(&self, side: u32) -> f64 {
        self.lengths[side as usize / 3][side as usize % 3]
    }

    /// Cotangent of the angle opposite a side in its triangle.
    fn cotangent_opposite(&self, side: u32) -> f64 {
        let [a, b, c] = [side, next(side), next(next(side))].map(|s| self.length(s));
        let area = area_of_lengths([a, b, c]);
        if area > 0.0 { (b * b + c * c - a * a) / (4.0 * area) } else { 0.0 }
    }
}

/// The following side of the same triangle.
fn next(side: u32) -> u32 {
    if side % 3 == 2 { side - 2 } else { side + 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::operators::cotangent_laplacian;

    /// A fold of two obtuse triangles on a common edge.
    fn flat_kite() -> TriangleMesh {
        let vertices = vec![[-2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.1, 0.5, 0.0], [-0.2, -0.6, 0.0]];
        TriangleMesh { vertices, triangles: vec![[0, 1, 2], [1, 0, 3]] }
    }

    #[test]
    fn kite_is_flipped_to_the_delaunay_triangulation_of_its_corners() {
        let mesh = flat_kite();
        let plain = cotangent_laplacian(&mesh).unwrap().matrix;
        assert!(plain.get(0, 1) < 0.0);
        let intrinsic = intrinsic_delaunay_laplacian(&mesh, Lumping::Barycentric).unwrap();
        assert!(intrinsic.doubled && intrinsic.flips > 0 && intrinsic.clamped_edges == 0);
        assert!(intrinsic.matrix.get(2, 3) > 0.0);
        let area: f64 = intrinsic.mass.iter().sum();
        assert!((area - 2.2).abs() < 1e-12, "flipping keeps the area, not {area}");
    }

    #[test]
    fn flat_surface_without_obtuse_boundary_equals_the_extrinsic_flip() {
        // The same square cut along either diagonal of a sheared quad: one cut is Delaunay, the other is not.
        let vertices = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.4, 1.0, 0.0], [0.4, 1.0, 0.0]];
        let bad = TriangleMesh { vertices: vertices.clone(), triangles: vec![[0, 1, 2], [0, 2, 3]] };
        let good = TriangleMesh { vertices, triangles: vec![[0, 1, 3], [1, 2, 3]] };
        let expected = cotangent_laplacian(&good).unwrap().matrix;
        let got = intrinsic_delaunay_laplacian(&bad, Lumping::Barycentric).unwrap().matrix;
        for i in 0..4 {
            for j in 0..4 {
                assert!((got.get(i, j) - expected.get(i, j)).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn hopeless_triangles_give_finite_nonnegative_conductances() {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0; 3], [1.0, 1e-12, 0.0], [1e50, 0.0, 0.0]];
        let triangles = vec![[0, 1, 2], [0, 1, 2], [0, 3, 1], [0, 4, 2], [2, 1, 0], [0, 0, 1], [0, 1, 5]];
        let mesh = TriangleMesh { vertices, triangles };
        let intrinsic = intrinsic_delaunay_laplacian(&mesh, Lumping::VoronoiHybrid).unwrap();
        assert_eq!(intrinsic.omitted_triangles, 1);
        assert!(intrinsic.degenerate_triangles >= 4);
        for column in 0..6 {
            for (row, value) in intrinsic.matrix.column(column) {
                assert!(value.is_finite() && (row == column || value >= 0.0));
            }
        }
        assert!(intrinsic.mass[..5].iter().all(|m| *m > 0.0 && m.is_finite()));
        let point = TriangleMesh { vertices: vec![[1.0; 3]; 3], triangles: vec![[0, 1, 2]] };
        assert!(intrinsic_delaunay_laplacian(&point, Lumping::Barycentric).unwrap().mass[0].is_finite());
    }
}
