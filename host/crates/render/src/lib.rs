//! Pictures of a skinned character on a studio floor: wgpu, and a CPU twin of every shader.
//!
//! A character's mesh becomes a picture, here by the CPU twin:
//!
//! ```
//! use armature_render::{Bounds, Camera, Ground, MeshView, Samples, Scene, encode_png, render_to_image_cpu};
//!
//! let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let normals = [[-0.577, -0.577, -0.577], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
//! let triangles = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];
//! let mesh = MeshView { positions: &positions, normals: &normals, triangles: &triangles, ..MeshView::default() };
//! let bounds = Bounds::of(&positions).ok_or("no points")?;
//! let scene = Scene { mesh, ground: Ground::under(&bounds), ..Scene::default() };
//! let picture = render_to_image_cpu(&scene, &Camera::fit(&bounds, 1.5), [96, 64], Samples::Four)?;
//! assert_eq!(picture.rgba.len(), 4 * 96 * 64);
//! assert!(encode_png(&picture)?.starts_with(b"\x89PNG"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! | to do | verbs |
//! |---|---|
//! | a picture without a window | [`render_to_image_cpu`], [`render_to_image_gpu`], [`encode_png`] |
//! | frames in a window | [`Renderer::prepare`], [`Renderer::paint`] |
//! | many poses at once | [`GpuSkin::precompute`], [`GpuSkin::solve`], [`GpuSkin::read`] |
//! | what is seen | [`Scene`], [`MeshView`], [`MeshPart`], [`Material`], [`Map`], [`BoneMark`], [`Ground`], [`Look`], [`Camera`] |
//!
//! | shader | twin | what |
//! |---|---|---|
//! | `shader/background.wgsl` | `src/cpu/background.rs` | backdrop, floor, grid, contact shadow |
//! | `shader/mesh.wgsl` | `src/cpu/mesh.rs` | the character: metallic-roughness materials under hemispheric ambient, key, fill and rim light |
//! | `shader/overlay.wgsl` | `src/cpu/overlay.rs` | bones seen through the skin |
//! | `shader/present.wgsl` | `src/cpu/present.rs` | linear light → 8-bit sRGB, shoulder and dither |
//! | `shader/linear_blend_skinning.wgsl` | `armature_deform::skin::LinearBlendSkin` | many poses at once |
//! | `shader/dual_quaternion_skinning.wgsl` | `armature_deform::skin::DualQuaternionSkin` | many poses at once |
//! | `shader/stretch_twist_skinning.wgsl` | `armature_deform::skin::StretchTwistSkin` | many poses at once |
//!
//! Both sides read the same [`uniforms`](crate::Scene) and the same contact shadow, and tests compare their pictures.
//! The feature `gpu`, on by default, contains what needs wgpu; without it there are only the twins.
//! World space is right-handed with +Y up. Colours of the stage and the bones are sRGB 0 to 1; materials and colours of
//! vertices are linear, as in glTF, and all arithmetic is in linear light.

mod bone_shape;
mod camera;
mod contact_shadow;
mod cpu;
mod error;
#[cfg(feature = "gpu")]
mod gpu;
mod material;
mod mip_levels;
mod picture;
mod scene;
mod srgb;
mod uniforms;

pub use camera::{Bounds, Camera};
pub use cpu::render_to_image_cpu;
pub use error::RenderError;
#[cfg(feature = "gpu")]
pub use gpu::{
    Gpu, GpuSkin, Renderer, RestShape, SkinMethod, SkinPoses, SkinnedPoses, adapter_label, preferred_samples,
    render_to_image_gpu,
};
pub use material::{Alpha, Map, Material, Wrap};
pub use picture::{DecodeError, Picture, decode_picture, encode_png};
pub use scene::{BoneMark, Ground, Look, MeshPart, MeshView, Samples, Scene};
pub use srgb::linear_from_srgb;
