//! Choosing a character file without blocking the window.

use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver};
use std::time::{Duration, Instant};

use eframe::egui;

use crate::characters::OPENABLE;
use crate::engine::event::Problem;

/// A dialog that closes sooner than this never appeared: nobody cancels that fast.
const FASTEST_PERSON: Duration = Duration::from_millis(250);

/// The result of asking for a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// This one.
    File(PathBuf),
    /// The system has no file dialog.
    NoDialog,
}

/// A file dialog that may be open, and files dropped onto the window.
#[derive(Debug, Default)]
pub(super) struct Files {
    pending: Option<Receiver<Option<Answer>>>,
}

impl Files {
    /// Opens the system's dialog, unless one is open already.
    pub(super) fn ask(&mut self, ctx: &egui::Context) {
        if self.pending.is_some() {
            return;
        }
        let (sender, receiver) = mpsc::channel();
        self.pending = Some(receiver);
        let ctx = ctx.clone();
        std::thread::spawn(move || {
            let asked = Instant::now();
            let dialog = rfd::FileDialog::new().set_title("Open a character").add_filter("Characters", &OPENABLE);
            let answer = match dialog.pick_file() {
                Some(path) => Some(Answer::File(path)),
                None => (asked.elapsed() < FASTEST_PERSON).then_some(Answer::NoDialog),
            };
            // The window may have been closed meanwhile.
            let _ = sender.send(answer);
            ctx.request_repaint();
        });
    }

    /// What was chosen or dropped since the last call.
    pub(super) fn answer(&mut self, ctx: &egui::Context) -> Option<Answer> {
        let dropped = ctx.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if let Some(path) = dropped {
            return Some(Answer::File(path));
        }
        let answer = match self.pending.as_ref()?.try_recv() {
            Err(mpsc::TryRecvError::Empty) => return None,
            Ok(answer) => answer,
            Err(mpsc::TryRecvError::Disconnected) => None,
        };
        self.pending = None;
        answer
    }
}

/// Shows a folder in the system's file manager.
pub(super) fn show(folder: &Path) -> Result<(), Problem> {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(target_os = "windows") {
        "explorer"
    } else {
        "xdg-open"
    };
    let started = std::process::Command::new(program).arg(folder).spawn();
    started.map(drop).map_err(|error| Problem {
        what: format!("The folder cannot be shown: {program}: {error}."),
        remedy: format!("It is {}.", folder.display()),
    })
}

/// The card about a missing dialog.
pub(super) fn no_dialog() -> Problem {
    Problem {
        what: "This system has no file dialog.".into(),
        remedy: "Drop the file onto the window, start with `armature window --character FILE`, or install \
                 xdg-desktop-portal or zenity."
            .into(),
    }
}
