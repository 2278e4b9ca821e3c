//! A skeleton for a mesh that has none: [`fit`] puts that of a [`Template`] into it.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_character::rigging::{RigSettings, Template, fit};
//! use armature_geometry::TriangleMesh;
//! use armature_rig::{Bone, Skeleton, Transform};
//! use glam::Vec3;
//!
//! // A box four units high, and a template of two bones above one another, half as large and elsewhere.
//! let vertices = (0..8).map(|i| [f64::from(i & 1), 4.0 * f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
//! let sides = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]];
//! let more = [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
//! let mesh = TriangleMesh { vertices, triangles: [sides, more].concat() };
//! let bone = |name: &str, parent, at| Bone {
//!     name: name.into(),
//!     parent,
//!     rest: Transform { translation: at, ..Transform::IDENTITY },
//!     tail: Vec3::Y,
//! };
//! let template = Template::new(Skeleton::new(vec![bone("lower", None, Vec3::Y), bone("upper", Some(0), Vec3::Y)])?)?;
//! let fitted = fit(&mesh, &template, &RigSettings::default(), &mut |_stage, _done| ControlFlow::Continue(()))?;
//! let joint = fitted.skeleton.rest_segments()[1].0;
//! assert!(joint.distance(Vec3::new(0.5, 2.0, 0.5)) < 0.3, "{joint}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod certainty;
mod chains;
mod costs;
mod error;
mod figures;
mod fit;
mod interior;
mod landmarks;
mod pieces;
mod placement;
mod search;
mod settings;
mod template;
mod turns;

pub use certainty::Doubt;
pub use error::RigError;
pub use fit::{Fit, fit};
pub use settings::RigSettings;
pub use template::Template;
