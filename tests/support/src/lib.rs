//! Shared by the tests of every crate: where the shared data is, and a minimal reader for each format needed by crates
//! that do not use the file formats.
//!
//! ```no_run
//! use armature_test_support::{read_obj, shared};
//!
//! // A test without its data says so and ends.
//! let Some(file) = shared("armadillo.obj") else { return };
//! let surface = read_obj(&file);
//! assert_eq!(surface.triangles.len(), 86_482);
//! ```
//!
//! This crate uses no other crate of the workspace, so that all of them can use it, and is only ever a dev-dependency.
//! The readers panic on anything but the files they are for: `armature-formats` reads users' files.

mod numbers;
mod read;
mod shared;

pub use numbers::{Array, read_npy, read_npy_indices};
pub use read::{Surface, Volume, read_mesh, read_obj, read_off, read_tgf};
pub use shared::{REQUIRE_SHARED_DATA, shared, shared_bytes};
