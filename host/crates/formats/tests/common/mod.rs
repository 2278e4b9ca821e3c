//! Where the shared data lies.

use std::path::{Path, PathBuf};

/// The bytes of a file below `shared/data`, which is looked for in every folder above this crate. Where it is absent
/// the test is skipped loudly, or fails if `ARMATURE_REQUIRE_SHARED_DATA` is set.
pub(crate) fn shared(name: &str) -> Option<Vec<u8>> {
    let found =
        Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().map(|folder| folder.join("shared/data")).find(|p| p.is_dir());
    let path: PathBuf = found.unwrap_or_default().join(name);
    match std::fs::read(&path) {
        Ok(bytes) => Some(bytes),
        Err(error) => {
            assert!(std::env::var_os("ARMATURE_REQUIRE_SHARED_DATA").is_none(), "shared/data/{name}: {error}");
            println!("SKIPPED: shared/data/{name} is not there");
            None
        }
    }
}
