//! Why a monotone function cannot be computed.

use crate::extrema::ExtremaError;
use crate::harmonic::HarmonicError;
use crate::progress::Stopped;
use crate::quadratic::QuadraticError;
use crate::sparse::cholesky::CholeskyError;

/// Why a monotone function cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MonotoneError {
    /// Arrays do not fit each other.
    #[error("{what}: {given} entries where {wanted} are needed")]
    Size {
        /// Which.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length it should have.
        wanted: usize,
    },
    /// A number is not finite or out of range.
    #[error("{what} is {value}; it must be {allowed}")]
    BadNumber {
        /// Which.
        what: &'static str,
        /// The number.
        value: f64,
        /// What it may be.
        allowed: &'static str,
    },
    /// A vertex is given two values.
    #[error("vertex {vertex} is given two values")]
    FixedTwice {
        /// The vertex.
        vertex: usize,
    },
    /// The given values leave no monotone function between them.
    #[error(
        "vertex {below} with value {lower_value} must lie below vertex {above} with value {upper_value}, but there is no \
         room between them: change a value, or where the function has its extrema"
    )]
    Contradiction {
        /// The vertex that must be lower.
        below: usize,
        /// Its value.
        lower_value: f64,
        /// The vertex that must be higher.
        above: usize,
        /// Its value.
        upper_value: f64,
    },
    /// Weights that are to sum to one are given where they do not.
    #[error("the weights given at vertex {vertex} sum to {sum}, and weights solved together must sum to one")]
    NoPartition {
        /// The vertex.
        vertex: usize,
        /// The sum.
        sum: f64,
    },
    /// Solving for so many handles together would take too long and too much memory.
    #[error(
        "{handles} handles on {vertices} vertices are too many to be solved together (handles times vertices may be {most} \
         at most): use fewer, or a coarser mesh, or solve each handle alone with the method monotone"
    )]
    TooManyTogether {
        /// Handles.
        handles: usize,
        /// Vertices.
        vertices: usize,
        /// The most that handles times vertices may be.
        most: usize,
    },
    /// The problem of all handles together is malformed.
    #[error(transparent)]
    Quadratic(QuadraticError),
    /// A threshold that no minimum or no maximum passes.
    #[error("no minimum or no maximum would be kept; the most persistent ones differ by {most} from their saddles")]
    NothingKept {
        /// The largest persistence.
        most: f64,
    },
    /// Where the extrema are to be, or the representative function, is impossible.
    #[error(transparent)]
    Extrema(#[from] ExtremaError),
    /// The representative function cannot be computed.
    #[error(transparent)]
    Harmonic(#[from] HarmonicError),
    /// The matrices are not of the mesh with these neighbours.
    #[error(
        "vertices {a} and {b} are neighbours, but the Laplacian has no entry for them; build it from the same mesh"
    )]
    OtherMesh {
        /// One vertex.
        a: usize,
        /// The other.
        b: usize,
    },
    /// The energy is not positive definite as a computer sees it.
    #[error(
        "the energy of order {order} could not be factorised: {reason}; repair degenerate elements, or use a lower order"
    )]
    Factorisation {
        /// The order.
        order: usize,
        /// Why.
        reason: CholeskyError,
    },
    /// The computation produced infinity or NaN.
    #[error("the values of function {function} are not finite; repair degenerate elements, or use a lower order")]
    NotFinite {
        /// Zero-based function.
        function: usize,
    },
    /// There is not enough memory for the result.
    #[error("not enough memory for {functions} functions on {vertices} vertices")]
    OutOfMemory {
        /// Vertices.
        vertices: usize,
        /// Functions.
        functions: usize,
    },
    /// The progress callback asked to stop.
    #[error("stopped while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}

impl From<Stopped> for MonotoneError {
    fn from(Stopped { stage }: Stopped) -> Self {
        Self::Cancelled { stage }
    }
}
