//! Why no volume could be made.

use crate::MeshError;
use crate::delaunay::DelaunayError;
use crate::embed::EmbedError;
use crate::improve::ImproveError;
use crate::segmentation::SegmentationError;

/// Why no volume could be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// The surface cannot be used as it is.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A bone or point handle has no position.
    #[error("{what} {index} has a coordinate that is not a finite number")]
    NotFinite {
        /// "bone" or "point".
        what: &'static str,
        /// Zero-based.
        index: usize,
    },
    /// The points have no tetrahedra.
    #[error(transparent)]
    Delaunay(DelaunayError),
    /// The triangles have no area.
    #[error("no triangle of the surface has an area; there is nothing to make a volume for")]
    NoArea,
    /// Settings out of range, or numbers too large to compute with.
    #[error("the surface could not be segmented: {0}")]
    Segmentation(SegmentationError),
    /// Slivers could not be removed.
    #[error("slivers could not be removed: {0}")]
    Improvement(ImproveError),
    /// The surface's vertices could not be located in the volume.
    #[error("the surface's vertices could not be located in the volume: {0}")]
    Embedding(#[from] EmbedError),
    /// A bone or point has no element around it.
    #[error("a bone or point is where no element could be kept; move it nearer to the surface")]
    HandleLost,
    /// All vertices are in one plane.
    #[error("the surface is flat, so it has no volume; a flat shape has a planar domain instead")]
    Flat,
    /// Nothing is inside.
    #[error("the surface encloses nothing: it may be a flat sheet, or its triangles may face all ways")]
    Empty,
    /// The progress callback asked to stop.
    #[error("making the volume was cancelled")]
    Cancelled,
}

impl From<DelaunayError> for VolumeError {
    fn from(error: DelaunayError) -> Self {
        match error {
            DelaunayError::Cancelled => Self::Cancelled,
            error => Self::Delaunay(error),
        }
    }
}

impl From<SegmentationError> for VolumeError {
    fn from(error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled => Self::Cancelled,
            error => Self::Segmentation(error),
        }
    }
}
