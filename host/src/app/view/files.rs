//! Choosing a character's file, without holding up the window.

use std::path::PathBuf;
use std::sync::mpsc::{self, Receiver};

use eframe::egui;

const EXTENSIONS: [&str; 6] = ["glb", "gltf", "obj", "ply", "stl", "off"];

/// A file dialog that may be open, and files dropped onto the window.
#[derive(Debug, Default)]
pub(super) struct Files {
    answer: Option<Receiver<Option<PathBuf>>>,
}

impl Files {
    /// Opens the system's dialog; a second one is not opened.
    pub(super) fn ask(&mut self, ctx: &egui::Context) {
        if self.answer.is_some() {
            return;
        }
        let (sender, receiver) = mpsc::channel();
        self.answer = Some(receiver);
        let ctx = ctx.clone();
        std::thread::spawn(move || {
            let dialog =
                rfd::FileDialog::new().set_title("Open a character").add_filter("Meshes and characters", &EXTENSIONS);
            // The window may have been closed meanwhile.
            let _ = sender.send(dialog.pick_file());
            ctx.request_repaint();
        });
    }

    /// The file chosen or dropped since the last call.
    pub(super) fn chosen(&mut self, ctx: &egui::Context) -> Option<PathBuf> {
        let dropped = ctx.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if dropped.is_some() {
            return dropped;
        }
        match self.answer.as_ref()?.try_recv() {
            Ok(chosen) => {
                self.answer = None;
                chosen
            }
            Err(mpsc::TryRecvError::Empty) => None,
            Err(mpsc::TryRecvError::Disconnected) => {
                self.answer = None;
                None
            }
        }
    }
}
