//! The bound character: meshes, materials, skeleton and weights ready to be posed; its cache file; its inverse
//! kinematics; and the characters that the program makes itself.
//!
//! A mesh and a skeleton become a character:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_character::bind::{BindSettings, bind};
//! use armature_character::handle_weights::WeightsOn;
//! use armature_formats::model::Model;
//! use armature_geometry::TriangleMesh;
//! use armature_rig::{Bone, Skeleton, Transform};
//! use glam::Vec3;
//!
//! // A box four units high, and two bones above one another.
//! let vertices = (0..8).map(|i| [f64::from(i & 1), 4.0 * f64::from(i >> 1 & 1), f64::from(i >> 2)]).collect();
//! let sides = [[0, 2, 1], [1, 2, 3], [4, 5, 6], [5, 7, 6], [0, 1, 4], [1, 5, 4]];
//! let more = [[2, 6, 3], [3, 6, 7], [0, 4, 2], [2, 4, 6], [1, 3, 5], [3, 7, 5]];
//! let mesh = TriangleMesh { vertices, triangles: [sides, more].concat() };
//! let bone = |name: &str, parent, at| Bone {
//!     name: name.into(),
//!     parent,
//!     rest: Transform { translation: at, ..Transform::IDENTITY },
//!     tail: 1.5 * Vec3::Y,
//! };
//! let bones = vec![bone("lower", None, Vec3::splat(0.5)), bone("upper", Some(0), 1.5 * Vec3::Y)];
//! let settings = BindSettings { on: WeightsOn::Volume { vertices: 300 }, ..BindSettings::default() };
//! let model = Model { name: "box".into(), mesh, ..Model::default() };
//! let character = bind(model, Some(Skeleton::new(bones)?), &settings, &mut |_stage, _done| ControlFlow::Continue(()))?;
//! let (bone, weight) = character.surface.influences.of_vertex(2).next().ok_or("no weight")?;
//! assert!(bone == 1 && weight > 0.9, "the upper corners follow the upper bone");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | [`mod@bind`] | [`bind`](bind::bind) |
//! | [`mod@handle_weights`] | [`handle_weights`](handle_weights::handle_weights): weights of bones, points and cages |
//! | [`volume`] | [`make_volume`](volume::make_volume) |
//! | [`cache`] | [`to_bytes`](cache::to_bytes), [`from_bytes`](cache::from_bytes), [`cache_key`](cache::cache_key) |
//! | [`inverse_kinematics`] | `new`, `drive` and `prefer` of [`InverseKinematics`](inverse_kinematics::InverseKinematics) |
//! | [`outermost_points`](fn@outermost_points) | what of the skin could cross a floor |
//! | [`skin`] | `precompute` and `solve` of [`CharacterSkin`](skin::CharacterSkin): linear, dual quaternion, or stretching and twisting |
//! | [`rigging`] | [`fit`](rigging::fit) a template's skeleton into a mesh |
//! | [`own`] | [`human`](own::human), [`spider`](own::spider), [`hand`](own::hand) |
//!
//! This crate does no I/O: bytes in, bytes out. It reads no clock and prints nothing. Long computations report
//! [`Progress`] and can be cancelled. Equal input gives equal bytes whatever the number of threads.

pub mod bind;
pub mod cache;
mod character;
pub mod handle_weights;
pub mod inverse_kinematics;
mod outermost_points;
pub mod own;
mod progress;
pub mod rigging;
pub mod skin;
mod skin_kind;
pub mod volume;

pub use character::{Character, HeatRecord, MonotoneRecord, Provenance, SolvedRecord, Surface, WeightsRecord};
pub use outermost_points::outermost_points;
pub use progress::Progress;
pub use skin_kind::{EndpointMethod, Endpoints, SkinKind};
