//! Areas and normals.

use glam::DVec3;

use crate::{MeshError, TriangleMesh};

/// How much each triangle around a vertex contributes to its normal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NormalWeighting {
    /// By its area.
    Area,
    /// By its angle at the vertex: independent of how a face is cut into triangles, and on a closed surface a point
    /// closest to a vertex is outside exactly if this normal points towards it (Bærentzen & Aanæs 2005).
    #[default]
    Angle,
}

/// Area of every triangle, mesh unit squared.
pub fn triangle_areas(mesh: &TriangleMesh) -> Result<Vec<f64>, MeshError> {
    mesh.validate()?;
    Ok(mesh.triangles.iter().map(|corners| 0.5 * doubled_area_vector(mesh, *corners).length()).collect())
}

/// Unit normal of every vertex, pointing outward where triangles run counter-clockwise seen from outside; zero where a
/// vertex has no triangle with an area or where the normals around it cancel.
pub fn vertex_normals(mesh: &TriangleMesh, weighting: NormalWeighting) -> Result<Vec<[f64; 3]>, MeshError> {
    mesh.validate()?;
    let mut sums = vec![DVec3::ZERO; mesh.vertices.len()];
    for &corners in &mesh.triangles {
        let area_vector = doubled_area_vector(mesh, corners);
        for k in 0..3 {
            let contribution = match weighting {
                NormalWeighting::Area => area_vector,
                NormalWeighting::Angle => {
                    let at = DVec3::from(mesh.vertices[corners[k] as usize]);
                    let to_next = DVec3::from(mesh.vertices[corners[(k + 1) % 3] as usize]) - at;
                    let to_last = DVec3::from(mesh.vertices[corners[(k + 2) % 3] as usize]) - at;
                    let angle = libm::atan2(to_next.cross(to_last).length(), to_next.dot(to_last));
                    area_vector.normalize_or_zero() * angle
                }
            };
            sums[corners[k] as usize] += contribution;
        }
    }
    Ok(sums.iter().map(|sum| sum.normalize_or_zero().to_array()).collect())
}

fn doubled_area_vector(mesh: &TriangleMesh, corners: [u32; 3]) -> DVec3 {
    let [a, b, c] = corners.map(|v| DVec3::from(mesh.vertices[v as usize]));
    (b - a).cross(c - a)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube whose corner normals would lean towards the doubly counted faces if weighted by area.
    fn cube() -> TriangleMesh {
        let vertices = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|c| f64::from(c) * 2.0 - 1.0)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        TriangleMesh { vertices, triangles }
    }

    #[test]
    fn angle_weighted_corner_normals_of_a_cube_are_diagonals() {
        let mesh = cube();
        let normals = vertex_normals(&mesh, NormalWeighting::Angle).unwrap();
        for (normal, vertex) in normals.iter().zip(&mesh.vertices) {
            let diagonal = DVec3::from(*vertex).normalize();
            assert!(DVec3::from(*normal).distance(diagonal) < 1e-12);
        }
        assert_eq!(triangle_areas(&mesh).unwrap(), vec![2.0; 12]);
    }

    #[test]
    fn vertices_without_area_have_no_normal() {
        let mesh = TriangleMesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [5.0; 3]],
            triangles: vec![[0, 1, 2]],
        };
        for weighting in [NormalWeighting::Area, NormalWeighting::Angle] {
            assert_eq!(vertex_normals(&mesh, weighting).unwrap(), vec![[0.0; 3]; 4]);
        }
    }
}
