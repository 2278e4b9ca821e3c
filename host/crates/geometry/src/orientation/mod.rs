//! Triangle orientation: finds patches and whole components that are inside out.
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_geometry::orientation::orient_patches;
//! # let vertices = vec![[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]];
//! # let triangles = vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
//! # let octahedron = TriangleMesh { vertices, triangles };
//! let mut messy = octahedron.clone();
//! messy.triangles[3].swap(0, 1);
//! let oriented = orient_patches(&messy)?;
//! assert_eq!(oriented.turned, [3]);
//! # Ok::<(), armature_geometry::MeshError>(())
//! ```

mod flipped_components;
mod orient_patches;
mod sides;

pub use flipped_components::{FlippedComponents, flipped_components};
pub use orient_patches::{OrientedPatch, OrientedPatches, PatchVerdict, orient_patches};
