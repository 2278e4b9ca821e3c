//! What can be wrong with a function on a mesh and its extrema.

/// Why extrema cannot be found or arranged.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum ExtremaError {
    /// An element, or an extremum, names a vertex that does not exist.
    #[error("vertex {vertex} does not exist: there are {vertices}")]
    NoSuchVertex {
        /// The vertex.
        vertex: usize,
        /// How many there are.
        vertices: usize,
    },
    /// The function does not have one value for each vertex.
    #[error("{values} values for {vertices} vertices")]
    Size {
        /// How many values were given.
        values: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A value is not a number.
    #[error("the value {value} at vertex {vertex} is not a finite number")]
    NotFinite {
        /// The vertex.
        vertex: usize,
        /// Its value.
        value: f64,
    },
    /// A vertex was named both a minimum and a maximum.
    #[error("vertex {vertex} is to be both a minimum and a maximum")]
    Both {
        /// The vertex.
        vertex: usize,
    },
    /// Every piece of a mesh needs both, unless the function is constant there.
    #[error("the piece of the mesh around vertex {vertex} has no {lacking}; name one there, or leave the piece out")]
    Lacking {
        /// A vertex of the piece.
        vertex: usize,
        /// `minimum` or `maximum`.
        lacking: &'static str,
    },
    /// What hangs on a single vertex has an extremum whatever its values are, unless they are all equal.
    #[error(
        "vertex {vertex} has no room: it cannot have both a lower and a higher neighbour; it hangs on the mesh by one \
         vertex, or given extrema surround it"
    )]
    NoRoom {
        /// The vertex.
        vertex: usize,
    },
}
