//! The window: a pure state ([`state`]), what is asked of it ([`action`], all of it in one table), and a view of it. Its interface to the engine is in [`crate::engine`].

pub mod action;
mod commands;
pub mod controls;
pub mod desk;
mod paint;
pub mod state;
mod theme;
mod view;
mod window;

use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;

use eframe::egui;

pub use self::window::{Start, Window};
use crate::engine::link::{EngineLink, link};

/// Why there is no window.
#[derive(Debug, thiserror::Error)]
pub enum WindowError {
    /// There is no display to show a window on.
    #[error(
        "the window could not be opened: no display found (is DISPLAY or WAYLAND_DISPLAY set?). Without one, use `armature run` or `armature demo`"
    )]
    NoDisplay,
    /// There is no adapter to draw with.
    #[error(
        "the window could not be opened: no graphics adapter can draw in it ({detail}). On Debian or Ubuntu, install a software one: apt install mesa-vulkan-drivers libvulkan1"
    )]
    NoAdapter {
        /// What wgpu says.
        detail: String,
    },
    /// The window system refused for another reason.
    #[error("the window could not be opened: {detail}. Without it, use `armature run` or `armature demo`")]
    Refused {
        /// What eframe says.
        detail: String,
    },
    /// The engine's thread panicked.
    #[error("the engine stopped unexpectedly; please report this with the lines printed above")]
    EngineStopped,
}

/// Opens the window and returns when it is closed and the engine has ended.
///
/// `spawn_engine` starts the engine's thread, which must end at
/// [`Command::Quit`](crate::engine::command::Command::Quit).
pub fn run(start: Start, spawn_engine: impl FnOnce(EngineLink) -> JoinHandle<()> + 'static) -> Result<(), WindowError> {
    let thread: Arc<Mutex<Option<JoinHandle<()>>>> = Arc::default();
    let slot = thread.clone();
    let viewport = egui::ViewportBuilder::default()
        .with_title("Armature")
        .with_app_id("armature")
        .with_inner_size([1280.0, 800.0])
        .with_min_inner_size([900.0, 600.0])
        .with_drag_and_drop(true);
    let options = eframe::NativeOptions { viewport, ..eframe::NativeOptions::default() };
    let opened = eframe::run_native(
        "Armature",
        options,
        Box::new(move |context| {
            let ctx = context.egui_ctx.clone();
            let (app, engine) = link(move || ctx.request_repaint());
            *slot.lock().unwrap_or_else(PoisonError::into_inner) = Some(spawn_engine(engine));
            Ok(Box::new(Window::new(context, app, start)))
        }),
    );
    // The window is gone, and with it its end of the link, so the engine quits.
    let engine = thread.lock().unwrap_or_else(PoisonError::into_inner).take();
    let joined = engine.map(JoinHandle::join);
    opened.map_err(|error| match error {
        // winit's messages mention its own source files.
        eframe::Error::Winit(_) | eframe::Error::WinitEventLoop(_) => WindowError::NoDisplay,
        eframe::Error::Wgpu(error) => WindowError::NoAdapter { detail: error.to_string() },
        eframe::Error::AppCreation(error) => WindowError::Refused { detail: error.to_string() },
    })?;
    match joined {
        Some(Err(_)) => Err(WindowError::EngineStopped),
        Some(Ok(())) | None => Ok(()),
    }
}
