//! From a model and a skeleton to a character that can be posed ([`bind`]): weights of every bone, made sparse, and
//! warnings.
//!
//! A model with an artist's rig keeps it; a file without a skeleton needs one as well:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_character::Provenance;
//! use armature_character::bind::{BindError, BindSettings, bind};
//! use armature_formats::model::{Model, ModelRig};
//!
//! let human = armature_character::own::human()?;
//! let influences = human.surface.influences.clone();
//! let painted = ModelRig { skeleton: human.skeleton.clone(), influences, ..ModelRig::default() };
//! let model = Model { mesh: human.surface.mesh.clone(), rig: Some(painted), ..Model::default() };
//! let without = Model { rig: None, ..model.clone() };
//! let go_on = &mut |_: &'static str, _: f64| ControlFlow::Continue(());
//! assert_eq!(bind(model, None, &BindSettings::default(), go_on)?.provenance, Provenance::Artist);
//! assert_eq!(bind(without, None, &BindSettings::default(), go_on), Err(BindError::NoSkeleton));
//! # Ok::<(), BindError>(())
//! ```

mod assemble;
mod binding;
mod bone_weights;
mod endpoints;
mod error;
mod misfit;
mod parts_without_weights;
mod prepare;
mod settings;
mod smooth_influences;

pub use binding::bind;
pub(crate) use binding::bind_with_ribs;
pub use endpoints::endpoint_weights;
pub use error::BindError;
pub use misfit::Misfit;
pub use settings::{BindMethod, BindSettings, MOST_INFLUENCES, TwistCurve, WEIGHT_VOLUME_VERTICES};
