//! The given part of a pose: handles whose transformation is partly known, and points of the shape that are held.

/// What is known about a handle; the rest of its transformation is solved for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum HandleConstraint {
    /// Nothing (green in the thesis).
    #[default]
    Free,
    /// Where its handle point goes (yellow).
    Position,
    /// Its rotation (and scale); its translation is solved for.
    Orientation,
    /// The whole transformation (red).
    Full,
}

/// A point of the deformed shape that can be held: a blend of up to three vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// Zero-based vertices.
    pub vertices: [u32; 3],
    /// Their barycentric coordinates.
    pub barycentric: [f64; 3],
}
