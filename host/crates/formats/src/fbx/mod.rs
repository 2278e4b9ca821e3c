//! FBX, binary and text, versions 3 to 7.7, by the library ufbx.
//!
//! The library brings the file's axes and unit to ours (+Y up, metres), splits what FBX composes (pre- and
//! post-rotations, rotation orders, pivots, geometric transforms, inherited scales) into plain transforms, and checks
//! every index. What is taken from its scene here is looked up defensively all the same. Files are written node by node
//! with `fbxcel`, as binary 7.4.

mod clips;
mod euler;
mod materials;
mod meshes;
mod open;
mod read;
mod rig;
mod write;
mod write_clip;
mod write_document;
mod write_material;
mod write_mesh;
mod write_skeleton;

pub(crate) use open::is_fbx;
pub(crate) use read::read_fbx;
pub use read::read_fbx_skeleton;
pub use write::{FbxFile, FbxNotes, write_fbx};
