//! USD: skeleton, skinned meshes, blend shapes, materials and animation by the schemas `UsdSkel` and `UsdPreviewSurface`, as
//! text (`.usda`) and packed with its images (`.usdz`).

mod identifiers;
mod layer;
mod stage;
mod write;
mod write_clip;
mod write_material;
mod write_mesh;
mod write_skeleton;

pub use write::{UsdFile, write_usda, write_usdz};
