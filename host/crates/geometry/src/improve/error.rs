//! Why tetrahedra cannot be improved.

use crate::MeshError;

/// Why a mesh was not improved; the mesh is unchanged.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImproveError {
    /// The mesh cannot be used as it is.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// All vertices are within 1e-200 units of the origin, where positions are too coarse.
    #[error("the mesh is smaller than 1e-200 units; scale it up")]
    TooSmall,
    /// There is not one flag per vertex.
    #[error("{given} flags of fixed vertices were given for {vertices} vertices")]
    FixedLength {
        /// Flags.
        given: usize,
        /// Vertices.
        vertices: usize,
    },
    /// There is not one number per vertex.
    #[error("how far the boundary may give way was given for {given} vertices, but there are {vertices}")]
    GiveLength {
        /// Numbers.
        given: usize,
        /// Vertices.
        vertices: usize,
    },
    /// An impossible goal.
    #[error("the smallest dihedral angle must be between 0 and 60 degrees, but is {radians} radians")]
    BadGoal {
        /// As given.
        radians: f64,
    },
    /// A tetrahedron is flat or inside out.
    #[error("tetrahedron {tetrahedron} is flat or inside out; swap two corners or remove it")]
    NotPositive {
        /// Zero-based.
        tetrahedron: usize,
    },
    /// A facet with more than two tetrahedra.
    #[error("facet {facet:?} belongs to {tetrahedra} tetrahedra; at most two can meet there")]
    CrowdedFacet {
        /// Sorted corners.
        facet: [u32; 3],
        /// How many.
        tetrahedra: usize,
    },
    /// Tetrahedra that overlap, or one given twice.
    #[error("facet {facet:?} has two tetrahedra on the same side; remove one of them")]
    SameSide {
        /// Sorted corners.
        facet: [u32; 3],
    },
    /// A locked facet is not in the mesh.
    #[error("locked facet {index} with corners {facet:?} is not a facet of the mesh")]
    LockedFacetMissing {
        /// Zero-based, in the given list.
        index: usize,
        /// As given.
        facet: [u32; 3],
    },
    /// More tetrahedra than 32-bit indices can address.
    #[error("{tetrahedra} tetrahedra are too many; at most {most} can be improved")]
    TooMany {
        /// How many were given.
        tetrahedra: usize,
        /// How many are allowed.
        most: usize,
    },
    /// Tetrahedra that do not meet at facets overlap, and operations made others meet wrongly.
    #[error("tetrahedra overlap each other; make the mesh from points inside only one sheet of the surface")]
    Overlapping,
    /// The progress callback asked to stop.
    #[error("the improvement of tetrahedra was cancelled")]
    Cancelled,
}
