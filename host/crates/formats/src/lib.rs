//! Bytes to meshes, skeletons, motions, tables and settings, and back.
//!
//! If you develop a pipeline, start at [`read_model`]: for any format it returns the surface, welded so that Laplacians
//! and weights see a closed one, with the artist's skeleton, weights and clips if the file has them.
//!
//! ```
//! use armature_formats::gltf::{GlbMesh, GlbScene, write_glb};
//! use armature_formats::read_model;
//!
//! let no_other_files = |name: &str| Err(format!("there is no {name}"));
//! let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
//! let model = read_model("square.obj", obj, &no_other_files)?;
//! assert_eq!(model.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
//!
//! let skeleton = armature_rig::Skeleton::default();
//! let scene = GlbScene { name: "square", skeleton: &skeleton, mesh: Some(GlbMesh::of_model(&model)), clips: vec![] };
//! let again = read_model("square.glb", &write_glb(&scene)?, &no_other_files)?;
//! assert_eq!(again.mesh, model.mesh);
//! # Ok::<(), armature_formats::FormatError>(())
//! ```
//!
//! | module | verbs |
//! |---|---|
//! | this one | [`read_model`]: OBJ, OFF, PLY, STL, Medit MESH, glTF, GLB and FBX to a [`model::Model`] |
//! | [`model`] | the contents of a model file; drawn vertices along seams |
//! | [`mesh`] | [`write_obj`](mesh::write_obj), [`write_mesh`](mesh::write_mesh) (Medit), [`write_msh`](mesh::write_msh) (Gmsh), [`write_vtu`](mesh::write_vtu) (VTK) |
//! | [`skeleton`] | [`read_tgf`](skeleton::read_tgf), [`skeleton_from_graph`](skeleton::skeleton_from_graph) |
//! | [`motion`] | [`read_bvh`](motion::read_bvh), [`write_bvh`](motion::write_bvh), [`add_clip`](motion::add_clip), [`write_vrma`](motion::write_vrma) |
//! | [`gltf`] | [`write_glb`](gltf::write_glb), [`read_gltf_skeleton`](gltf::read_gltf_skeleton) |
//! | [`fbx`] | [`write_fbx`](fbx::write_fbx), [`read_fbx_skeleton`](fbx::read_fbx_skeleton) |
//! | [`usd`] | [`write_usda`](usd::write_usda), [`write_usdz`](usd::write_usdz) |
//! | [`tables`] | [`read_npy`](tables::read_npy), [`write_npy`](tables::write_npy), [`write_npz`](tables::write_npz), [`read_dmat`](tables::read_dmat), [`write_dmat`](tables::write_dmat) |
//! | [`settings`] | [`read_calibration`](settings::read_calibration), [`write_calibration`](settings::write_calibration), [`read_mapping`](settings::read_mapping), [`write_mapping`](settings::write_mapping) |
//!
//! Everything here is pure: bytes come in, files that a file references come through a [`model::Resolver`], and errors
//! say which file, which line or byte, what is wrong and what to do ([`FormatError`]). Nothing panics on any input, and
//! no count in a header is trusted before the bytes after it are there.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "numbers from a file are kept unchanged"))]

mod archive;
pub mod fbx;
pub mod gltf;
pub mod mesh;
pub mod model;
pub mod motion;
mod read_model;
pub mod settings;
pub mod skeleton;
pub mod tables;
mod text;
pub mod usd;

pub use read_model::read_model;
pub use text::{FormatError, Place};
