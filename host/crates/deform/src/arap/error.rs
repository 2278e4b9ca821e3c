//! Why a shape cannot be reduced or solved.

/// Why a shape cannot be reduced or solved.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ArapError {
    /// There are no vertices, no elements or no handles.
    #[error("the shape has no {what}")]
    Empty {
        /// Which of them.
        what: &'static str,
    },
    /// Two arrays that must have matching lengths do not.
    #[error("{what}: {got} given, {expected} needed")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it must have.
        expected: usize,
    },
    /// An element refers to a vertex that does not exist.
    #[error("element {element} refers to vertex {vertex}, but there are only {vertex_count} vertices")]
    VertexOutOfRange {
        /// Zero-based element (or anchor).
        element: usize,
        /// The offending zero-based vertex.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// A joint refers to a handle that does not exist.
    #[error("joint {joint} refers to handle {handle}, but there are only {handle_count} handles")]
    HandleOutOfRange {
        /// Zero-based joint.
        joint: usize,
        /// The offending zero-based handle.
        handle: usize,
        /// How many handles there are.
        handle_count: usize,
    },
    /// A vertex follows a handle that does not exist.
    #[error("vertex {vertex} follows handle {handle}, but there are only {handle_count} handles")]
    WeightOutOfRange {
        /// Zero-based vertex.
        vertex: usize,
        /// The offending zero-based handle.
        handle: usize,
        /// How many handles there are.
        handle_count: usize,
    },
    /// A number is NaN, infinite or beyond 1e30.
    #[error("{what} {index} has a number that is not finite or beyond 1e30")]
    NotFinite {
        /// Which array.
        what: &'static str,
        /// Zero-based row.
        index: usize,
    },
    /// A vertex follows no handle and would collapse to the origin.
    #[error("vertex {vertex} has no weight on any handle")]
    Unweighted {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// A soft joint has a stiffness or strength below 0 or above 10,000, or a limit that excludes the rest pose or is
    /// NaN.
    #[error(
        "soft joint {joint} cannot be used: stiffness and strength must be from 0 to 10,000, a swing from 0 to π, twists from -π to 0 and from 0 to π"
    )]
    UnusableSoftJoint {
        /// Zero-based soft joint.
        joint: usize,
    },
    /// More rotation clusters were requested than memory allows.
    #[error("{clusters} rotation clusters are too many (at most {most}); set `clusters` to fewer")]
    TooManyClusters {
        /// How many the settings and the shape lead to.
        clusters: usize,
        /// The most that this kind of global step takes.
        most: usize,
    },
    /// The progress callback asked to stop.
    #[error("cancelled")]
    Cancelled,
}

pub(super) fn expect_length(what: &'static str, got: usize, expected: usize) -> Result<(), ArapError> {
    if got == expected { Ok(()) } else { Err(ArapError::Length { what, got, expected }) }
}
