//! Files, as the program reads and writes them: whole, with errors that name the file and the remedy.

pub mod grey_maps;
pub mod inputs;
mod output;
pub mod places;
pub mod tables;

use std::fs::File;
use std::io::{Read, Write};
use std::path::{Component, Path, PathBuf};

pub use output::{GrowingFile, Overwrite};

use self::output::cannot_write;
use crate::descriptors;
use crate::failure::Failure;

/// No input of ours is larger; a larger file is a mistake that would only fill the memory.
const LARGEST_INPUT: u64 = 4 << 30;

/// Reads a whole file.
pub fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let bad = |error: &std::io::Error| {
        let remedy = match error.kind() {
            std::io::ErrorKind::NotFound => "check the spelling and the folder".to_string(),
            std::io::ErrorKind::PermissionDenied => {
                "the file may not be read by you; change its permissions".to_string()
            }
            _ if descriptors::are_used_up(error) => descriptors::REMEDY.to_string(),
            _ => String::new(),
        };
        Failure::input(format!("{}: {error}", path.display()), remedy)
    };
    let file = File::open(path).map_err(|e| bad(&e))?;
    let metadata = file.metadata().map_err(|e| bad(&e))?;
    if metadata.is_dir() {
        return Err(Failure::input(format!("{} is a folder", path.display()), "name a file in it"));
    }
    let mut bytes = Vec::new();
    // A pipe or device does not say its length.
    let length = file.take(LARGEST_INPUT + 1).read_to_end(&mut bytes).map_err(|e| bad(&e))?;
    if length as u64 > LARGEST_INPUT || metadata.len() > LARGEST_INPUT {
        let what = format!("{} has more than the {LARGEST_INPUT} bytes this program reads", path.display());
        return Err(Failure::input(what, "split the file or reduce the mesh"));
    }
    Ok(bytes)
}

/// Writes a file of the program's own (settings, cache) and the folders above it, whether or not it is there.
pub fn replace(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    folder
        .map_or(Ok(()), std::fs::create_dir_all)
        .and_then(|()| replace_whole(path, bytes))
        .map_err(|e| cannot_write(path, &e))
}

/// Writes a whole file so that a failure or a crash leaves the old one as it was: first beside it, then renamed.
fn replace_whole(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let beside = beside(path);
    let written = File::create(&beside).and_then(|mut file| {
        if let Ok(old) = std::fs::metadata(path) {
            file.set_permissions(old.permissions())?;
        }
        file.write_all(bytes)?;
        file.sync_all()
    });
    written.and_then(|()| std::fs::rename(&beside, path)).inspect_err(|_| {
        // The half-written neighbour is of no use to anyone; that it cannot be removed either changes nothing.
        let _ = std::fs::remove_file(&beside);
    })
}

fn beside(path: &Path) -> PathBuf {
    let mut name = path.file_name().unwrap_or_default().to_os_string();
    name.push(format!(".{}.part", std::process::id()));
    path.with_file_name(name)
}

/// The file's name without its folder, for messages.
pub fn name_of(path: &Path) -> String {
    path.file_name().map_or_else(|| path.display().to_string(), |n| n.to_string_lossy().into_owned())
}

/// The lower-case extension.
pub fn extension_of(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
}

/// Finds the files that a model names (textures, buffers) in its folder, and nowhere else: no path and no link leads out
/// of it, and only regular files are read, for a pipe or a device would never end.
pub fn neighbours(path: &Path) -> impl Fn(&str) -> Result<Vec<u8>, String> + use<> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder.to_path_buf(),
        _ => PathBuf::from("."),
    };
    move |name: &str| {
        let outside = || format!("{name:?} lies outside the model's folder");
        let inside = folder.join(within(name).ok_or_else(outside)?);
        // Without the path: warnings are saved with the character, which may reach other machines.
        let failed = |error: std::io::Error| error.to_string();
        let real = std::fs::canonicalize(&inside).map_err(failed)?;
        if !real.starts_with(std::fs::canonicalize(&folder).map_err(failed)?) {
            return Err(format!("{name:?} is a link that leads out of the model's folder"));
        }
        if !std::fs::metadata(&real).map_err(failed)?.is_file() {
            return Err(format!("{name:?} is no regular file"));
        }
        if std::fs::metadata(&real).map_err(failed)?.len() > LARGEST_INPUT {
            return Err(format!("{name:?} has more than the {LARGEST_INPUT} bytes this program reads"));
        }
        std::fs::read(&real).map_err(failed)
    }
}

/// A relative path without `.` and `..`; `None` if it leaves the folder it starts from.
fn within(name: &str) -> Option<PathBuf> {
    let mut path = PathBuf::new();
    for component in Path::new(name).components() {
        match component {
            Component::Normal(part) => path.push(part),
            Component::CurDir => {}
            Component::ParentDir if path.pop() => {}
            _ => return None,
        }
    }
    Some(path)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_our_own_is_replaced_whole_and_leaves_no_parts() {
        let folder = std::env::temp_dir().join(format!("armature-files-{}", std::process::id()));
        let path = folder.join("a.txt");
        replace(&path, b"one").unwrap();
        replace(&path, b"two").unwrap();
        assert_eq!(read(&path).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(read(&path).unwrap_err().kind.exit_code(), 3);
    }

    #[test]
    fn neighbours_stay_in_the_folder() {
        let resolve = neighbours(Path::new("models/fox.gltf"));
        for name in ["../secret", "/etc/hostname", "a/../../secret", "..", "a/b/../../.."] {
            assert!(resolve(name).unwrap_err().contains("outside"), "{name}");
        }
        assert_eq!(within("sub/../x.bin"), Some("x.bin".into()));
        assert_eq!(within("./a/./b/../c.bin"), Some("a/c.bin".into()));
    }

    #[cfg(unix)]
    #[test]
    fn neighbours_are_regular_files_that_no_link_leads_away_from() {
        let folder = std::env::temp_dir().join(format!("armature-neighbours-{}", std::process::id()));
        let models = folder.join("models");
        std::fs::create_dir_all(models.join("sub")).unwrap();
        std::fs::write(folder.join("secret"), b"secret").unwrap();
        std::fs::write(models.join("x.bin"), b"data").unwrap();
        let link = |to: &str, name: &str| std::os::unix::fs::symlink(to, models.join(name)).unwrap();
        link("../secret", "away.bin");
        link("/dev/zero", "zero.bin");
        link("x.bin", "near.bin");
        let made = std::process::Command::new("mkfifo").arg(models.join("pipe.bin")).status().unwrap();
        assert!(made.success());
        let resolve = neighbours(&models.join("fox.gltf"));
        assert_eq!(resolve("sub/../x.bin").unwrap(), b"data");
        assert_eq!(resolve("near.bin").unwrap(), b"data");
        assert!(resolve("away.bin").unwrap_err().contains("leads out"));
        assert!(resolve("zero.bin").unwrap_err().contains("leads out"));
        assert!(resolve("pipe.bin").unwrap_err().contains("no regular file"));
        assert!(resolve("sub").unwrap_err().contains("no regular file"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
