//! What the program keeps for a user: calibration, and where takes go.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use armature_rig::{Calibration, Mapping};

use crate::failure::Failure;
use crate::files;

/// Where the calibration of this user's joints is kept.
pub fn calibration_file() -> Option<PathBuf> {
    directories::ProjectDirs::from("", "", "armature").map(|d| d.config_dir().join("calibration.toml"))
}

/// Where the window puts takes: a folder in the user's documents or home, created when first needed.
pub fn takes_folder() -> Result<PathBuf, Failure> {
    let documents =
        directories::UserDirs::new().map(|d| d.document_dir().unwrap_or_else(|| d.home_dir()).to_path_buf());
    let folder = documents.unwrap_or_default().join("Armature takes");
    match std::fs::create_dir_all(&folder) {
        Ok(()) => Ok(folder),
        Err(e) => Err(Failure::input(
            format!("the folder {} cannot be made: {e}", folder.display()),
            "make room for it, or its parent writable",
        )),
    }
}

/// Reads a calibration; a file that does not exist yet counts as empty.
pub fn read_calibration(path: &Path) -> Result<Calibration, Failure> {
    if !path.exists() {
        return Ok(Calibration::default());
    }
    let read = armature_formats::settings::read_calibration(&files::read(path)?);
    read.map_err(|e| {
        let mut failure = Failure::from(e.in_file(&path.display().to_string()));
        let backup = backup_of(path);
        if backup.exists() {
            let _ = write!(failure.remedy, "; what it was before is in {}", backup.display());
        }
        failure
    })
}

/// Writes a calibration so that a failure or a crash at any moment leaves a complete one: the previous one is kept
/// beside it as `.bak`. An unchanged one is not written.
pub fn write_calibration(path: &Path, calibration: &Calibration) -> Result<(), Failure> {
    let text = armature_formats::settings::write_calibration(calibration);
    if path.exists() {
        let former = files::read(path)?;
        if former == text.as_bytes() {
            return Ok(());
        }
        files::replace(&backup_of(path), &former)?;
    }
    files::replace(path, text.as_bytes())
}

fn backup_of(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(".bak");
    path.with_file_name(name)
}

/// Reads a mapping.
pub fn read_mapping(path: &Path) -> Result<Mapping, Failure> {
    armature_formats::settings::read_mapping(&files::read(path)?)
        .map_err(|e| e.in_file(&path.display().to_string()).into())
}

/// The wall clock, microseconds since 1970 UTC.
pub fn unix_micros() -> Option<i64> {
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).ok()?;
    i64::try_from(since.as_micros()).ok()
}

#[cfg(test)]
mod tests {
    use armature_rig::{JointAxis, PartUid, SensorCalibration};

    use super::*;

    fn zeroed(counts: u16) -> Calibration {
        let mut calibration = Calibration::default();
        let sensor = SensorCalibration { zero_counts: Some(counts), ..SensorCalibration::unzeroed(JointAxis::Bend) };
        calibration.set_part(PartUid([7; 12]), vec![sensor]);
        calibration
    }

    #[test]
    fn a_calibration_is_never_lost_on_a_failed_write() {
        let folder = std::env::temp_dir().join(format!("armature-settings-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("calibration.toml");
        write_calibration(&path, &zeroed(1)).unwrap();
        write_calibration(&path, &zeroed(2)).unwrap();
        write_calibration(&path, &zeroed(2)).unwrap();
        assert_eq!(read_calibration(&path).unwrap(), zeroed(2));
        assert_eq!(read_calibration(&backup_of(&path)).unwrap(), zeroed(1), "an unchanged one makes no new backup");
        // An editor crashed while saving.
        std::fs::write(&path, "version = 2\n[[part").unwrap();
        let failure = read_calibration(&path).unwrap_err();
        assert!(failure.remedy.contains("calibration.toml.bak"), "{failure}");
        // The disk accepts nothing more: a folder is in place of the file that would be written first.
        std::fs::write(&path, armature_formats::settings::write_calibration(&zeroed(2))).unwrap();
        std::fs::create_dir(folder.join(format!("calibration.toml.{}.part", std::process::id()))).unwrap();
        assert!(write_calibration(&path, &zeroed(3)).is_err());
        assert_eq!(read_calibration(&path).unwrap(), zeroed(2));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
