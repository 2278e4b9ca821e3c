//! Properties and adjacency of surfaces: diagnosis, topology, welding, normals, self-intersections.
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::surface::{NormalWeighting, diagnose, vertex_normals};
//! # let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! # let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! # let octahedron = TriangleMesh { vertices, triangles };
//! let diagnosis = diagnose(&octahedron)?;
//! assert!(diagnosis.closed && diagnosis.self_intersections == 0);
//! assert!((diagnosis.signed_volume - 4.0 / 3.0).abs() < 1e-12);
//! assert_eq!(vertex_normals(&octahedron, NormalWeighting::Angle)?[2], [0.0, 1.0, 0.0]);
//! # Ok::<(), armature_geometry::MeshError>(())
//! ```

mod diagnose;
mod normals;
pub(crate) mod self_intersections;
mod subdivide_long_edges;
mod topology;
mod weld;

pub use diagnose::{Diagnosis, diagnose};
pub use normals::{NormalWeighting, triangle_areas, vertex_normals};
pub use self_intersections::{SelfIntersections, self_intersections};
pub(crate) use subdivide_long_edges::subdivide_long_edges;
pub use topology::{Components, Edge, Fans, boundary_edges, connected_components, edges, vertex_triangles};
pub use weld::{Weld, weld_vertices};
