//! What can be wrong with a problem.

/// Why there is no solution.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FairingError {
    /// A vertex that does not exist.
    #[error("vertex {vertex} does not exist; there are {count}")]
    NoSuchVertex {
        /// Zero-based.
        vertex: u32,
        /// How many there are.
        count: usize,
    },
    /// A triangle shrunk to a point or a repeated corner, or with a length that is not a number.
    #[error("triangle {triangle} has two corners at one place, or an edge without a finite length")]
    NoSize {
        /// Zero-based.
        triangle: usize,
    },
    /// A list of values does not fit the conditions.
    #[error("{given} {what} are given, {wanted} are needed")]
    WrongCount {
        /// What the list holds.
        what: &'static str,
        /// Its length.
        given: usize,
        /// What its length should be.
        wanted: usize,
    },
    /// A value is NaN or infinite.
    #[error("one of the {what} is not a finite number")]
    NotFinite {
        /// What the list holds.
        what: &'static str,
    },
    /// A vertex is held twice.
    #[error("vertex {vertex} is given two values")]
    Twice {
        /// Zero-based.
        vertex: u32,
    },
    /// A derivative is given along an edge that does not bound the domain.
    #[error("no border of the domain runs along the edge from vertex {} to {}", .edge[0], .edge[1])]
    NotABorder {
        /// The edge.
        edge: [u32; 2],
    },
    /// A Laplacian is given where the value is not.
    #[error("vertex {vertex} has a given Laplacian, but no given value")]
    BentButFree {
        /// Zero-based.
        vertex: u32,
    },
    /// A Laplacian is given at a vertex of the triharmonic problem that no border with a given tangent touches, so that
    /// the row of vertices next to it cannot be found.
    #[error("vertex {vertex} has a given Laplacian, but no border with a given tangent next to vertex {beside}")]
    NoTangent {
        /// Zero-based.
        vertex: u32,
        /// The free vertex beside it.
        beside: u32,
    },
    /// Everything is held.
    #[error("no vertex is free: there is nothing to solve for")]
    NothingFree,
    /// Tangents and values together leave no vertex free: the patch is one row of triangles wide.
    #[error(
        "the conditions are over-determined: tangents along the border already place all {inferred} inner vertices; \
         refine the patch, or give no second derivatives"
    )]
    OnlyRows {
        /// Vertices that tangents place.
        inferred: usize,
    },
    /// System (3.18) has more equations than unknowns near the border.
    #[error(
        "the conditions are over-determined: {held} border vertices fix derivatives of only {beside} vertices beside \
         them, as at vertices {} and {}, which meet nothing free but vertex {only}; reduce them to two rows",
        .pair[0], .pair[1]
    )]
    OverDetermined {
        /// Border vertices with a given Laplacian.
        held: usize,
        /// Free vertices next to them.
        beside: usize,
        /// Two border vertices that meet only one free vertex, the same (thesis, proposition 2).
        pair: [u32; 2],
        /// That vertex.
        only: u32,
    },
    /// System (3.18) is singular in a way that no pair of vertices shows.
    #[error(
        "the conditions are over-determined: {held} border vertices fix derivatives of {beside} vertices beside them, \
         and the system is singular; reduce them to two rows"
    )]
    Singular {
        /// Border vertices with a given Laplacian.
        held: usize,
        /// Free vertices next to them.
        beside: usize,
    },
    /// A connected part of the domain has no held vertex.
    #[error("vertex {vertex} is connected to no vertex that is held")]
    Adrift {
        /// A free vertex of that part.
        vertex: u32,
    },
    /// A free vertex, or one next to it, belongs to no area.
    #[error("vertex {vertex} belongs to no triangle with an area")]
    NoArea {
        /// Zero-based.
        vertex: u32,
    },
    /// The triangles are so bad that the factorisation broke down.
    #[error("the system cannot be factorised: its triangles are too thin ({slivers} slivers)")]
    Breakdown {
        /// Triangles whose area had to be raised.
        slivers: usize,
    },
    /// The factorisation does not fit in memory.
    #[error("not enough memory for the factorisation of {unknowns} unknowns")]
    OutOfMemory {
        /// Unknowns.
        unknowns: usize,
    },
}
