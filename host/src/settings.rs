//! What the program keeps for a user: calibration, and where takes go.

use std::path::{Path, PathBuf};

use armature_rig::{Calibration, Mapping};

use crate::failure::Failure;
use crate::files;

/// Where the calibration of this user's joints is kept.
pub fn calibration_file() -> Option<PathBuf> {
    directories::ProjectDirs::from("", "", "armature").map(|d| d.config_dir().join("calibration.toml"))
}

/// Where the window puts takes: in the user's documents or home.
pub fn takes_folder() -> PathBuf {
    let documents =
        directories::UserDirs::new().map(|d| d.document_dir().unwrap_or_else(|| d.home_dir()).to_path_buf());
    documents.unwrap_or_default().join("Armature takes")
}

/// Reads a calibration; a file that does not exist yet is an empty one.
pub fn read_calibration(path: &Path) -> Result<Calibration, Failure> {
    if !path.exists() {
        return Ok(Calibration::default());
    }
    let read = armature_formats::read_calibration(&files::read(path)?);
    read.map_err(|e| e.in_file(&path.display().to_string()).into())
}

/// Reads a mapping.
pub fn read_mapping(path: &Path) -> Result<Mapping, Failure> {
    armature_formats::read_mapping(&files::read(path)?).map_err(|e| e.in_file(&path.display().to_string()).into())
}

/// The wall clock, microseconds since 1970 UTC.
pub fn unix_micros() -> Option<i64> {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).ok()?;
    i64::try_from(since.as_micros()).ok()
}
