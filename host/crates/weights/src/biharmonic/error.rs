//! Why bounded biharmonic weights could not be computed.

use crate::progress::Stopped;
use crate::sparse::cholesky::CholeskyError;

/// Why the weights could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BiharmonicError {
    /// No vertex has a given weight.
    #[error("no vertex belongs to a handle; sample every handle with vertices of the mesh")]
    NoHandles,
    /// Array sizes do not match.
    #[error("{what} has {given} entries but needs {wanted}")]
    Size {
        /// Which array.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length it should have.
        wanted: usize,
    },
    /// A matrix has an entry that is not finite, or is not symmetric.
    #[error("{what} is not a finite symmetric matrix (column {column}); rebuild it from a mesh with finite vertices")]
    BadMatrix {
        /// Which matrix.
        what: &'static str,
        /// Zero-based column.
        column: usize,
    },
    /// A vertex of the mesh has no volume or area.
    #[error("vertex {vertex} has mass {mass}; every vertex of an element needs a positive mass")]
    BadMass {
        /// Zero-based vertex.
        vertex: usize,
        /// Its mass.
        mass: f64,
    },
    /// A fixed vertex does not exist.
    #[error("vertex {vertex} is given a weight, but the mesh has only {vertices} vertices")]
    NoSuchVertex {
        /// The vertex.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// Two handles claim one vertex.
    #[error("vertex {vertex} is given weights twice; move one of its handles or let them share the vertex")]
    FixedTwice {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// A handle that holds no vertex has no weights.
    #[error("handle {handle} holds no vertex; it may lie outside the mesh or be hidden by another handle")]
    EmptyHandle {
        /// Zero-based handle.
        handle: usize,
    },
    /// A given weight is NaN or outside the bounds.
    #[error("handle {handle} is given weight {weight} at vertex {vertex}; weights must be between 0 and 1")]
    BadFixedWeight {
        /// Zero-based handle.
        handle: usize,
        /// Zero-based vertex.
        vertex: usize,
        /// The value.
        weight: f64,
    },
    /// Weights are to sum to one exactly, but the given ones do not.
    #[error("the weights given at vertex {vertex} sum to {sum}; they must sum to one there to sum to one everywhere")]
    NoPartition {
        /// Zero-based vertex.
        vertex: usize,
        /// Their sum.
        sum: f64,
    },
    /// A setting is out of range.
    #[error("the setting {name} is {value}; it must be {allowed}")]
    BadSetting {
        /// The setting's name.
        name: &'static str,
        /// The value given.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// The Hessian could not be factorised.
    #[error("the energy could not be factorised: {0}; repair the mesh's degenerate elements and try again")]
    Factorisation(#[from] CholeskyError),
    /// The computation produced infinity or NaN.
    #[error("the weights of handle {handle} are not finite; repair the mesh's degenerate elements and try again")]
    NotFinite {
        /// Zero-based handle.
        handle: usize,
    },
    /// The dense weights do not fit in memory.
    #[error("not enough memory for the weights of {vertices} vertices on {handles} handles")]
    OutOfMemory {
        /// Vertices of the mesh.
        vertices: usize,
        /// Handles.
        handles: usize,
    },
    /// The progress callback asked to stop.
    #[error("stopped while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}

impl From<Stopped> for BiharmonicError {
    fn from(Stopped { stage }: Stopped) -> Self {
        Self::Cancelled { stage }
    }
}
