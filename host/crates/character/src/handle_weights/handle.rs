//! Handles as the user sees them.

use armature_weights::handles::HandleBoundary;

/// One handle as the user sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct HandleShape {
    /// Its name in reports.
    pub name: String,
    /// Where it is.
    pub place: HandlePlace,
}

/// Where a handle is, in the mesh's unit.
#[derive(Clone, Debug, PartialEq)]
pub enum HandlePlace {
    /// A bone from head to tail, and further segments that count as parts of it.
    Segments(Vec<[[f64; 3]; 2]>),
    /// A point.
    Point([f64; 3]),
}

/// Which weights are fixed where.
#[derive(Clone, Copy, Debug)]
pub enum Held<'a> {
    /// Handles.
    Shapes {
        /// They may share vertices, and then share their weights equally. Bones are released near the joints they share
        /// ([`free_joints`](armature_weights::handles::free_joints)).
        shapes: &'a [HandleShape],
        /// Edges of cages, open or closed, as pairs of points among the shapes: weights are linear along them. Their
        /// ends share their vertices with no other handle.
        cage: &'a [[usize; 2]],
    },
    /// Vertices of the mesh itself with given weights; only for weights on [`WeightsOn::OwnElements`](super::WeightsOn::OwnElements).
    Boundary(&'a HandleBoundary),
}

impl Held<'_> {
    /// The handles' names in reports.
    pub(super) fn names(&self) -> Vec<String> {
        match self {
            Self::Shapes { shapes, .. } => shapes.iter().map(|shape| shape.name.clone()).collect(),
            Self::Boundary(boundary) => (1..=boundary.handles).map(|handle| format!("handle {handle}")).collect(),
        }
    }
}
