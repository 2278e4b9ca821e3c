//! FBX, binary and text, versions 3 to 7.7, by the library ufbx.
//!
//! The library brings the file's axes and unit to ours (+Y up, metres), splits what FBX composes (pre- and
//! post-rotations, rotation orders, pivots, geometric transforms, inherited scales) into plain transforms, and checks
//! every index. What is taken from its scene here is looked up defensively all the same.

mod clips;
mod materials;
mod meshes;
mod open;
mod read;
mod rig;

pub(crate) use open::is_fbx;
pub(crate) use read::read_fbx;
pub use read::read_fbx_skeleton;
