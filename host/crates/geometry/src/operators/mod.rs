//! Discrete differential operators: Laplacians, mass matrices, and the sparse matrix that they come in.
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::operators::{Lumping, cotangent_laplacian, lumped_mass};
//! # let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! # let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! # let octahedron = TriangleMesh { vertices, triangles };
//! let laplacian = cotangent_laplacian(&octahedron)?.matrix;
//! let constant = laplacian.multiply(&[1.0; 6]);
//! assert!(constant.iter().all(|x| x.abs() < 1e-12), "constants are harmonic");
//! let area: f64 = lumped_mass(&octahedron, Lumping::Barycentric)?.iter().sum();
//! assert!((area - 4.0 * 3.0_f64.sqrt()).abs() < 1e-12);
//! # Ok::<(), armature_geometry::MeshError>(())
//! ```

mod cotangent_laplacian;
mod intrinsic_delaunay;
mod lumped_mass;
mod sparse_matrix;

pub use cotangent_laplacian::{
    Laplacian, cotangent_laplacian, cotangent_laplacian_of_triangles, cotangent_laplacian_tetrahedra,
};
pub use intrinsic_delaunay::{IntrinsicLaplacian, intrinsic_delaunay_laplacian};
pub use lumped_mass::{Lumping, lumped_mass, lumped_mass_of_triangles, lumped_mass_tetrahedra};
pub use sparse_matrix::{EntryOutOfRange, SparseMatrix};
