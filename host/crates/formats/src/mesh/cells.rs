//! Cell meshes for other tools: tetrahedra, or triangles of a flat domain, with per-cell data.

use armature_geometry::{TetrahedralMesh, TriangleMesh};

/// A mesh to write for tools that compute on cells.
#[derive(Clone, Copy, Debug)]
pub struct CellMesh<'a> {
    /// n×3 positions, in the mesh's own unit.
    pub vertices: &'a [[f64; 3]],
    /// The mesh's cells.
    pub cells: Cells<'a>,
}

/// The cells of a mesh.
#[derive(Clone, Copy, Debug)]
pub enum Cells<'a> {
    /// m×3 zero-based vertex indices, of a surface or a flat domain.
    Triangles(&'a [[u32; 3]]),
    /// A volume.
    Tetrahedra {
        /// m×4 zero-based vertex indices.
        tetrahedra: &'a [[u32; 4]],
        /// The volume's surface, for formats that store it beside the tetrahedra; empty to omit it.
        surface: &'a [[u32; 3]],
    },
}

/// One number for every cell (not for the triangles of a volume's surface).
#[derive(Clone, Copy, Debug)]
pub struct CellData<'a> {
    /// The name that other tools show.
    pub name: &'a str,
    /// One number per cell, in their order.
    pub values: &'a [f64],
}

/// The data do not match this mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} has {values} numbers for {cells} cells; give one for each cell")]
pub struct CellDataLength {
    /// The data's name.
    pub name: String,
    /// How many numbers there are.
    pub values: usize,
    /// How many cells there are.
    pub cells: usize,
}

impl<'a> CellMesh<'a> {
    /// A volume, with its surface or without (empty).
    pub fn of_tetrahedra(mesh: &'a TetrahedralMesh, surface: &'a [[u32; 3]]) -> Self {
        let cells = Cells::Tetrahedra { tetrahedra: &mesh.tetrahedra, surface };
        Self { vertices: &mesh.vertices, cells }
    }

    /// A surface or a flat domain.
    pub fn of_triangles(mesh: &'a TriangleMesh) -> Self {
        Self { vertices: &mesh.vertices, cells: Cells::Triangles(&mesh.triangles) }
    }

    /// The triangles, whether cells or a volume's surface.
    pub(crate) fn triangles(&self) -> &'a [[u32; 3]] {
        match self.cells {
            Cells::Triangles(triangles) => triangles,
            Cells::Tetrahedra { surface, .. } => surface,
        }
    }

    /// The number of cells that data refer to.
    pub(crate) fn cell_count(&self) -> usize {
        match self.cells {
            Cells::Triangles(triangles) => triangles.len(),
            Cells::Tetrahedra { tetrahedra, .. } => tetrahedra.len(),
        }
    }

    /// Checks that every list of data has one number per cell.
    pub(crate) fn check(&self, data: &[CellData]) -> Result<(), CellDataLength> {
        let cells = self.cell_count();
        match data.iter().find(|d| d.values.len() != cells) {
            Some(d) => Err(CellDataLength { name: d.name.to_owned(), values: d.values.len(), cells }),
            None => Ok(()),
        }
    }
}
