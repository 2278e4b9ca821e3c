//! The contents of a model file, in any format: the surface with its colours, an artist's rig, clips.

mod avatar;
pub(crate) mod collect;
mod contents;
mod material;
mod parts;
mod resolver;
pub(crate) mod seams;
mod shape;
pub(crate) mod texture;

pub use avatar::{Avatar, Expression, HumanoidBone, SpringChain, SpringCollider, SpringJoint};
pub use contents::{Model, ModelRig, Skin, Split};
pub use material::{AlphaMode, GreyMaps, Material, Texture, Wrap};
pub use parts::{MeshPart, MorphTarget, PartError, check_parts};
pub use resolver::Resolver;
pub use shape::{set_shapes, targets_of_shape};
