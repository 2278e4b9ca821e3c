//! A bone reduced to its head and tail.

/// A bone as a line segment in the mesh's space and unit. If head and tail coincide it is a point handle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BoneSegment {
    /// Where the bone begins.
    pub head: [f64; 3],
    /// Where it ends.
    pub tail: [f64; 3],
}
