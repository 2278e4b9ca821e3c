//! Bytes to meshes, skeletons and motion, and back.
//!
//! Everything here is pure: bytes come in, files that a file names come through a [`Resolver`], and errors say which
//! file, which line or byte, what is wrong and what to do ([`FormatError`]). Nothing panics on any input, and no
//! count in a header is believed before the bytes behind it are there.

#![cfg_attr(test, allow(clippy::float_cmp, reason = "numbers from a file come through unchanged"))]

mod bvh;
mod calibration_file;
mod cells;
mod dmat;
mod error;
mod gltf;
mod gmsh;
mod graph_skeleton;
mod mapping_file;
mod medit;
mod model;
mod names;
mod npy;
mod obj;
mod off;
mod ply;
mod polygon;
mod read_model;
mod seams;
mod stl;
mod tails;
mod text;
mod texture;
mod tgf;
mod vtu;

pub use bvh::{read_bvh, write_bvh};
pub use calibration_file::{read_calibration, write_calibration};
pub use cells::{CellData, CellDataLength, CellMesh, Cells};
pub use dmat::{read_dmat, write_dmat};
pub use error::{FormatError, Place};
pub use gltf::{GlbClip, GlbMesh, GlbScene, GlbTimes, write_glb};
pub use gmsh::write_msh;
pub use graph_skeleton::{GraphError, GraphSkeleton, skeleton_from_graph};
pub use mapping_file::{read_mapping, write_mapping};
pub use medit::write_mesh;
pub use model::{Model, ModelRig, Split, Texture};
pub use npy::{NumberTable, read_npy, write_npy};
pub use obj::write_obj;
pub use read_model::{Resolver, read_model};
pub use tgf::{TgfGraph, read_tgf};
pub use vtu::write_vtu;
