//! The bones that no joint drives, found from the shape: as rigid as possible (thesis chapter 7).
//!
//! The puppet is obeyed: a driven bone is turned exactly as its joints turn it, and is exactly where forward kinematics
//! puts it as long as everything between it and a pin is driven or held. The rest minimises the energy of the whole
//! shape over the bones' transformations ([`ReducedArap`]). The affine result becomes a pose of rigid bones: the
//! nearest rotation of each solved bone, rest lengths from parent to child, and then the smallest change that puts pins
//! back in place, within what joints allow ([`JointLimit`], [`anatomical_limits`]): a pin that they do not let a bone reach
//! is missed, and [`InverseKinematics::worst_pin`] says by how much. Everything after that (skinning, takes, exports) uses that pose.
//!
//! Points that are dragged ([`InverseKinematics::set_target`]) are constraints of both: positions of the energy (thesis
//! section 7.3, equation (7.3)), as equations where they are hard and as quadratic penalties where they are soft, and paths
//! of the rigid bones, whose end the smallest change brings to where it belongs. A soft point goes where the energy lets it.
//! Near the end of a chain's reach, and of what the bend of its joints allows, the way slows down. When targets come and go,
//! bones go over from the pose before as differences that fade, ahead of the step that holds pins, so that those stay.
//!
//! Rigid bones cost energy: [`InverseKinematics::refit_cost`] says how much; a human of eight joints in a bend of all of
//! them has 2.6 % more than the minimiser. [`IkBones::Loose`] keeps more of what the minimiser found, with bones that
//! move and grow, for characters that are no rigs. [`IkEnergy::Volume`] minimises the
//! energy of the volume inside, which resists being flattened where a shell folds; the volume and its weights are not in
//! a character's file, but found again when the first pose is prepared.
//!
//! The human's own puppet turns only head, hands and feet; the bones between are solved:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_character::inverse_kinematics::{BoneRole, InverseKinematics};
//!
//! let human = armature_character::own::human()?;
//! let mut solver = InverseKinematics::new(&human, &[])?;
//! let of_puppet = ["Head", "LeftHand", "RightHand", "LeftFoot", "RightFoot"];
//! let driven: Vec<bool> = human.skeleton.bones().iter().map(|b| of_puppet.contains(&b.name.as_str())).collect();
//! solver.drive(&driven, &mut |_stage, _done| ControlFlow::Continue(()))?;
//! let elbow = human.skeleton.find("LeftLowerArm").ok_or("no such bone")?;
//! assert_eq!(solver.roles()[elbow], BoneRole::Solved);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod anatomy;
mod bone_roles;
mod comfort;
mod ease;
mod error;
mod held_pins;
mod inside;
mod joint_limit;
mod jointed_pins;
mod layout;
mod loose_bones;
mod pinned_bone;
mod preferred_bone;
mod refit_cost;
mod rest;
mod settings;
mod shape;
mod solved_system;
mod solver;
mod targets;

pub use anatomy::anatomical_limits;
pub use armature_deform::arap::ArapError;
pub use bone_roles::BoneRole;
pub use comfort::Comfort;
pub use error::IkError;
pub use joint_limit::{JointLimit, LimitedBone, UnknownLimit};
pub use pinned_bone::{PinHold, PinnedBone};
pub use preferred_bone::{PreferredBone, UnknownPreference};
pub use refit_cost::RefitCost;
pub use settings::{IkBones, IkEnergy, IkSettings, UnknownIkSetting};
pub use solver::InverseKinematics;
pub use targets::Missed;
