//! What functions on a mesh are computed with.

use armature_geometry::operators::{
    Lumping, SparseMatrix, cotangent_laplacian_tetrahedra, intrinsic_delaunay_laplacian, lumped_mass_tetrahedra,
};
use armature_geometry::surface::weld_vertices;
use armature_geometry::{MeshError, TetrahedralMesh, TriangleMesh};
use glam::DVec3;

use crate::extrema::Neighbours;

/// Neighbours, Laplacian and masses of one mesh, for functions with one value for each vertex.
#[derive(Clone, Debug)]
pub struct FunctionDomain {
    /// n×3, mesh unit.
    pub vertices: Vec<[f64; 3]>,
    /// Which of them share an edge of the mesh.
    pub neighbours: Neighbours,
    /// n×n, with an entry (perhaps zero) for every edge of the mesh.
    pub laplacian: SparseMatrix,
    /// n lumped masses; zero for vertices in no element.
    pub mass: Vec<f64>,
    /// For each vertex of the mesh, its vertex here: those at one place are one.
    pub vertex_of: Vec<u32>,
    /// Elements without a size.
    pub degenerate: usize,
}

impl FunctionDomain {
    /// A surface or a flat figure. The Laplacian is that of its intrinsic Delaunay triangulation, which keeps the maximum
    /// principle on triangles of any shape.
    pub fn of_triangles(mesh: &TriangleMesh) -> Result<Self, MeshError> {
        mesh.validate()?;
        let weld = weld_vertices(&mesh.vertices, 0.0);
        let vertices: Vec<[f64; 3]> = weld.representative.iter().map(|&v| mesh.vertices[v as usize]).collect();
        let corners = mesh.triangles.iter().map(|triangle| triangle.map(|v| weld.welded_of[v as usize]));
        let triangles = corners.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let welded = TriangleMesh { vertices, triangles };
        let intrinsic = intrinsic_delaunay_laplacian(&welded, Lumping::VoronoiHybrid)?;
        let entries = (0..intrinsic.matrix.columns()).flat_map(|column| {
            let entry = move |(row, value): (usize, f64)| (row as u32, column as u32, value);
            intrinsic.matrix.column(column).map(entry)
        });
        let edges = welded.triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let entries = entries.chain(edges.flat_map(|(a, b)| [(a, b, 0.0), (b, a, 0.0)])).collect::<Vec<_>>();
        let n = welded.vertices.len();
        let beyond = |vertex: usize| MeshError::IndexOutOfRange { element: 0, vertex: vertex as u32, vertex_count: n };
        Ok(Self {
            laplacian: SparseMatrix::from_triplets(n, n, &entries).map_err(|e| beyond(e.row))?,
            neighbours: Neighbours::of_elements(n, &welded.triangles).map_err(|_| beyond(n))?,
            mass: intrinsic.mass,
            vertex_of: weld.welded_of,
            degenerate: intrinsic.omitted_triangles + intrinsic.degenerate_triangles,
            vertices: welded.vertices,
        })
    }

    /// A volume.
    pub fn of_tetrahedra(mesh: &TetrahedralMesh) -> Result<Self, MeshError> {
        let laplacian = cotangent_laplacian_tetrahedra(mesh)?;
        let n = mesh.vertices.len();
        let beyond = MeshError::IndexOutOfRange { element: 0, vertex: n as u32, vertex_count: n };
        Ok(Self {
            neighbours: Neighbours::of_elements(n, &mesh.tetrahedra).map_err(|_| beyond)?,
            laplacian: laplacian.matrix,
            mass: lumped_mass_tetrahedra(mesh, Lumping::Barycentric)?,
            vertex_of: (0..n as u32).collect(),
            degenerate: laplacian.degenerate_elements,
            vertices: mesh.vertices.clone(),
        })
    }

    /// A function on the mesh's own vertices: the mean where several are at one place. They must be as many as the mesh
    /// has.
    pub fn gathered(&self, values: &[f64]) -> Vec<f64> {
        let (mut sums, mut counts) = (vec![0.0; self.vertices.len()], vec![0_u32; self.vertices.len()]);
        for (&vertex, value) in self.vertex_of.iter().zip(values) {
            sums[vertex as usize] += value;
            counts[vertex as usize] += 1;
        }
        sums.iter()
            .zip(counts)
            .map(|(sum, count)| if count == 1 { *sum } else { sum / f64::from(count.max(1)) })
            .collect()
    }

    /// A function here as one on the mesh's own vertices.
    pub fn spread(&self, values: &[f64]) -> Vec<f64> {
        self.vertex_of.iter().map(|&vertex| values[vertex as usize]).collect()
    }

    /// The mean length of the mesh's edges; zero if there are none.
    pub fn mean_edge(&self) -> f64 {
        let (mut sum, mut count) = (0.0, 0_usize);
        for vertex in 0..self.vertices.len() {
            for other in self.neighbours.of(vertex).filter(|&other| other > vertex) {
                sum += DVec3::from(self.vertices[vertex]).distance(DVec3::from(self.vertices[other]));
                count += 1;
            }
        }
        if count == 0 { 0.0 } else { sum / count as f64 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seams_are_closed_and_every_edge_has_an_entry() {
        // Two triangles that meet at an edge whose ends are there twice; the other diagonal would be Delaunay.
        let vertices =
            vec![[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 0.5, 0.0], [4.0, 0.0, 0.0], [0.0, 0.0, 0.0], [2.0, -0.5, 0.0]];
        let mesh = TriangleMesh { vertices, triangles: vec![[0, 1, 2], [3, 4, 5]] };
        let domain = FunctionDomain::of_triangles(&mesh).unwrap();
        assert_eq!((domain.vertices.len(), &domain.vertex_of[..]), (4, &[0, 1, 2, 1, 0, 3][..]));
        for vertex in 0..4 {
            for other in domain.neighbours.of(vertex) {
                assert!(domain.laplacian.column(vertex).any(|(row, _)| row == other), "{vertex} {other}");
            }
            assert!(domain.laplacian.column(vertex).map(|(_, value)| value).sum::<f64>().abs() < 1e-12);
        }
        assert!(!domain.neighbours.of(2).any(|other| other == 3), "only edges of the mesh");
        assert!((domain.mass.iter().sum::<f64>() - 2.0).abs() < 1e-12);
        let gathered = domain.gathered(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(gathered, [3.0, 3.0, 3.0, 6.0]);
        assert_eq!(domain.spread(&[0.0, 1.0, 2.0, 3.0]), [0.0, 1.0, 2.0, 1.0, 0.0, 3.0]);
        assert!(domain.mean_edge() > 2.0);
    }
}
