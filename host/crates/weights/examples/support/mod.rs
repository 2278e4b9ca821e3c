//! What the examples read: a MESH file, and the fixed vertices and their weights as libigl's `boundary_conditions`
//! makes them.

#[path = "../../tests/support/mod.rs"]
mod files;

use std::path::Path;

use armature_geometry::{Lumping, SparseMatrix, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_weights::BiharmonicProblem;

pub(crate) use files::read_npy;

/// A mesh's operators and what is given on it.
pub(crate) struct GivenOnMesh {
    laplacian: SparseMatrix,
    mass: Vec<f64>,
    fixed: Vec<usize>,
    given: Vec<f64>,
    handles: usize,
}

impl GivenOnMesh {
    /// Reads `mesh.mesh`, `b.npy` and `bc.npy`.
    pub(crate) fn read(mesh: &str, fixed: &str, given: &str) -> Self {
        let mesh = files::read_medit(Path::new(mesh));
        let fixed = files::read_npy_indices(Path::new(fixed));
        let given = read_npy(Path::new(given));
        println!("{} vertices, {} tetrahedra, {} handles", mesh.vertices.len(), mesh.tetrahedra.len(), given.columns);
        Self {
            laplacian: cotangent_laplacian_tetrahedra(&mesh).expect("a mesh").matrix,
            mass: lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).expect("a mesh"),
            fixed,
            given: given.values,
            handles: given.columns,
        }
    }

    pub(crate) fn problem(&self) -> BiharmonicProblem<'_> {
        BiharmonicProblem {
            laplacian: &self.laplacian,
            mass: &self.mass,
            fixed: &self.fixed,
            fixed_weights: &self.given,
            handles: self.handles,
            shape_preservation: None,
        }
    }
}
