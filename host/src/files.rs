//! Files, as the program reads and writes them: whole, with errors that name the file and the remedy.

use std::io::Write;
use std::path::{Path, PathBuf};

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
            _ => String::new(),
        };
        Failure::input(format!("{}: {error}", path.display()), remedy)
    };
    let metadata = std::fs::metadata(path).map_err(|e| bad(&e))?;
    if metadata.is_dir() {
        return Err(Failure::input(format!("{} is a folder", path.display()), "name a file in it"));
    }
    if metadata.len() > LARGEST_INPUT {
        let what = format!(
            "{} has {} bytes, more than the {LARGEST_INPUT} this program reads",
            path.display(),
            metadata.len()
        );
        return Err(Failure::input(what, "split the file or reduce the mesh"));
    }
    std::fs::read(path).map_err(|e| bad(&e))
}

/// Writes a whole file so that a failure or a crash leaves the old one as it was: first beside it, then renamed.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let bad = |error: std::io::Error| {
        Failure::input(
            format!("{} cannot be written: {error}", path.display()),
            "choose a folder you may write to that has room",
        )
    };
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(bad)?;
    }
    let beside = beside(path);
    let written = std::fs::File::create(&beside).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    let renamed = written.and_then(|()| std::fs::rename(&beside, path));
    renamed.map_err(|error| {
        // The half-written neighbour is of no use to anyone; that it cannot be removed either changes nothing.
        let _ = std::fs::remove_file(&beside);
        bad(error)
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

/// Finds the files that a model names (textures, buffers) beside it, and nowhere else.
pub fn neighbours(path: &Path) -> impl Fn(&str) -> Result<Vec<u8>, String> + use<> {
    let folder = path.parent().map(Path::to_path_buf).unwrap_or_default();
    move |name: &str| {
        let relative = Path::new(name);
        let leaves_folder =
            relative.components().any(|c| !matches!(c, std::path::Component::Normal(_) | std::path::Component::CurDir));
        if leaves_folder {
            return Err(format!("{name:?} lies outside the model's folder"));
        }
        read(&folder.join(relative)).map_err(|failure| failure.what)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_write_replaces_whole_files_and_leaves_no_parts() {
        let folder = std::env::temp_dir().join(format!("armature-files-{}", std::process::id()));
        let path = folder.join("a.txt");
        write(&path, b"one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(read(&path).unwrap(), b"two");
        assert_eq!(std::fs::read_dir(&folder).unwrap().count(), 1);
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(read(&path).unwrap_err().kind.exit_code(), 3);
    }

    #[test]
    fn neighbours_stay_in_the_folder() {
        let resolve = neighbours(Path::new("models/fox.gltf"));
        assert!(resolve("../secret").unwrap_err().contains("outside"));
        assert!(resolve("/etc/hostname").unwrap_err().contains("outside"));
    }
}
