//! Files that a command writes: an existing file is never overwritten unless the user says so.

use std::fs::{File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use super::{beside, replace_whole};
use crate::descriptors;
use crate::failure::Failure;

/// Whether existing files may be replaced; an option of every command that writes files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::Args)]
pub struct Overwrite {
    /// Replace files that are already there
    #[arg(long)]
    pub force: bool,
}

impl Overwrite {
    /// Checks before the work whether its result can be written: the folder exists, and no file is in the way.
    pub fn check(self, path: &Path) -> Result<(), Failure> {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            let what = format!("{} cannot be written: there is no folder {}", path.display(), folder.display());
            return Err(Failure::usage(what, "create the folder, or choose another"));
        }
        match std::fs::metadata(path) {
            Ok(there) if there.is_dir() => {
                Err(Failure::usage(format!("{} is a folder", path.display()), "name a file in it"))
            }
            Ok(there) if there.is_file() && !self.force => Err(exists(path)),
            _ => Ok(()),
        }
    }

    /// Writes a whole file, so that a failure or a crash leaves no partial file and, when replacing one, keeps the old
    /// one. Devices and pipes are written to directly.
    pub fn write(self, path: &Path, bytes: &[u8]) -> Result<(), Failure> {
        self.check(path)?;
        let failed = |error: std::io::Error| cannot_write(path, &error);
        match std::fs::metadata(path) {
            Ok(there) if !there.is_file() => {
                OpenOptions::new().write(true).open(path).and_then(|mut device| device.write_all(bytes)).map_err(failed)
            }
            // The target of a link is replaced, not the link.
            Ok(_) => replace_whole(&std::fs::canonicalize(path).map_err(failed)?, bytes).map_err(failed),
            Err(_) => {
                drop(claim(path)?);
                replace_whole(path, bytes).map_err(|error| {
                    // The claimed name holds an empty file; if it cannot be removed either, that changes nothing.
                    let _ = std::fs::remove_file(path);
                    failed(error)
                })
            }
        }
    }

    /// Opens a file that grows during the work. Where it replaces one, it grows beside that one until it is
    /// [settled](GrowingFile::settle).
    pub fn create(self, path: &Path) -> Result<GrowingFile, Failure> {
        self.check(path)?;
        let failed = |error: std::io::Error| cannot_write(path, &error);
        match std::fs::metadata(path) {
            Ok(there) if there.is_file() => {
                // What a link points to is replaced, not the link.
                let replaced = std::fs::canonicalize(path).map_err(failed)?;
                let beside = beside(&replaced);
                let file = File::create(&beside).map_err(failed)?;
                file.set_permissions(there.permissions()).map_err(failed)?;
                Ok(GrowingFile { file, replaces: Some((beside, replaced)) })
            }
            // A device or a pipe.
            Ok(_) => Ok(GrowingFile { file: File::create(path).map_err(failed)?, replaces: None }),
            Err(_) => Ok(GrowingFile { file: claim(path)?, replaces: None }),
        }
    }
}

/// A file that is written bit by bit, and can be read at any time.
#[derive(Debug)]
pub struct GrowingFile {
    file: File,
    /// Where it grows, and the file whose place it takes in the end.
    replaces: Option<(PathBuf, PathBuf)>,
}

impl GrowingFile {
    /// Makes sure that what was written stays, and, if the work `succeeded`, puts it in the place of the file that it
    /// replaces. Returns where it is, if that one was kept.
    pub fn settle(&mut self, succeeded: bool) -> std::io::Result<Option<PathBuf>> {
        self.file.sync_all().or_else(|error| if is_regular(&self.file) { Err(error) } else { Ok(()) })?;
        match self.replaces.take() {
            Some((beside, replaced)) if succeeded => std::fs::rename(beside, replaced).map(|()| None),
            kept => Ok(kept.map(|(beside, _)| beside)),
        }
    }
}

/// Devices and pipes cannot be synchronised, and need not be.
fn is_regular(file: &File) -> bool {
    file.metadata().is_ok_and(|there| there.is_file())
}

impl Write for GrowingFile {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// Creates the file; nobody else can have created it between the check and now.
fn claim(path: &Path) -> Result<File, Failure> {
    OpenOptions::new().write(true).create_new(true).open(path).map_err(|error| match error.kind() {
        ErrorKind::AlreadyExists => exists(path),
        _ => cannot_write(path, &error),
    })
}

fn exists(path: &Path) -> Failure {
    Failure::usage(
        format!("{} is already there", path.display()),
        "choose another name, or replace the file with --force",
    )
}

/// Why a file could not be written, and what to do.
pub(super) fn cannot_write(path: &Path, error: &std::io::Error) -> Failure {
    let remedy = match error.kind() {
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => "free some space, or choose another disk",
        ErrorKind::InvalidFilename => "choose a shorter name",
        _ if descriptors::are_used_up(error) => descriptors::REMEDY,
        _ => "choose a folder you may write to",
    };
    Failure::input(format!("{} cannot be written: {error}", path.display()), remedy)
}

#[cfg(test)]
mod tests {
    use super::*;

    const KEEP: Overwrite = Overwrite { force: false };
    const FORCE: Overwrite = Overwrite { force: true };

    fn folder(name: &str) -> std::path::PathBuf {
        let folder = std::env::temp_dir().join(format!("armature-output-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    #[test]
    fn a_file_that_is_there_stays_unless_forced() {
        let folder = folder("stays");
        let path = folder.join("a.txt");
        KEEP.write(&path, b"one").unwrap();
        for failure in [KEEP.write(&path, b"two").unwrap_err(), KEEP.create(&path).unwrap_err()] {
            assert_eq!(failure.kind.exit_code(), 2);
            assert!(failure.what.contains("a.txt") && failure.remedy.contains("--force"), "{failure}");
        }
        assert_eq!(std::fs::read(&path).unwrap(), b"one");
        FORCE.write(&path, b"three").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"three");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1, "no parts are left");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn no_folder_is_made_by_a_slip_of_the_keyboard() {
        let folder = folder("slip");
        let failure = KEEP.write(&folder.join("no/such/a.txt"), b"").unwrap_err();
        assert!(failure.what.contains("there is no folder"), "{failure}");
        assert!(!folder.join("no").exists());
        assert!(FORCE.write(&folder, b"").unwrap_err().what.contains("is a folder"));
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_that_is_replaced_bit_by_bit_stays_until_the_end() {
        let folder = folder("grows");
        let path = folder.join("a.take");
        std::fs::write(&path, b"old").unwrap();
        let mut failed = FORCE.create(&path).unwrap();
        failed.write_all(b"ne").unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        let beside = failed.settle(false).unwrap().unwrap();
        assert_eq!((std::fs::read(&path).unwrap(), std::fs::read(&beside).unwrap()), (b"old".to_vec(), b"ne".to_vec()));
        let mut whole = FORCE.create(&path).unwrap();
        whole.write_all(b"new").unwrap();
        assert_eq!(whole.settle(true).unwrap(), None);
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert!(!beside.exists());
        let mut first = KEEP.create(&folder.join("b.take")).unwrap();
        assert_eq!(first.settle(false).unwrap(), None, "nothing is replaced");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn devices_stay_devices_and_links_stay_links() {
        KEEP.write(Path::new("/dev/null"), b"gone").unwrap();
        assert!(!std::fs::metadata("/dev/null").unwrap().is_file());
        let full = KEEP.write(Path::new("/dev/full"), b"too much").unwrap_err();
        assert!(full.remedy.contains("space"), "{full}");
        let folder = folder("links");
        let (real, link) = (folder.join("real.txt"), folder.join("link.txt"));
        std::fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink("real.txt", &link).unwrap();
        assert_eq!(KEEP.write(&link, b"new").unwrap_err().kind.exit_code(), 2);
        FORCE.write(&link, b"new").unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(std::fs::read(&real).unwrap(), b"new");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = folder("mode");
        let path = folder.join("private.txt");
        std::fs::write(&path, b"old").unwrap();
        std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o600)).unwrap();
        FORCE.write(&path, b"new").unwrap();
        assert_eq!(std::fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
