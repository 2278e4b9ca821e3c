//! Meshes as plain arrays, and the discrete differential operators on them.
//!
//! A mesh is vertex positions plus an index list (thesis 9.3); there is no half-edge structure.
//! This crate does no I/O, reads no clock and prints nothing.

mod influences;
mod mesh;

pub use influences::{Influences, InfluencesError};
pub use mesh::{MeshError, TetrahedralMesh, TriangleMesh};
