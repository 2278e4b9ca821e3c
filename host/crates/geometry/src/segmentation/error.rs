//! Why elements cannot be segmented.

/// Why elements could not be segmented.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SegmentationError {
    /// An array that should have one row per element has a different length.
    #[error("there are {found} {what} for {elements} elements; give one per element")]
    WrongLength {
        /// Which array.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many elements there are.
        elements: usize,
    },
    /// A winding number is NaN, infinite, or larger than any mesh's number of facets.
    #[error("element {element} has the winding number {value}; check the surface for coordinates that are not finite")]
    BadWinding {
        /// Zero-based element.
        element: usize,
        /// Its winding number.
        value: f64,
    },
    /// A facet's size is negative, NaN or infinite.
    #[error("element {element} has a facet whose size is not a finite number of zero or more")]
    BadFacetSize {
        /// Zero-based element.
        element: usize,
    },
    /// An area or volume is negative, NaN or infinite.
    #[error("element {element} has the measure {value}, which is not a finite number of zero or more; is it inverted?")]
    BadMeasure {
        /// Zero-based element.
        element: usize,
        /// Its measure.
        value: f64,
    },
    /// A neighbour that does not exist, is the element itself, or does not have the element as its neighbour.
    #[error("element {element} lists {neighbour} as a neighbour, which is not one; neighbours must list each other")]
    BadNeighbour {
        /// Zero-based element.
        element: usize,
        /// The neighbour it lists.
        neighbour: u32,
    },
    /// A corner that is not a vertex.
    #[error("element {element} has the corner {vertex}, but there are only {vertices} vertices")]
    BadCorner {
        /// Zero-based element.
        element: usize,
        /// The corner.
        vertex: u32,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A corner whose coordinates are not finite.
    #[error("element {element} has the corner {vertex}, whose coordinates are not all finite numbers")]
    BadCoordinate {
        /// Zero-based element.
        element: usize,
        /// The corner.
        vertex: u32,
    },
    /// A corner that an element has more than once.
    #[error("element {element} has the corner {vertex} more than once; remove degenerate elements")]
    RepeatedCorner {
        /// Zero-based element.
        element: usize,
        /// The corner.
        vertex: u32,
    },
    /// A facet of an element that does not exist.
    #[error("facet {facet} refers to element {element}, but there are only {elements}; use u32::MAX beyond the hull")]
    BadFacet {
        /// Zero-based facet.
        facet: usize,
        /// The element it refers to.
        element: u32,
        /// How many elements there are.
        elements: usize,
    },
    /// Settings out of range.
    #[error("{what} cannot be {value}; see the settings for valid values")]
    BadSetting {
        /// Which one.
        what: &'static str,
        /// Its value.
        value: f64,
    },
    /// More elements than 32-bit indices can address.
    #[error("{elements} elements are more than 32-bit indices can address; use a coarser tessellation")]
    TooManyElements {
        /// How many there are.
        elements: usize,
    },
    /// The progress callback asked to stop.
    #[error("the segmentation was cancelled")]
    Cancelled,
}
