//! What gives way to a new point.

/// Tetrahedra that give way to a new point, and the facets around them.
#[derive(Default)]
pub(super) struct Region {
    /// Connected; the selected ones, unless some were rejected since.
    pub(super) tets: Vec<u32>,
    /// Between them and what stays.
    pub(super) boundary: Vec<BoundaryFacet>,
}

/// A facet between a tetrahedron that gives way and one that stays.
#[derive(Clone, Copy)]
pub(super) struct BoundaryFacet {
    /// The tetrahedron that gives way.
    pub(super) inner: u32,
    /// Its corner opposite the facet.
    pub(super) slot: u8,
    /// What takes its place.
    pub(super) new: u32,
}
