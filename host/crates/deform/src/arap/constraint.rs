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

/// A point of the deformed shape that is held, or pulled.
#[derive(Clone, Debug, PartialEq)]
pub struct Anchor {
    /// Which point.
    pub point: AnchorPoint,
    /// `None`: it is where its target says. Otherwise a spring pulls it there: `½ s ‖x − target‖²` is added to the energy,
    /// in units of the whole shape's resistance if it were compressed to a point, for a distance of the shape's size. 0.1
    /// is weak, 10 strong.
    pub strength: Option<f64>,
}

impl Anchor {
    /// Holds a blend of up to three vertices.
    pub fn on_shape(vertices: [u32; 3], barycentric: [f64; 3]) -> Self {
        Self { point: AnchorPoint::OnShape { vertices, barycentric }, strength: None }
    }
}

/// What an anchor is fixed to.
#[derive(Clone, Debug, PartialEq)]
pub enum AnchorPoint {
    /// A blend of up to three vertices of the shape.
    OnShape {
        /// Zero-based vertices.
        vertices: [u32; 3],
        /// Their barycentric coordinates.
        barycentric: [f64; 3],
    },
    /// A blend of points that each go along with one handle, such as the end of a bone: the zero-based handle, its share
    /// of the blend, and the point at rest (mesh units).
    OnHandles(Vec<(usize, f64, [f64; 3])>),
}
