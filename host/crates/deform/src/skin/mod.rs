//! Where every vertex goes when the bones move.
//!
//! | method | type |
//! |---|---|
//! | linear blending (thesis eq. 2.1) | [`LinearBlendSkin`] |
//! | dual quaternions (Kavan et al. 2008) | [`DualQuaternionSkin`] |
//! | stretchable, twistable bones over either (thesis chapter 6) | [`StretchTwistSkin`] |
//! | morph targets, blended before | [`Morphs`] |
//! | bones prepared for kernels, here and on the graphics adapter | [`bones`] |
//!
//! All write positions and unit normals, allocate nothing in `solve`, and give the same bits on any number of threads.
//! An elbow of two bones, bent by a right angle:
//!
//! ```
//! use armature_deform::skin::DualQuaternionSkin;
//! use armature_geometry::Influences;
//! use glam::{Affine3A, Vec3};
//!
//! let rest = [Affine3A::IDENTITY, Affine3A::from_translation(Vec3::X)];
//! let influences = Influences::new(2, vec![0, 1, 1, 0], vec![0.5, 0.5, 1.0, 0.0], 2)?;
//! let (positions, normals) = ([[1.0, 0.5, 0.0], [2.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]; 2]);
//! let mut skin = DualQuaternionSkin::precompute(&positions, &normals, &influences, &rest)?;
//! let bent = [rest[0], rest[1] * Affine3A::from_rotation_z(std::f32::consts::FRAC_PI_2)];
//! let mut posed = (positions, normals);
//! skin.solve(&bent, &mut posed.0, &mut posed.1)?;
//! // Halfway round the joint's circle at the joint; all the way round beyond it.
//! let corner = 0.5 * std::f32::consts::FRAC_1_SQRT_2;
//! assert!(Vec3::from(posed.0[0]).distance(Vec3::new(1.0 - corner, corner, 0.0)) < 1e-6);
//! assert!(Vec3::from(posed.0[1]).distance(Vec3::new(1.0, 1.0, 0.0)) < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod blocks;
pub mod bones;
mod dual_quaternion;
mod error;
mod frame_skin;
mod in_chunks;
mod linear_blend;
mod morphs;
mod stretch_twist;

pub use bones::{BoneSegment, StretchTwist};
pub use dual_quaternion::DualQuaternionSkin;
pub use error::SkinError;
pub use linear_blend::LinearBlendSkin;
pub use morphs::{MorphOffsets, Morphs};
pub use stretch_twist::{BoneBlend, StretchTwistSkin};
