//! The cotangent Laplacian of triangle and tetrahedral meshes (thesis 2.1.2).
//!
//! Sign: `L_ij = ∫ -∇φ_i·∇φ_j` (thesis eq. 2.16), so off-diagonal entries are positive on well-shaped meshes, the
//! diagonal is negative, rows sum to zero and `L` is negative semidefinite. `-L` is the stiffness matrix.

use glam::DVec3;

use super::sparse_matrix::SparseMatrix;
use crate::vectors::{DEGENERATE, difference, dot, doubled_area, six_volumes};
use crate::{MeshError, TetrahedralMesh, TriangleMesh};

/// A Laplacian, and what was wrong with its mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Laplacian {
    /// n×n, symmetric bit for bit, each row summing to zero up to rounding.
    pub matrix: SparseMatrix,
    /// Elements without area or volume. Their area is raised to a tiny positive bound; elements shrunk to a single
    /// point have no effect at all. None makes an entry NaN or infinite.
    pub degenerate_elements: usize,
}

/// Cotangent Laplacian of a surface: `L_ij = ½ (cot α_ij + cot β_ij)` (thesis eq. 2.36). n×n, dimensionless.
pub fn cotangent_laplacian(mesh: &TriangleMesh) -> Result<Laplacian, MeshError> {
    mesh.validate()?;
    Ok(cotangent_laplacian_of_triangles(&mesh.vertices, &mesh.triangles))
}

/// Like [`cotangent_laplacian`], for triangles in any dimension, in particular two and three.
///
/// # Panics
/// If a triangle refers to a vertex that does not exist.
pub fn cotangent_laplacian_of_triangles<const D: usize>(vertices: &[[f64; D]], triangles: &[[u32; 3]]) -> Laplacian {
    assemble(vertices.len(), triangles, |corners| {
        let (cotangents, degenerate) = corner_cotangents(corners.map(|v| vertices[v as usize]));
        let [a, b, c] = corners;
        let [at_a, at_b, at_c] = cotangents.map(|cotangent| 0.5 * cotangent);
        ([(b, c, at_a), (c, a, at_b), (a, b, at_c)], degenerate)
    })
}

/// Cotangent Laplacian of a volume: `L_ij = Σ_T (ℓ/6) cot α`, where `ℓ` and the dihedral angle `α` are those of the
/// edge opposite `ij` in the tetrahedron `T` (thesis eq. 2.49). n×n, in the mesh's unit. Inside-out tetrahedra
/// count with their absolute volume.
pub fn cotangent_laplacian_tetrahedra(mesh: &TetrahedralMesh) -> Result<Laplacian, MeshError> {
    mesh.validate()?;
    Ok(assemble(mesh.vertices.len(), &mesh.tetrahedra, |corners| {
        let (weights, degenerate) = dihedral_weights(corners.map(|v| mesh.vertices[v as usize].into()));
        let [a, b, c, d] = corners;
        let [ab, ac, ad, bc, bd, cd] = weights;
        ([(a, b, ab), (a, c, ac), (a, d, ad), (b, c, bc), (b, d, bd), (c, d, cd)], degenerate)
    }))
}

/// Adds up one weight for every edge of every element.
fn assemble<const K: usize, const E: usize>(
    vertex_count: usize,
    elements: &[[u32; K]],
    edge_weights: impl Fn([u32; K]) -> ([(u32, u32, f64); E], bool),
) -> Laplacian {
    let mut edges = Vec::with_capacity(elements.len() * E);
    let mut degenerate_elements = 0;
    for &element in elements {
        let (weights, degenerate) = edge_weights(element);
        edges.extend(weights);
        degenerate_elements += usize::from(degenerate);
    }
    Laplacian { matrix: graph_laplacian(vertex_count, &edges), degenerate_elements }
}

/// `Σ w (e_i e_jᵀ + e_j e_iᵀ - e_i e_iᵀ - e_j e_jᵀ)` over edges `(i, j, w)`; an edge from a vertex to itself (a
/// degenerate element) has no effect. Every vertex has a diagonal entry, which is zero for isolated ones.
pub(crate) fn graph_laplacian(vertex_count: usize, edges: &[(u32, u32, f64)]) -> SparseMatrix {
    let mut triplets = Vec::with_capacity(2 * edges.len() + vertex_count);
    triplets.extend((0..vertex_count as u32).map(|v| (v, v, 0.0)));
    for &(i, j, weight) in edges.iter().filter(|(i, j, _)| i != j) {
        triplets.push((i, j, weight));
        triplets.push((j, i, weight));
    }
    let mut matrix = SparseMatrix::assemble(vertex_count, vertex_count, &triplets);
    for column in 0..vertex_count {
        let range = matrix.column_starts()[column]..matrix.column_starts()[column + 1];
        let sum: f64 = matrix.values()[range.clone()].iter().sum();
        let diagonal = range.clone().find(|&entry| matrix.row_indices()[entry] == column);
        if let Some(entry) = diagonal {
            matrix.values_mut()[entry] = -sum;
        }
    }
    matrix
}

/// Cotangents at the three corners, and whether the triangle is degenerate.
pub(crate) fn corner_cotangents<const D: usize>([a, b, c]: [[f64; D]; 3]) -> ([f64; 3], bool) {
    let (ab, bc, ca) = (difference(b, a), difference(c, b), difference(a, c));
    let longest = dot(ab, ab).max(dot(bc, bc)).max(dot(ca, ca));
    let area_2 = doubled_area(ab, ca);
    if longest <= 0.0 || !longest.is_finite() {
        return ([0.0; 3], true);
    }
    let degenerate = area_2 < DEGENERATE * longest;
    let area_2 = area_2.max(DEGENERATE * longest);
    ([-dot(ab, ca) / area_2, -dot(bc, ab) / area_2, -dot(ca, bc) / area_2], degenerate)
}

/// Weights of the edges ab, ac, ad, bc, bd, cd, and whether the tetrahedron is degenerate.
fn dihedral_weights(p: [DVec3; 4]) -> ([f64; 6], bool) {
    let [a, b, c, d] = p;
    // Twice the area vectors of the faces opposite a, b, c, d; they sum to zero.
    let normals = [(c - b).cross(d - b), (d - a).cross(c - a), (b - a).cross(d - a), (c - a).cross(b - a)];
    let volume_6 = six_volumes(p).abs();
    let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
    let longest = edges.iter().map(|e| e.length_squared()).fold(0.0, f64::max).sqrt();
    let bound = DEGENERATE * longest * longest * longest;
    if bound <= 0.0 || !bound.is_finite() {
        return ([0.0; 6], true);
    }
    // (ℓ/6) cot α = (ℓ/6) cos α / sin α with 4 A_i A_j cos α = -n_i·n_j for outward n and eq. 2.47 for sin α.
    let scale = -1.0 / (6.0 * volume_6.max(bound));
    let weight = |i: usize, j: usize| scale * normals[i].dot(normals[j]);
    let weights = [weight(0, 1), weight(0, 2), weight(0, 3), weight(1, 2), weight(1, 3), weight(2, 3)];
    (weights, volume_6 < bound)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_triangle_has_the_hand_computed_entries() {
        let l = cotangent_laplacian_of_triangles(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], &[[0, 1, 2]]);
        assert_eq!(l.degenerate_elements, 0);
        assert_eq!(vec![l.matrix.get(0, 1), l.matrix.get(0, 2), l.matrix.get(1, 2)], [0.5, 0.5, 0.0]);
        assert_eq!(l.matrix.diagonal(), [-1.0, -0.5, -0.5]);
    }

    #[test]
    fn tetrahedron_follows_the_dihedral_formula_literally() {
        let p = [[0.1, 0.0, 0.2], [1.3, 0.1, 0.0], [0.2, 1.7, 0.3], [0.4, 0.3, 0.9]];
        let mesh = TetrahedralMesh { vertices: p.to_vec(), tetrahedra: vec![[0, 1, 2, 3]] };
        let l = cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix;
        for [i, j, k, m] in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2], [1, 2, 0, 3], [1, 3, 0, 2], [2, 3, 0, 1]] {
            let [pi, pj, pk, pm] = [i, j, k, m].map(|v| DVec3::from(p[v]));
            let axis = (pm - pk).normalize();
            let square_to_axis = |v: DVec3| v - axis * v.dot(axis);
            let angle = square_to_axis(pi - pk).angle_between(square_to_axis(pj - pk));
            let expected = pk.distance(pm) / 6.0 / angle.tan();
            assert!((l.get(i, j) - expected).abs() < 1e-12, "{i}{j}: {} is not {expected}", l.get(i, j));
        }
    }

    #[test]
    fn degenerate_elements_are_counted_and_stay_finite() {
        let vertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]];
        let triangles = [[0, 1, 2], [0, 0, 1], [0, 3, 1], [0, 3, 3]];
        let l = cotangent_laplacian_of_triangles(&vertices, &triangles);
        assert_eq!(l.degenerate_elements, 4);
        assert!(l.matrix.values().iter().all(|v| v.is_finite()));
        let mesh = TetrahedralMesh { vertices: vertices.to_vec(), tetrahedra: vec![[0, 1, 2, 3], [1, 1, 1, 1]] };
        let l = cotangent_laplacian_tetrahedra(&mesh).unwrap();
        assert_eq!(l.degenerate_elements, 2);
        assert!(l.matrix.values().iter().all(|v| v.is_finite()));
    }
}
