//! Bone heat weights (Baran & Popović 2007): bones heat the vertices nearest to them, and heat spreads along the surface.
//! Needs no volume. [`bone_heat`] computes them.
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_weights::{BoneSegment, heat::{BoneHeatSettings, bone_heat}};
//! # use std::ops::ControlFlow;
//!
//! // An octahedron, 6 long, with a bone in either half.
//! let vertices =
//!     vec![[-3.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
//! let triangles = vec![[1, 2, 4], [2, 0, 4], [0, 3, 4], [3, 1, 4], [2, 1, 5], [0, 2, 5], [3, 0, 5], [1, 3, 5]];
//! let mesh = TriangleMesh { vertices, triangles };
//! let bone = |head, tail| BoneSegment { head: [head, 0.0, 0.0], tail: [tail, 0.0, 0.0] };
//! let mut progress = |_: &'static str, _: f64| ControlFlow::Continue(());
//! let heat = bone_heat(&mesh, &[bone(-2.5, -0.5), bone(0.5, 2.5)], &BoneHeatSettings::default(), &mut progress)?;
//! assert!(heat.weights.weight(0, 0) > 0.9 && heat.weights.weight(1, 1) > 0.9);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bone_heat;
mod settings;
mod sources;
mod surface;
mod system;

pub use bone_heat::{BoneHeat, bone_heat};
pub use settings::{BoneHeatError, BoneHeatReport, BoneHeatSettings, Visibility};
