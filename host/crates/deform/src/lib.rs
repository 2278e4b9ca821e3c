//! Skinning: where every vertex goes when the bones move, and where bones go that nobody has moved.
//!
//! From weights to posed vertices: a character is prepared once at rest, then solved every frame.
//!
//! ```
//! use armature_deform::skin::LinearBlendSkin;
//! use armature_geometry::Influences;
//! use glam::{Affine3A, Vec3};
//!
//! // Three vertices along x and two bones; the vertex in the middle follows both.
//! let (positions, normals) = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]; 3]);
//! let influences = Influences::new(2, vec![0, 1, 0, 1, 1, 0], vec![1.0, 0.0, 0.5, 0.5, 1.0, 0.0], 2)?;
//! let rest = [Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)];
//! let mut skin = LinearBlendSkin::precompute(&positions, &normals, &influences, &rest)?;
//!
//! // The second bone bends up by a right angle about its own origin.
//! let pose = [rest[0], rest[1] * Affine3A::from_rotation_z(std::f32::consts::FRAC_PI_2)];
//! let (mut posed, mut turned) = ([[0.0; 3]; 3], [[0.0; 3]; 3]);
//! skin.solve(&pose, &mut posed, &mut turned)?;
//! assert!(Vec3::from(posed[2]).distance(Vec3::new(1.0, 1.0, 0.0)) < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`skin`] | `precompute` and `solve` of [`LinearBlendSkin`](skin::LinearBlendSkin), [`DualQuaternionSkin`](skin::DualQuaternionSkin), [`StretchTwistSkin`](skin::StretchTwistSkin) |
//! | [`arap`] | `precompute`, `constrain`, `soften`, `solve` and `step` of [`ReducedArap`](arap::ReducedArap) |
//! | [`pseudo_edges`] | [`PseudoEdges::transforms`](pseudo_edges::PseudoEdges::transforms) |
//! | [`nearest_rotation`] | [`nearest_rotations`](nearest_rotation::nearest_rotations) |
//!
//! What repeats per frame is split in two: a `precompute` that is built once per character and a `solve` that runs
//! every frame and allocates nothing. Pose time is `f32`. This crate does no I/O and reads no clock.

pub mod arap;
mod dense;
mod lanes;
pub mod nearest_rotation;
pub mod pseudo_edges;
pub mod skin;
