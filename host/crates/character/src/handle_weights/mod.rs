//! Weights of handles ([`handle_weights`]), bounded biharmonic or monotone: computed on a volume, transferred to the surface,
//! with their certificates, their spurious extrema and warnings.
//!
//! Two points in a box, with weights on the volume that the box encloses:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_character::handle_weights::{
//!     BiharmonicTier, HandlePlace, HandleShape, HandleWeightsSettings, Held, Partition, WeightMethod, WeightsOn,
//!     handle_weights,
//! };
//! use armature_geometry::TriangleMesh;
//!
//! let vertices = (0..8).map(|i| [f64::from(i & 1), 4.0 * f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
//! let sides = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]];
//! let more = [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
//! let mesh = TriangleMesh { vertices, triangles: [sides, more].concat() };
//! let point = |y| HandleShape { name: format!("at {y}"), place: HandlePlace::Point([0.5, y, 0.5]) };
//! let held = Held::Shapes { shapes: &[point(0.5), point(3.5)], cage: &[] };
//! let settings = HandleWeightsSettings {
//!     method: WeightMethod::BoundedBiharmonic,
//!     tier: BiharmonicTier::Interactive,
//!     on: WeightsOn::Volume { vertices: 300 },
//!     partition: Partition::Normalised,
//!     joint_release: 0.0,
//! };
//! let found = handle_weights(&mesh, None, held, &settings, &mut |_stage, _done| ControlFlow::Continue(()))?;
//! assert!(found.converged() && found.weights.bone(1)[2] > 0.9, "the upper corners follow the upper point");
//! # Ok::<(), armature_character::handle_weights::HandleWeightsError>(())
//! ```

mod away;
mod cage_facets;
mod domain;
mod error;
mod handle;
mod hold_vertices;
mod outcome;
mod settings;
mod spurious;
mod warnings;
mod weights;

pub use domain::FLAT;
pub(crate) use domain::without_flat;
pub use error::HandleWeightsError;
pub use handle::{HandlePlace, HandleShape, Held};
pub use outcome::{Certificates, HandleWeights};
pub use settings::{BiharmonicTier, DomainKind, HandleWeightsSettings, Partition, WeightMethod, WeightsOn};
pub use spurious::{SpuriousExtrema, SpuriousExtremum, surface_extrema};
pub use weights::handle_weights;
