//! A character's skin of the kind that was chosen for it ([`CharacterSkin`]), and how its bones stretch and twist in a
//! pose ([`TwistingBones`]).
//!
//! The hand of the built-in character, turned about its forearm:
//!
//! ```
//! use armature_character::SkinKind;
//! use armature_character::skin::CharacterSkin;
//! use glam::Quat;
//!
//! let hand = armature_character::own::hand()?;
//! let hand = armature_character::Character { skin: SkinKind::StretchTwist, ..hand };
//! let mut skin = CharacterSkin::precompute(&hand)?;
//! let mut pose = hand.skeleton.rest_pose();
//! let palm = hand.skeleton.find("LeftHand").ok_or("no palm")?;
//! pose.parent_from_bone[palm].rotation *= Quat::from_axis_angle(glam::Vec3::Y, 2.0);
//! let mut frames = hand.skeleton.rest_model_from_bone();
//! pose.forward_kinematics(&hand.skeleton, &mut frames);
//! let (mut positions, mut normals) = (hand.rest_positions(), hand.surface.normals.clone());
//! skin.solve(&frames, &mut positions, &mut normals)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod character_skin;
mod twisting_bones;

pub use character_skin::{CharacterSkin, projected_endpoints};
pub use twisting_bones::{PosedBone, TwistingBones};
