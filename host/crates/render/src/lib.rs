//! Pictures of a skinned character on a studio floor: wgpu, and a CPU twin of every shader.
//!
//! | shader | twin | what |
//! |---|---|---|
//! | `shader/background.wgsl` | `src/cpu/background.rs` | backdrop, floor, grid, contact shadow |
//! | `shader/mesh.wgsl` | `src/cpu/mesh.rs` | the character: hemispheric ambient, key, fill and rim light |
//! | `shader/overlay.wgsl` | `src/cpu/overlay.rs` | bones seen through the skin |
//! | `shader/present.wgsl` | `src/cpu/present.rs` | linear light → 8-bit sRGB, shoulder and dither |
//! | `shader/linear_blend_skinning.wgsl` | `armature_deform::LinearBlendSkin` | many poses at once |
//! | `shader/dual_quaternion_skinning.wgsl` | `armature_deform::DualQuaternionSkin` | many poses at once |
//! | `shader/stretch_twist_skinning.wgsl` | `armature_deform::StretchTwistSkin` | many poses at once |
//!
//! Both sides read the same [`uniforms`](crate::Scene) and the same contact shadow, and tests compare their pictures.
//! World space is right-handed with +Y up; colours in the API are sRGB 0 to 1, all arithmetic is in linear light.

mod bone_shape;
mod camera;
mod contact_shadow;
mod cpu;
mod error;
mod gpu;
mod picture;
mod scene;
mod uniforms;

pub use camera::{Bounds, Camera};
pub use cpu::render_to_image_cpu;
pub use error::RenderError;
pub use gpu::{
    Gpu, GpuSkin, Renderer, RestShape, SkinMethod, SkinPoses, SkinnedPoses, adapter_label, preferred_samples,
    render_to_image_gpu,
};
pub use picture::{Picture, encode_png};
pub use scene::{BoneMark, Ground, Look, MeshView, Samples, Scene, TextureView};
