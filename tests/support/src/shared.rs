//! The shared data: real meshes, skeletons and motions that are beside the repository and are read in place.

use std::path::{Path, PathBuf};

/// If this environment variable is set, a test whose data is missing fails instead of skipping.
pub const REQUIRE_SHARED_DATA: &str = "ARMATURE_REQUIRE_SHARED_DATA";

/// A file or folder of the shared data by its name, like `hand.mesh` or `../reference/hand-bbw-w.npy`: searched for in
/// `shared/data` next to every folder above this crate.
///
/// # Panics
/// If it is missing and [`REQUIRE_SHARED_DATA`] is set. Otherwise the skip is printed and the result is `None`.
pub fn shared(name: &str) -> Option<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let found = here.ancestors().map(|folder| folder.join("shared/data").join(name)).find(|path| path.exists());
    if found.is_none() {
        assert!(std::env::var_os(REQUIRE_SHARED_DATA).is_none(), "shared/data/{name} is required but missing");
        println!("SKIPPED: shared/data/{name} is missing");
    }
    found
}

/// The bytes of a file of the shared data; see [`shared`].
///
/// # Panics
/// As [`shared`], and if the file cannot be read.
pub fn shared_bytes(name: &str) -> Option<Vec<u8>> {
    shared(name).map(|path| std::fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
}
