//! How many times a surface or a curve wraps around a point (thesis 8.4): [`winding_number`] sums over everything,
//! [`WindingNumberHierarchy`] gives the same numbers faster, [`FastWindingNumber`] nearly the same much faster. Each
//! has a counterpart for curves in the plane.
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::winding::{FastWindingNumber, WindingNumberHierarchy, winding_number};
//! # let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! # let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! # let octahedron = TriangleMesh { vertices, triangles };
//! let points = [[0.1, 0.2, 0.3], [1.0, 1.0, 1.0]];
//! let exact = winding_number(&octahedron, &points)?;
//! assert!((exact[0] - 1.0).abs() < 1e-12 && exact[1].abs() < 1e-12);
//! let quick = WindingNumberHierarchy::precompute(&octahedron)?.evaluate_many(&points);
//! let rough = FastWindingNumber::precompute(&octahedron)?.evaluate_many(&points);
//! for k in 0..2 {
//!     assert!((quick[k] - exact[k]).abs() < 1e-12 && (rough[k] - exact[k]).abs() < 0.01);
//! }
//! # Ok::<(), armature_geometry::MeshError>(())
//! ```

#![expect(
    clippy::inline_always,
    reason = "code that is not inlined into the function compiled for wide registers does not use them"
)]

mod closure_tree;
mod expansion_tree;
mod fast_winding_number;
mod fast_winding_number_2d;
mod lanes;
mod queries;
pub(crate) mod segments;
mod turns;
mod winding_hierarchy;
mod winding_hierarchy_2d;
mod winding_number;

pub use fast_winding_number::FastWindingNumber;
pub use fast_winding_number_2d::FastWindingNumber2d;
pub use winding_hierarchy::WindingNumberHierarchy;
pub use winding_hierarchy_2d::WindingNumberHierarchy2d;
pub use winding_number::{winding_number, winding_number_2d};
