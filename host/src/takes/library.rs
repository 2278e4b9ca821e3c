//! The takes of a folder: what each is called, how long it is, what a person noted about it; and the bin.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::failure::Failure;
use crate::files;
use crate::takes::{self, edits, opened};

/// The index beside the takes, a text file: what was read of them once, and what people noted.
const INDEX: &str = "takes.toml";
/// Where discarded takes lie.
pub const BIN: &str = "Bin";
/// The version of the index.
const VERSION: u32 = 1;
/// The best rating.
pub const MOST_STARS: u8 = 5;

/// A take of the folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ListedTake {
    /// Its file.
    pub path: PathBuf,
    /// Its length, seconds.
    pub seconds: f64,
    /// Samples in it.
    pub samples: u64,
    /// Samples that never arrived.
    pub lost: u64,
    /// 0 for none, up to [`MOST_STARS`].
    pub rating: u8,
    /// What a person noted.
    pub note: String,
    /// Whether there are edits for it.
    pub edited: bool,
    /// Why it cannot be read.
    pub trouble: Option<String>,
}

impl ListedTake {
    /// Its name: the file's, without the extension.
    pub fn name(&self) -> String {
        self.path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default()
    }
}

/// The takes of a folder, the newest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Library {
    /// The folder.
    pub folder: PathBuf,
    /// Its takes.
    pub takes: Vec<ListedTake>,
    /// Discarded ones.
    pub bin: Vec<ListedTake>,
}

/// The index as it is written.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Index {
    version: u32,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    take: BTreeMap<String, Known>,
}

/// What is known of a take. Its length in bytes says whether it is still the same file.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Known {
    bytes: u64,
    seconds: f64,
    samples: u64,
    lost: u64,
    #[serde(default)]
    rating: u8,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    note: String,
}

/// Lists the takes of a folder and of its bin. `except`: one that is being written.
pub fn list(folder: &Path, except: Option<&Path>) -> Result<Library, Failure> {
    let bin = folder.join(BIN);
    let discarded = if bin.is_dir() { listed(&bin, None)? } else { Vec::new() };
    Ok(Library { folder: folder.to_owned(), takes: listed(folder, except)?, bin: discarded })
}

/// Keeps a note and a rating.
pub fn annotate(path: &Path, note: &str, rating: u8) -> Result<(), Failure> {
    let folder = folder_of(path);
    let mut index = read_index(&folder)?;
    let known = index.take.entry(files::name_of(path)).or_default();
    note.trim().clone_into(&mut known.note);
    known.rating = rating.min(MOST_STARS);
    write_index(&folder, &index)
}

/// Puts a take and its edits into the bin. Returns where it lies.
pub fn discard(path: &Path) -> Result<PathBuf, Failure> {
    let bin = folder_of(path).join(BIN);
    std::fs::create_dir_all(&bin)
        .map_err(|e| Failure::input(format!("{}: {e}", bin.display()), "make its folder writable"))?;
    carry(path, &bin)
}

/// Takes a take and its edits out of the bin. Returns where it lies.
pub fn restore(path: &Path) -> Result<PathBuf, Failure> {
    let bin = folder_of(path);
    match bin.parent() {
        Some(folder) if bin.file_name() == Some(OsStr::new(BIN)) => carry(path, folder),
        _ => Err(Failure::usage(format!("{} is not in the bin", path.display()), "")),
    }
}

/// Moves a take with its edit list and notes, under a free name.
fn carry(path: &Path, to: &Path) -> Result<PathBuf, Failure> {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let target = takes::free_name(to, &stem);
    let moved = |from: &Path, to: &Path| {
        std::fs::rename(from, to)
            .map_err(|e| Failure::input(format!("{} cannot be moved: {e}", from.display()), "make its folder writable"))
    };
    moved(path, &target)?;
    let list = opened::list_of(path);
    if list.exists() {
        let mut edits = edits::read(&list)?;
        if edits.take == files::name_of(path) {
            // The take may have got another name.
            edits.take = files::name_of(&target);
            files::replace(&opened::list_of(&target), edits.write().as_bytes())?;
            // A list that stays behind is of no use, and no harm.
            let _ = std::fs::remove_file(&list);
        }
    }
    let from = folder_of(path);
    let mut index = read_index(&from)?;
    if let Some(known) = index.take.remove(&files::name_of(path)) {
        let mut other = read_index(to)?;
        other.take.insert(files::name_of(&target), known);
        write_index(to, &other)?;
        write_index(&from, &index)?;
    }
    Ok(target)
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).map_or_else(|| PathBuf::from("."), Path::to_path_buf)
}

fn listed(folder: &Path, except: Option<&Path>) -> Result<Vec<ListedTake>, Failure> {
    let unreadable =
        |e: std::io::Error| Failure::input(format!("{}: {e}", folder.display()), "make the folder readable");
    let mut index = read_index(folder)?;
    let mut found = Vec::new();
    for file in std::fs::read_dir(folder).map_err(unreadable)? {
        let path = file.map_err(unreadable)?.path();
        let metadata = path.metadata().ok().filter(std::fs::Metadata::is_file);
        let Some(metadata) = metadata.filter(|_| files::extension_of(&path) == "take") else { continue };
        if except != Some(path.as_path()) {
            found.push((metadata.modified().ok(), metadata.len(), path));
        }
    }
    found.sort_by(|a, b| b.0.cmp(&a.0).then_with(|| a.2.cmp(&b.2)));
    let mut takes = Vec::with_capacity(found.len());
    let mut learnt = false;
    for (_, bytes, path) in found {
        let name = files::name_of(&path);
        let known = index.take.entry(name).or_default();
        let mut trouble = None;
        if known.bytes != bytes {
            match takes::read(&path) {
                Ok((take, _)) => {
                    let summary = armature_take::summarize(&take);
                    let (seconds, samples, lost) = (summary.duration_seconds, summary.samples, summary.lost_samples);
                    *known = Known { bytes, seconds, samples, lost, ..std::mem::take(known) };
                    learnt = true;
                }
                Err(failure) => trouble = Some(failure.what),
            }
        }
        let Known { seconds, samples, lost, rating, note, .. } = known.clone();
        let edited = opened::list_of(&path).exists();
        takes.push(ListedTake { path, seconds, samples, lost, rating, note, edited, trouble });
    }
    // A folder that cannot be written to can still be listed.
    if learnt && let Err(failure) = write_index(folder, &index) {
        tracing::warn!("{failure}");
    }
    Ok(takes)
}

fn read_index(folder: &Path) -> Result<Index, Failure> {
    let path = folder.join(INDEX);
    if !path.exists() {
        return Ok(Index { version: VERSION, take: BTreeMap::new() });
    }
    let bytes = files::read(&path)?;
    let remedy = "correct the file, or delete it: only notes and ratings are lost";
    let text = String::from_utf8(bytes)
        .map_err(|_| Failure::input(format!("{}: this is not UTF-8 text", path.display()), remedy))?;
    let index: Index = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text.bytes().take(span.start).filter(|b| *b == b'\n').count());
        Failure::input(format!("{}, line {line}: {}", path.display(), error.message().replace('\n', " ")), remedy)
    })?;
    if index.version != VERSION {
        let what =
            format!("{} is of version {}, but this program knows version {VERSION}", path.display(), index.version);
        return Err(Failure::input(what, "use a newer program"));
    }
    Ok(index)
}

fn write_index(folder: &Path, index: &Index) -> Result<(), Failure> {
    let text = toml::to_string(index).map_err(|e| {
        Failure::input(format!("{}: {e}", folder.join(INDEX).display()), "this is a defect; please report it")
    })?;
    files::replace(&folder.join(INDEX), text.as_bytes())
}

#[cfg(test)]
mod tests {
    use armature_take::{EditList, Header, TakeWriter};

    use super::*;

    fn folder(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("armature-library-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn take(samples: u32) -> Vec<u8> {
        let mut writer = TakeWriter::new(Vec::new(), &Header::default()).unwrap();
        for sequence in 0..samples {
            let device_micros = 10_000 * u64::from(sequence);
            let sample = armature_rig::RawSample { device_micros, sequence, ..Default::default() };
            writer.sample(&sample, None).unwrap();
        }
        writer.finish().unwrap()
    }

    #[test]
    fn what_is_noted_and_binned_comes_back() {
        let folder = folder("bin");
        let walk = folder.join("walk.take");
        std::fs::write(&walk, take(101)).unwrap();
        std::fs::write(opened::list_of(&walk), EditList::new("walk.take").write()).unwrap();
        std::fs::write(folder.join("broken.take"), b"nothing").unwrap();
        annotate(&walk, " good start ", 9).unwrap();
        let library = list(&folder, None).unwrap();
        let found = library.takes.iter().find(|take| take.path == walk).unwrap();
        assert_eq!((found.seconds, found.samples, found.rating), (1.0, 101, MOST_STARS));
        assert_eq!((found.note.as_str(), found.edited, library.takes.len()), ("good start", true, 2));
        assert!(library.takes.iter().any(|take| take.trouble.is_some()), "a broken one is listed with its trouble");
        let before = found.clone();
        let binned = discard(&walk).unwrap();
        // Another take of that name was recorded meanwhile.
        std::fs::write(&walk, take(5)).unwrap();
        let library = list(&folder, None).unwrap();
        assert_eq!((library.bin.len(), library.bin[0].note.as_str()), (1, "good start"));
        let back = restore(&binned).unwrap();
        assert_eq!(back, folder.join("walk-2.take"), "nothing is overwritten");
        assert_eq!(edits::read(&opened::list_of(&back)).unwrap().take, "walk-2.take");
        let library = list(&folder, Some(&walk)).unwrap();
        let found = library.takes.iter().find(|take| take.path == back).unwrap();
        assert_eq!(*found, ListedTake { path: back.clone(), ..before });
        assert!(library.takes.iter().all(|take| take.path != walk), "one that is being written is not listed");
        assert!(restore(&back).is_err(), "it is not in the bin");
        std::fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_damaged_index_is_an_error_with_a_line_and_a_remedy() {
        let folder = folder("index");
        std::fs::write(folder.join(INDEX), "version = 1\n[take.\"a.take\"]\nbytes = \"many\"\n").unwrap();
        let failure = list(&folder, None).unwrap_err();
        assert!(failure.what.contains("line 3") && failure.remedy.contains("delete it"), "{failure}");
        std::fs::write(folder.join(INDEX), "version = 2\n").unwrap();
        assert!(list(&folder, None).unwrap_err().what.contains("version 2"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
