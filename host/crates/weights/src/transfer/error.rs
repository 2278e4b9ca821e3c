//! Why weights were not transferred.

use armature_geometry::MeshError;

use crate::sparse::cholesky::CholeskyError;

/// Why weights were not transferred.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TransferError {
    /// A mesh has no triangles, or an index or coordinate is not usable.
    #[error("the {which} mesh is not usable: {error}")]
    Mesh {
        /// `source` or `target`.
        which: &'static str,
        /// What is wrong.
        error: MeshError,
    },
    /// There are not as many rows of weights as vertices.
    #[error("{rows} rows of weights for {vertices} vertices")]
    RowCount {
        /// Rows given.
        rows: usize,
        /// Vertices of the mesh.
        vertices: usize,
    },
    /// A weight is NaN, infinite or negative, or a row has none.
    #[error("the weights of vertex {vertex} are not positive finite numbers")]
    BadRow {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// The largest distance or angle is not a positive number.
    #[error("the largest {what} of a match has to be a positive number")]
    Limit {
        /// `distance` or `angle`.
        what: &'static str,
    },
    /// The smoothest weights could not be solved for.
    #[error("the weights between could not be solved for: {0}; repair degenerate triangles of the mesh")]
    Factorisation(#[from] CholeskyError),
    /// The progress callback asked to stop.
    #[error("the transfer of weights was cancelled while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}
