//! Meshes: readers of OBJ, OFF, PLY, STL and Medit MESH (all behind [`read_model`](crate::read_model)), and writers.
//!
//! [`write_obj`] writes a surface. For tools that compute on cells, a [`CellMesh`] (triangles or tetrahedra, with
//! per-cell data) can be written as Medit MESH, Gmsh MSH or VTK grid: [`write_mesh`], [`write_msh`], [`write_vtu`].

mod cells;
mod gmsh;
pub(crate) mod medit;
pub(crate) mod obj;
pub(crate) mod off;
mod off_binary;
mod off_layout;
pub(crate) mod ply;
mod polygon;
pub(crate) mod stl;
mod vtu;

pub use cells::{CellData, CellDataLength, CellMesh, Cells};
pub use gmsh::write_msh;
pub use medit::write_mesh;
pub use obj::write_obj;
pub use vtu::write_vtu;
