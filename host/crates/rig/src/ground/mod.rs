//! Standing and walking: a puppet says how its joints are turned, not where it is. Feet on the floor do: [`Ground`] says
//! which bones may carry the character and where its skin is, [`GroundContact`] moves its roots so that the foot on the
//! floor stays there and nothing is below the floor. Legs that no joint turns bend, so that all feet stay.
//!
//! ```
//! use armature_rig::{Bone, Ground, GroundContact, GroundMode, Skeleton, Transform};
//! use glam::{Quat, Vec3};
//!
//! let bone = |name: &str, parent, at: [f32; 3], tail: [f32; 3]| Bone {
//!     name: name.into(),
//!     parent,
//!     rest: Transform { translation: at.into(), ..Transform::IDENTITY },
//!     tail: tail.into(),
//! };
//! let down = [0.0, -0.4, 0.0];
//! let skeleton = Skeleton::new(vec![
//!     bone("thigh", None, [0.0, 0.9, 0.0], down),
//!     bone("shin", Some(0), down, down),
//!     bone("foot", Some(1), down, [0.0, -0.1, 0.1]),
//! ])?;
//! let foot = skeleton.find("foot").ok_or("no foot")?;
//! let ground = Ground::of_skeleton(&skeleton, GroundMode::Walk, &[foot])?;
//! let mut contact = GroundContact::new(&skeleton, ground)?;
//! let mut pose = skeleton.rest_pose();
//! let driven = [true; 3];
//! contact.follow(0, &skeleton, &driven, &mut pose);
//! // A squat: the hips sink, the foot stays.
//! pose.parent_from_bone[0].rotation = Quat::from_rotation_x(-0.5);
//! pose.parent_from_bone[1].rotation = Quat::from_rotation_x(1.0);
//! pose.parent_from_bone[2].rotation = Quat::from_rotation_x(-0.5);
//! contact.follow(10_000, &skeleton, &driven, &mut pose);
//! assert!((pose.parent_from_bone[0].translation.y - (0.1 + 0.8 * 0.5_f32.cos())).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod contact;
mod leg;
mod placed;
mod settings;
mod standing;

pub use contact::{GROUND_LEFT, GROUND_TOUCHED, GroundContact};
pub use settings::{Footing, Ground, GroundError, GroundMode, GroundPoint};
pub use standing::Standing;
