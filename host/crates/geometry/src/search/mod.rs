//! Searching a surface: the nearest point, the first triangle that a segment meets, boxes that overlap.
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::search::TriangleHierarchy;
//! # let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! # let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! # let octahedron = TriangleMesh { vertices, triangles };
//! let hierarchy = TriangleHierarchy::new(&octahedron)?;
//! let hit = hierarchy.first_hit([0.0, 0.0, 3.0], [0.1, 0.1, 0.0]);
//! assert!(hit.is_some_and(|hit| hit.triangle == 0));
//! let closest = hierarchy.closest_point([2.0, 0.0, 0.0]);
//! assert!(closest.is_some_and(|closest| closest.point == [1.0, 0.0, 0.0] && closest.distance_squared == 1.0));
//! # Ok::<(), armature_geometry::MeshError>(())
//! ```

pub(crate) mod box_tree;
mod triangle_hierarchy;
pub(crate) mod triangle_queries;

pub use triangle_hierarchy::{ClosestPoint, SegmentHit, TriangleHierarchy};
pub use triangle_queries::{barycentric, closest_on_segment};
