//! What the window has done with takes on disk, one order at a time.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use armature_take::{EditList, FrameRate};

use super::edits;
use super::exports::{self, Options, Target};
use super::library::{self, Library};
use super::opened::{self, OpenedTake};
use crate::characters::ground::GroundArgs;
use crate::failure::Failure;
use crate::files::{self, Overwrite};
use crate::{characters, settings, takes};

/// Something to do with takes.
#[derive(Clone, Debug, PartialEq)]
pub enum TakeOrder {
    /// List the user's folder.
    List {
        /// A take that is being written.
        except: Option<PathBuf>,
    },
    /// Open a take.
    Open(PathBuf),
    /// Open a take with these edits, and keep them beside it.
    Edit {
        /// The take.
        take: PathBuf,
        /// Its edits.
        list: EditList,
    },
    /// Keep a note and a rating.
    Annotate {
        /// The take.
        take: PathBuf,
        /// The note.
        note: String,
        /// 0 for none.
        rating: u8,
    },
    /// Put a take into the bin.
    Discard(PathBuf),
    /// Take one out of it.
    Restore(PathBuf),
    /// Write a take for another program.
    Export(ExportOrder),
}

/// What came of it.
#[derive(Clone, Debug)]
pub enum TakeResult {
    /// The folder.
    Listed(Library),
    /// A take.
    Opened(Arc<OpenedTake>),
    /// The folder has changed.
    Changed,
    /// A take is in the bin.
    Discarded(PathBuf),
    /// A file was written.
    Exported(ExportReceipt),
}

/// A take for another program.
#[derive(Clone, Debug, PartialEq)]
pub struct ExportOrder {
    /// The take; the edits beside it count.
    pub take: PathBuf,
    /// The format.
    pub target: Target,
    /// The rate.
    pub rate: FrameRate,
    /// First and last moment of the edited take, seconds; `None` for all of it.
    pub range: Option<(f64, f64)>,
    /// The new file.
    pub to: PathBuf,
    /// Whether it may replace one.
    pub overwrite: Overwrite,
}

/// What was written, for people.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ExportReceipt {
    /// The file.
    pub path: PathBuf,
    /// What is in it, on one line.
    pub contents: String,
    /// What the measurement is worth, on one line.
    pub measured: String,
    /// What was not measured, in sentences.
    pub notes: Vec<String>,
}

/// Does what is ordered.
pub fn carry_out(
    order: &TakeOrder,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<TakeResult, Failure> {
    match order {
        TakeOrder::List { except } => {
            library::list(&settings::takes_folder()?, except.as_deref()).map(TakeResult::Listed)
        }
        TakeOrder::Open(path) => opened::open(path, None, progress).map(Arc::new).map(TakeResult::Opened),
        TakeOrder::Edit { take, list } => {
            let opened = opened::open(take, Some(list.clone()), progress)?;
            keep_list(take, list)?;
            Ok(TakeResult::Opened(Arc::new(opened)))
        }
        TakeOrder::Annotate { take, note, rating } => {
            library::annotate(take, note, *rating).map(|()| TakeResult::Changed)
        }
        TakeOrder::Discard(path) => library::discard(path).map(TakeResult::Discarded),
        TakeOrder::Restore(path) => library::restore(path).map(|_| TakeResult::Changed),
        TakeOrder::Export(order) => export(order, progress).map(TakeResult::Exported),
    }
}

/// Keeps a list beside its take; an empty one is no file.
fn keep_list(take: &Path, list: &EditList) -> Result<(), Failure> {
    let path = opened::list_of(take);
    if !list.edits.is_empty() {
        return files::replace(&path, list.write().as_bytes());
    }
    match std::fs::remove_file(&path) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
            Err(Failure::input(format!("{}: {e}", path.display()), "make its folder writable"))
        }
        _ => Ok(()),
    }
}

fn export(
    order: &ExportOrder,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<ExportReceipt, Failure> {
    if let Some(folder) = order.to.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder)
            .map_err(|e| Failure::input(format!("{}: {e}", folder.display()), "choose another folder"))?;
    }
    order.overwrite.check(&order.to)?;
    let mut options = Options::at(order.rate);
    options.settings.resample.range_seconds = order.range;
    let list = opened::list_of(&order.take);
    let (take, edited) = if list.exists() {
        let applied = edits::apply(&list, &edits::read(&list)?, None, &GroundArgs::default(), progress)?;
        (applied.take, Some(applied.edited))
    } else {
        (takes::read(&order.take)?.0, None)
    };
    let character = if order.target.holds_mesh() {
        Some(characters::find_for_take(&order.take, &take.header().character_name, progress)?.character)
    } else {
        None
    };
    let exported = exports::export(&take, edited.as_ref(), character.as_ref(), order.target, &options, progress)?;
    order.overwrite.write(&order.to, &exported.bytes)?;
    Ok(ExportReceipt {
        path: order.to.clone(),
        contents: exported.to_string(),
        measured: armature_take::receipt(&take).to_string(),
        notes: exported.notes,
    })
}
