//! Why an outline cannot be filled.

use crate::MeshError;
use crate::segmentation::SegmentationError;

/// Why an outline cannot be filled.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlanarError {
    /// The outline or mesh itself is unsound.
    #[error("the outline cannot be used: {0}")]
    Shape(MeshError),
    /// A bone's end is NaN, infinite or beyond 1e60.
    #[error("bone {bone} has an end that is not a finite number below 1e60")]
    BoneNotFinite {
        /// Zero-based bone.
        bone: usize,
    },
    /// A point handle is NaN, infinite or beyond 1e60.
    #[error("point handle {point} has a coordinate that is not a finite number below 1e60")]
    PointNotFinite {
        /// Zero-based point handle.
        point: usize,
    },
    /// All vertices at one place.
    #[error("all vertices of the outline are at one place, or within 1e-60; an area needs three places")]
    NoArea,
    /// A setting out of range.
    #[error("{what} cannot be {value}; see the settings for valid values")]
    BadSetting {
        /// Which one.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// Segments cross so often that splitting them would need too many vertices.
    #[error("segments cross more than {most} times; clean the outline, or allow more vertices")]
    TooManyCrossings {
        /// How often they may.
        most: usize,
    },
    /// Coordinates are not precise enough to separate places.
    #[error("the outline has details too fine for its distance from the origin; move it nearer to the origin")]
    Precision,
    /// No triangle has enough winding number.
    #[error("the outline has no inside: it is a line, its pieces cancel, or its gaps are too wide; close it")]
    NothingInside,
    /// The segmentation failed.
    #[error("the inside cannot be separated from the outside: {0}")]
    Segmentation(SegmentationError),
    /// The progress callback asked to stop.
    #[error("the filling of the outline was cancelled")]
    Cancelled,
}

impl From<SegmentationError> for PlanarError {
    fn from(error: SegmentationError) -> Self {
        match error {
            SegmentationError::Cancelled => Self::Cancelled,
            other => Self::Segmentation(other),
        }
    }
}

impl From<MeshError> for PlanarError {
    fn from(error: MeshError) -> Self {
        Self::Shape(error)
    }
}
