//! Where bones go that nobody has moved: as-rigid-as-possible energies minimised over the transformations of skinning
//! handles (FAST, thesis chapter 7).
//!
//! | what | type |
//! |---|---|
//! | a shape, its weights and its handles at rest | [`ArapShape`], [`ArapEnergy`], [`SharedJoint`] |
//! | how much vertices follow handles | [`ArapWeights`], [`WeightRows`] |
//! | reduced once, solved every frame | [`ReducedArap`], [`ArapSettings`], [`GlobalStep`] |
//! | the given part of a pose | [`HandleConstraint`], [`Anchor`], [`AnchorPoint`] |
//! | what bones prefer | [`SoftJoint`], [`RotationLimit`] |
//! | momentum and gravity | [`ArapDynamics`] |
//! | when a solve ends, and how it went | [`ArapStop`], [`ArapReport`], [`ArapOutcome`], [`ArapWarnings`] |
//!
//! A bar of two triangles with a handle at either end: one is held, the other moved, and its rotation is solved for.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_deform::arap::{
//!     ArapEnergy, ArapSettings, ArapShape, ArapStop, ArapWeights, HandleConstraint, ReducedArap,
//! };
//! use glam::{Affine3A, Vec3};
//!
//! let positions = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
//! let shape = ArapShape {
//!     positions: &positions,
//!     energy: ArapEnergy::PlanarTriangles(&[[0, 1, 2], [0, 2, 3]]),
//!     weights: ArapWeights::Matrix(&[1.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]),
//!     handle_points: &[[0.0, 0.5, 0.0], [2.0, 0.5, 0.0]],
//!     joints: &[],
//! };
//! let go_on = &mut |_: &str, _: f64| ControlFlow::Continue(());
//! let mut arap = ReducedArap::precompute(&shape, &ArapSettings::default(), go_on)?;
//! arap.constrain(&[HandleConstraint::Full, HandleConstraint::Position], &[])?;
//! let targets = [Affine3A::IDENTITY, Affine3A::from_translation(Vec3::new(-1.0, 1.0, 0.0))];
//! arap.solve(&targets, &[], ArapStop::default())?;
//! let moved = arap.transforms()[1].transform_point3(Vec3::new(2.0, 0.5, 0.0));
//! assert!(moved.distance(Vec3::new(1.0, 1.5, 0.0)) < 1e-5);
//! # Ok::<(), armature_deform::arap::ArapError>(())
//! ```

mod block_factor;
mod blocks;
mod clusters;
mod constraint;
mod dynamics;
mod energy;
mod energy_of;
mod error;
mod factor;
mod factor_steps;
mod given;
mod inverse;
mod inverse_steps;
mod local_step;
mod reduced;
mod reduction;
mod report;
mod rotation_limit;
mod settings;
mod shape;
mod soft_joints;
mod solve;
mod state;
mod system;
mod weights;

pub use constraint::{Anchor, AnchorPoint, HandleConstraint};
pub use dynamics::ArapDynamics;
pub use energy::ArapEnergy;
pub use error::ArapError;
pub use reduced::ReducedArap;
pub use report::{ArapOutcome, ArapReport, ArapStop, ArapWarnings};
pub use rotation_limit::RotationLimit;
pub use settings::{ArapSettings, GlobalStep};
pub use shape::{ArapShape, SharedJoint};
pub use soft_joints::SoftJoint;
pub use weights::{ArapWeights, WeightRows};
