//! Why the weights could not be computed.

use armature_weights::biharmonic::BiharmonicError;
use armature_weights::extrema::ExtremaError;
use armature_weights::handles::{HandleError, MOST_FREE_NEAR_JOINTS};
use armature_weights::monotone::MonotoneError;

use crate::volume::MakeError;

/// Why the weights could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HandleWeightsError {
    /// No handle holds a vertex.
    #[error("none of the {handles} handles holds any part of the shape; check that they are inside it and in its unit")]
    NothingHeld {
        /// Handles given.
        handles: usize,
    },
    /// Vertices were fixed by number, but the weights are not computed on the mesh's own elements.
    #[error("weights can only be fixed at vertices of the mesh's own elements")]
    BoundaryElsewhere,
    /// Bones cannot be released over this fraction of their length.
    #[error(
        "bones can be released over 0 to {MOST_FREE_NEAR_JOINTS} of their length at shared joints, not over {share}"
    )]
    JointRelease {
        /// The fraction requested.
        share: f64,
    },
    /// An edge of a cage must join two points.
    #[error("edge {edge} of the cage does not join two of the points", edge = .edge + 1)]
    CageEdge {
        /// Zero-based edge.
        edge: usize,
    },
    /// A point of a cage is at another handle's place.
    #[error("{first} and {second} are at the same place, but a point of a cage must be alone there; move one of them")]
    CagePoint {
        /// One handle's name.
        first: String,
        /// The other's.
        second: String,
    },
    /// An edge of a cage passes through another handle's vertex, or one of another edge with different weights.
    #[error("the edge of the cage between {from} and {to} passes through another handle; let it end there")]
    CageCrossed {
        /// The name of the handle where it starts.
        from: String,
        /// Where it ends.
        to: String,
    },
    /// There is no volume.
    #[error(transparent)]
    Volume(#[from] MakeError),
    /// The handles do not fit the elements.
    #[error(transparent)]
    Handles(#[from] HandleError),
    /// The weights could not be computed.
    #[error(transparent)]
    Biharmonic(BiharmonicError),
    /// Monotone weights could not be computed.
    #[error(transparent)]
    Monotone(MonotoneError),
    /// Extrema of the weights could not be counted.
    #[error(transparent)]
    Extrema(#[from] ExtremaError),
    /// The progress callback asked to stop.
    #[error("computing the weights was cancelled while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}

impl From<BiharmonicError> for HandleWeightsError {
    fn from(error: BiharmonicError) -> Self {
        match error {
            BiharmonicError::Cancelled { stage } => Self::Cancelled { stage },
            other => Self::Biharmonic(other),
        }
    }
}

impl From<MonotoneError> for HandleWeightsError {
    fn from(error: MonotoneError) -> Self {
        match error {
            MonotoneError::Cancelled { stage } => Self::Cancelled { stage },
            other => Self::Monotone(other),
        }
    }
}
