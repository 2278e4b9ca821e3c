//! Meshes as plain arrays, and the geometry that weights and deformation build on: properties of a surface, what it
//! encloses, a volume for it, and the differential operators on both.
//!
//! A mesh is vertex positions plus an index list (thesis 9.3); there is no half-edge structure. Functions take slices
//! and return owned results. Nothing here does I/O, reads a clock or prints. Results do not depend on the number of
//! threads.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::volume::{Resolution, VolumeInput, VolumeSettings, volume};
//! use armature_geometry::{TriangleMesh, operators, winding::FastWindingNumber};
//!
//! // An octahedron of radius 1.
//! let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! let triangles =
//!     vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! let surface = TriangleMesh { vertices, triangles };
//! let winding = FastWindingNumber::precompute(&surface)?;
//! assert!(winding.evaluate([0.1, 0.2, 0.0]) > 0.99 && winding.evaluate([2.0, 0.0, 0.0]).abs() < 0.01);
//!
//! let bone = [[-0.5, 0.0, 0.0], [0.5, 0.0, 0.0]];
//! let input = VolumeInput { surface: &surface, segments: &[bone], points: &[] };
//! let settings = VolumeSettings { resolution: Resolution::Conforming, ..VolumeSettings::default() };
//! let solid = volume(&input, &settings, &mut |_stage, _fraction| ControlFlow::Continue(()))?;
//! assert!((solid.report.volume - 4.0 / 3.0).abs() < 1e-9 && solid.segment_vertices[0].len() >= 2);
//! let laplacian = operators::cotangent_laplacian_tetrahedra(&solid.mesh)?;
//! assert_eq!(laplacian.degenerate_elements, 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Contents
//!
//! | module | verbs |
//! |---|---|
//! | [`surface`] | [`diagnose`](surface::diagnose), [`weld_vertices`](surface::weld_vertices), [`vertex_normals`](surface::vertex_normals), [`edges`](surface::edges), [`connected_components`](surface::connected_components), [`self_intersections`](surface::self_intersections) |
//! | [`orientation`] | [`orient_patches`](orientation::orient_patches), [`flipped_components`](orientation::flipped_components) |
//! | [`search`] | [`TriangleHierarchy`](search::TriangleHierarchy): first hit of a segment, closest point |
//! | [`winding`] | [`winding_number`](winding::winding_number), [`WindingNumberHierarchy`](winding::WindingNumberHierarchy) (exact), [`FastWindingNumber`](winding::FastWindingNumber) |
//! | [`operators`] | [`cotangent_laplacian`](operators::cotangent_laplacian), [`intrinsic_delaunay_laplacian`](operators::intrinsic_delaunay_laplacian), [`lumped_mass`](operators::lumped_mass), and their twins for tetrahedra |
//! | [`volume`] | [`volume`](volume::volume): tetrahedra for a surface, in one call |
//! | [`planar`] | [`planar_domain`](planar::planar_domain): the same for flat shapes; [`plane_of`](planar::plane_of) |
//! | [`simplify`] | [`simplify`](simplify::simplify): a coarser surface around the same volume |
//! | [`delaunay`] | [`delaunay_tetrahedra`](delaunay::delaunay_tetrahedra) of points |
//! | [`segmentation`] | [`element_winding`](segmentation::element_winding), [`graph_cut`](segmentation::graph_cut), [`connect_vertices`](segmentation::connect_vertices), [`satisfy_facets`](segmentation::satisfy_facets), [`make_manifold`](segmentation::make_manifold) |
//! | [`improve`] | [`improve_tetrahedra`](improve::improve_tetrahedra), [`improve_with_boundary`](improve::improve_with_boundary), [`dihedral_angles`](improve::dihedral_angles) |
//! | [`embed`] | [`embed_points`](embed::embed_points): locating points in tetrahedra |
//!
//! # Progress
//!
//! Everything that may take seconds has a [`Progress`] callback. It receives the stage in plain words, suitable for
//! display, and the fraction of that stage done, from 0 to 1; within a stage the fraction never decreases. When it
//! returns [`ControlFlow::Break`](std::ops::ControlFlow::Break), the function stops soon and returns its error
//! `Cancelled`.

mod facets;
mod influences;
mod mesh;
mod predicates;
mod progress;
mod vectors;

pub mod delaunay;
pub mod embed;
pub mod improve;
pub mod operators;
pub mod orientation;
pub mod planar;
pub mod search;
pub mod segmentation;
pub mod simplify;
pub mod surface;
pub mod volume;
pub mod winding;

pub use influences::{Influences, InfluencesError};
pub use mesh::{MeshError, TetrahedralMesh, TriangleMesh};
pub use progress::Progress;

#[cfg(test)]
extern crate self as armature_geometry;
#[cfg(test)]
#[path = "../tests/support/mod.rs"]
mod support;
