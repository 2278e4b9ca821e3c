//! Meshes as plain arrays, and the discrete differential operators on them.
//!
//! A mesh is vertex positions plus an index list (thesis 9.3); there is no half-edge structure.
//! This crate does no I/O, reads no clock and prints nothing.

mod box_tree;
mod cotangent_laplacian;
mod delaunay;
mod diagnose;
mod embed;
mod fast_winding_number;
mod fast_winding_number_2d;
mod flipped_components;
mod hierarchy;
mod improve;
mod influences;
mod intrinsic_delaunay;
mod lumped_mass;
mod mesh;
mod normals;
mod orient_patches;
mod planar;
mod predicates;
mod segmentation;
mod self_intersections;
mod sides;
mod simplify;
mod sparse_matrix;
mod subdivide_long_edges;
mod topology;
mod turns;
mod volume;
mod weld;
mod winding_hierarchy;
mod winding_hierarchy_2d;
mod winding_number;

pub use cotangent_laplacian::{
    Laplacian, cotangent_laplacian, cotangent_laplacian_of_triangles, cotangent_laplacian_tetrahedra,
};
pub use delaunay::{DelaunayError, DelaunayTetrahedra, delaunay_tetrahedra};
pub use diagnose::{Diagnosis, diagnose};
pub use embed::{EmbedError, Embedding, SurfacePlaceHint, embed_points};
pub use fast_winding_number::FastWindingNumber;
pub use fast_winding_number_2d::FastWindingNumber2d;
pub use flipped_components::{FlippedComponents, flipped_components};
pub use hierarchy::{ClosestPoint, SegmentHit, TriangleHierarchy, closest_on_segment};
pub use improve::{
    DihedralStatistics, ImproveError, ImproveOutcome, ImproveSettings, Improvement, Operations, dihedral_angles,
    improve_tetrahedra,
};
pub use influences::{Influences, InfluencesError};
pub use intrinsic_delaunay::{IntrinsicLaplacian, intrinsic_delaunay_laplacian};
pub use lumped_mass::{Lumping, lumped_mass, lumped_mass_of_triangles, lumped_mass_tetrahedra};
pub use mesh::{MeshError, TetrahedralMesh, TriangleMesh};
pub use normals::{NormalWeighting, triangle_areas, vertex_normals};
pub use orient_patches::{OrientedPatch, OrientedPatches, PatchVerdict, orient_patches};
pub use planar::{
    FlatMesh, MeshPlane, PlanarDomain, PlanarError, PlanarInput, PlanarReport, PlanarSettings, PlanarShape, Refinement,
    planar_domain, plane_of,
};
pub use segmentation::{
    AddedChain, Connected, ConnectedPieces, Constrained, ConstraintInput, ConstraintOutcome, ConstraintSettings,
    ElementWinding, ElementWindingSettings, HardConstraint, Label, Segmentation, SegmentationError,
    SegmentationSettings, connect_vertices, connected_pieces, element_winding, graph_cut, graph_cut_with_forced_labels,
    make_manifold, satisfy_facets,
};
pub use self_intersections::{SelfIntersections, self_intersections};
pub use simplify::{Simplified, SimplifyError, SimplifyOutcome, SurfacePlace, sample_surface, simplify};
pub use sparse_matrix::{EntryOutOfRange, SparseMatrix};
pub use subdivide_long_edges::{Subdivided, subdivide_long_edges};
pub use topology::{
    Components, Edge, Fans, boundary_edges, connected_components, edges, non_manifold_edges, vertex_triangles,
};
pub use volume::{
    Resolution, ShellShortfall, Volume, VolumeConstraints, VolumeError, VolumeInput, VolumeReport, VolumeSettings,
    VolumeStage, volume,
};
pub use weld::{Weld, weld_vertices};
pub use winding_hierarchy::WindingNumberHierarchy;
pub use winding_hierarchy_2d::WindingNumberHierarchy2d;
pub use winding_number::{winding_number, winding_number_2d};

#[cfg(test)]
extern crate self as armature_geometry;
#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;
