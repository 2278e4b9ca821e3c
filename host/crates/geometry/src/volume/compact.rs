//! Removes vertices that no element uses.

use crate::TetrahedralMesh;

/// `mesh` without unused vertices, and the new number of each vertex. The used vertices among `first` come first, in
/// that order; the others keep their order.
pub(super) fn compact(mesh: &TetrahedralMesh, first: impl Iterator<Item = u32>) -> (TetrahedralMesh, Vec<Option<u32>>) {
    let mut used = vec![false; mesh.vertices.len()];
    for &vertex in mesh.tetrahedra.iter().flatten() {
        used[vertex as usize] = true;
    }
    let mut number_of = vec![None; mesh.vertices.len()];
    let mut vertices = Vec::new();
    for vertex in first.chain(0..mesh.vertices.len() as u32) {
        let vertex = vertex as usize;
        if used[vertex] && number_of[vertex].is_none() {
            number_of[vertex] = Some(vertices.len() as u32);
            vertices.push(mesh.vertices[vertex]);
        }
    }
    let number = |v: u32| number_of[v as usize].unwrap_or(0);
    let tetrahedra = mesh.tetrahedra.iter().map(|t| t.map(number)).collect();
    (TetrahedralMesh { vertices, tetrahedra }, number_of)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unused_vertices_go_and_wanted_ones_come_first() {
        let vertices: Vec<[f64; 3]> = (0..7).map(|k| [f64::from(k), 0.0, 0.0]).collect();
        let mesh = TetrahedralMesh { vertices, tetrahedra: vec![[1, 2, 4, 5], [1, 2, 5, 6]] };
        let (compacted, number_of) = compact(&mesh, [5, 3, 1].into_iter());
        assert_eq!(number_of, [None, Some(1), Some(2), None, Some(3), Some(0), Some(4)]);
        assert_eq!(compacted.tetrahedra, [[1, 2, 3, 0], [1, 2, 0, 4]]);
        assert_eq!(compacted.vertices.iter().map(|p| p[0]).collect::<Vec<_>>(), [5.0, 1.0, 2.0, 4.0, 6.0]);
    }
}
