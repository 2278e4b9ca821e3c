//! Piecewise linear elements on a triangulated surface: stiffness and mass (thesis 2.1.2, 2.1.3). Only lengths of edges
//! are needed, so that a domain may also be periodic, or have no place in space at all (thesis 3.8.1).

use armature_geometry::operators::{Lumping, SparseMatrix};

use super::error::FairingError;

/// A triangle whose doubled area is below this times its longest edge squared is a sliver: its area is raised to that,
/// so that its cotangents stay finite. Its smallest angle is then about 0.0006°.
const SLIVER: f64 = 1e-5;

/// Triangles, and the lengths of their edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Elements {
    vertex_count: usize,
    triangles: Vec<[u32; 3]>,
    /// Of each triangle, the lengths of the edges opposite its corners.
    lengths: Vec<[f64; 3]>,
}

impl Elements {
    /// Triangles of a mesh in the plane or in space: n×D positions, m×3 indices.
    pub fn of_positions<const D: usize>(vertices: &[[f64; D]], triangles: &[[u32; 3]]) -> Result<Self, FairingError> {
        check_indices(vertices.len(), triangles)?;
        let between = |a: u32, b: u32| {
            let (p, q) = (vertices[a as usize], vertices[b as usize]);
            // Scaled, so that squares neither overflow nor vanish.
            let most = (0..D).map(|k| (p[k] - q[k]).abs()).fold(0.0, f64::max);
            if most == 0.0 {
                return 0.0;
            }
            most * (0..D).map(|k| ((p[k] - q[k]) / most).powi(2)).sum::<f64>().sqrt()
        };
        let lengths = triangles.iter().map(|&[a, b, c]| [between(b, c), between(c, a), between(a, b)]).collect();
        Self::of_lengths(vertices.len(), triangles.to_vec(), lengths)
    }

    /// Triangles with given lengths of edges, opposite their corners.
    pub fn of_lengths(
        vertex_count: usize,
        triangles: Vec<[u32; 3]>,
        lengths: Vec<[f64; 3]>,
    ) -> Result<Self, FairingError> {
        check_indices(vertex_count, &triangles)?;
        if lengths.len() != triangles.len() {
            return Err(FairingError::WrongCount {
                what: "lengths of edges",
                given: lengths.len(),
                wanted: triangles.len(),
            });
        }
        let unusable = |l: &[f64; 3]| l.iter().any(|x| !x.is_finite() || *x < 0.0) || l.iter().all(|x| *x == 0.0);
        if let Some(triangle) = lengths.iter().position(unusable) {
            return Err(FairingError::NoSize { triangle });
        }
        Ok(Self { vertex_count, triangles, lengths })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }

    /// The triangles, m×3.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The lengths of the edges opposite the corners of each triangle.
    pub fn lengths(&self) -> &[[f64; 3]] {
        &self.lengths
    }

    /// The mean length of an edge, each counted once for each triangle on it.
    pub fn mean_edge(&self) -> f64 {
        let sides = 3.0 * self.lengths.len().max(1) as f64;
        self.lengths.iter().flatten().map(|l| l / sides).sum()
    }

    /// The area of the domain.
    pub(super) fn area(&self) -> f64 {
        self.lengths.iter().map(|&lengths| 0.5 * bounded_doubled_area(lengths)).sum()
    }

    /// Triangles so thin that their area is raised.
    pub fn slivers(&self) -> usize {
        self.lengths.iter().filter(|l| doubled_area(**l) < SLIVER * longest(**l).powi(2)).count()
    }

    /// The same domain, `factor` times as large.
    #[must_use]
    pub(super) fn scaled(&self, factor: f64) -> Self {
        let lengths = self.lengths.iter().map(|l| l.map(|x| x * factor)).collect();
        Self { lengths, ..self.clone() }
    }

    /// The cotangent Laplacian, `L_ij = -⟨∇φ_i, ∇φ_j⟩` (thesis eq. 2.16): negative semidefinite, rows sum to zero.
    pub(super) fn laplacian(&self) -> SparseMatrix {
        let mut entries: Vec<(u32, u32, f64)> = (0..self.vertex_count as u32).map(|v| (v, v, 0.0)).collect();
        for (&corners, &lengths) in self.triangles.iter().zip(&self.lengths) {
            let area_2 = bounded_doubled_area(lengths);
            let squares = lengths.map(|l| l * l);
            for k in 0..3 {
                let (next, last) = ((k + 1) % 3, (k + 2) % 3);
                let half_cotangent = 0.25 * (squares[next] + squares[last] - squares[k]) / area_2;
                let (i, j) = (corners[next], corners[last]);
                entries.extend([
                    (i, j, half_cotangent),
                    (j, i, half_cotangent),
                    (i, i, -half_cotangent),
                    (j, j, -half_cotangent),
                ]);
            }
        }
        of_entries(self.vertex_count, &entries)
    }

    /// The diagonal of a lumped mass matrix (thesis 2.1.3).
    pub(super) fn lumped(&self, lumping: Lumping) -> Vec<f64> {
        let mut mass = vec![0.0; self.vertex_count];
        for (corners, &lengths) in self.triangles.iter().zip(&self.lengths) {
            for (&vertex, share) in corners.iter().zip(shares(lengths, lumping)) {
                mass[vertex as usize] += share;
            }
        }
        mass
    }

    /// The full mass matrix, `M_ij = ⟨φ_i, φ_j⟩` (thesis eq. 2.56).
    pub(super) fn full_mass(&self) -> SparseMatrix {
        let mut entries = Vec::with_capacity(9 * self.triangles.len());
        for (corners, &lengths) in self.triangles.iter().zip(&self.lengths) {
            let area = 0.5 * bounded_doubled_area(lengths);
            for (a, &i) in corners.iter().enumerate() {
                entries
                    .extend(corners.iter().enumerate().map(|(b, &j)| (i, j, area / if a == b { 6.0 } else { 12.0 })));
            }
        }
        of_entries(self.vertex_count, &entries)
    }
}

fn of_entries(count: usize, entries: &[(u32, u32, f64)]) -> SparseMatrix {
    // Indices are checked when the elements are made.
    SparseMatrix::from_triplets(count, count, entries).unwrap_or_default()
}

fn check_indices(vertex_count: usize, triangles: &[[u32; 3]]) -> Result<(), FairingError> {
    let repeats = |&[a, b, c]: &[u32; 3]| a == b || b == c || c == a;
    if let Some(triangle) = triangles.iter().position(repeats) {
        return Err(FairingError::NoSize { triangle });
    }
    match triangles.iter().flatten().find(|&&v| v as usize >= vertex_count) {
        Some(&vertex) => Err(FairingError::NoSuchVertex { vertex, count: vertex_count }),
        None => Ok(()),
    }
}

fn longest(lengths: [f64; 3]) -> f64 {
    lengths.into_iter().fold(0.0, f64::max)
}

/// Twice the area, by Kahan's arrangement of Heron's formula.
pub(super) fn doubled_area(mut sides: [f64; 3]) -> f64 {
    sides.sort_unstable_by(|x, y| y.total_cmp(x));
    let [a, b, c] = sides;
    let product = (a + (b + c)) * (c - (a - b)) * (c + (a - b)) * (a + (b - c));
    0.5 * product.max(0.0).sqrt()
}

fn bounded_doubled_area(lengths: [f64; 3]) -> f64 {
    doubled_area(lengths).max(SLIVER * longest(lengths).powi(2))
}

/// How much of a triangle's area each corner has. Obtuse triangles give the corner opposite the longest edge half
/// (Meyer et al. 2003), others the area nearest to the corner.
fn shares(lengths: [f64; 3], lumping: Lumping) -> [f64; 3] {
    let area_2 = bounded_doubled_area(lengths);
    let area = 0.5 * area_2;
    let [a, b, c] = lengths.map(|l| l * l);
    let doubled_dots = [b + c - a, c + a - b, a + b - c];
    let thin = doubled_area(lengths) < area_2;
    if lumping == Lumping::Barycentric || thin {
        return [area / 3.0; 3];
    }
    if doubled_dots.iter().any(|&at| at < 0.0) {
        return doubled_dots.map(|at| if at < 0.0 { area / 2.0 } else { area / 4.0 });
    }
    let [at_a, at_b, at_c] = doubled_dots.map(|at| at / (2.0 * area_2));
    [(c * at_c + b * at_b) / 8.0, (a * at_a + c * at_c) / 8.0, (a * at_a + b * at_b) / 8.0]
}

#[cfg(test)]
mod tests {
    use armature_geometry::operators::{cotangent_laplacian_of_triangles, lumped_mass_of_triangles};

    use super::*;

    #[test]
    fn lengths_give_the_matrices_that_positions_give() {
        let vertices = [[0.0, 0.0, 0.1], [1.0, 0.2, 0.0], [0.3, 0.9, 0.0], [1.4, 1.1, 0.7], [2.9, 0.1, 0.2]];
        let triangles = [[0, 1, 2], [2, 1, 3], [1, 4, 3]];
        let elements = Elements::of_positions(&vertices, &triangles).unwrap();
        let (ours, theirs) = (elements.laplacian(), cotangent_laplacian_of_triangles(&vertices, &triangles).matrix);
        let full = elements.full_mass();
        for lumping in [Lumping::Barycentric, Lumping::VoronoiHybrid] {
            let want = lumped_mass_of_triangles(&vertices, &triangles, lumping);
            elements.lumped(lumping).iter().zip(&want).for_each(|(a, b)| assert!((a - b).abs() < 1e-14));
        }
        let barycentric = elements.lumped(Lumping::Barycentric);
        for i in 0..5 {
            for j in 0..5 {
                assert!((ours.get(i, j) - theirs.get(i, j)).abs() < 1e-13);
            }
            assert!((full.multiply(&[1.0; 5])[i] - barycentric[i]).abs() < 1e-14, "rows of the full mass sum to areas");
        }
    }

    #[test]
    fn nonsense_is_named() {
        let flat = Elements::of_positions(&[[0.0, 0.0]; 3], &[[0, 1, 2]]);
        assert_eq!(flat, Err(FairingError::NoSize { triangle: 0 }));
        let far = Elements::of_positions(&[[0.0, 0.0]; 3], &[[0, 1, 3]]);
        assert_eq!(far, Err(FairingError::NoSuchVertex { vertex: 3, count: 3 }));
        let thin = Elements::of_positions(&[[0.0, 0.0], [1.0, 0.0], [0.5, 1e-9]], &[[0, 1, 2]]).unwrap();
        assert_eq!(thin.slivers(), 1);
        assert!(thin.laplacian().values().iter().all(|x| x.is_finite()));
    }
}
