//! How the state is displayed. Views read the state and collect actions; they change nothing except the address field's
//! text.

mod camera_rig;
mod connection;
mod files;
mod joints;
mod notices;
mod stage;
mod status;
mod transport;
mod viewport;
mod widgets;

use eframe::egui::{self, Event, Key, Margin, Stroke, Ui};
use eframe::egui_wgpu::RenderState;

use self::files::{Answer, Files};
use super::state::{Action, State};
use super::theme;
use crate::engine::command::CharacterChoice;

const LEFT_WIDTH: f32 = 336.0;

/// What the views remember between frames: camera, scroll position, an open file dialog.
#[derive(Debug, Default)]
pub(super) struct View {
    viewport: viewport::Viewport,
    joints: joints::JointList,
    files: Files,
}

impl View {
    /// Draws the window; returns the requested actions.
    pub(super) fn show(
        &mut self,
        ui: &mut Ui,
        state: &mut State,
        graphics: Option<&RenderState>,
        adapter: &str,
    ) -> Vec<Action> {
        let mut actions = shortcuts(ui);
        match self.files.answer(ui.ctx()) {
            Some(Answer::File(path)) => actions.push(Action::Load(CharacterChoice::File(path))),
            Some(Answer::NoDialog) => actions.push(Action::Report(files::no_dialog())),
            None => {}
        }
        egui::Panel::bottom("status")
            .exact_size(30.0)
            .resizable(false)
            .frame(egui::Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(16, 0)))
            .show(ui, |ui| status::show(ui, state, adapter));
        egui::Panel::left("puppet")
            .exact_size(LEFT_WIDTH)
            .resizable(false)
            .frame(egui::Frame::new().fill(theme::PANEL).inner_margin(Margin::same(16)))
            .show(ui, |ui| {
                ui.spacing_mut().item_spacing.y = 10.0;
                connection::header(ui, state);
                connection::card(ui, state, &mut actions);
                ui.add_space(2.0);
                joints::show(ui, state, &mut self.joints, &mut actions);
            });
        egui::CentralPanel::no_frame()
            .frame(egui::Frame::new().fill(egui::Color32::from_rgb(24, 27, 32)).stroke(Stroke::NONE))
            .show(ui, |ui| self.viewport.show(ui, state, graphics, &mut self.files, &mut actions));
        actions
    }
}

fn shortcuts(ui: &Ui) -> Vec<Action> {
    let keys = [
        (Key::Space, Action::ConnectToField),
        (Key::Z, Action::Zero),
        (Key::R, Action::ToggleRecording),
        (Key::B, Action::ToggleBones),
        (Key::Escape, Action::Select(None)),
    ];
    keys.into_iter().filter(|(key, _)| pressed(ui, *key)).map(|(_, action)| action).collect()
}

/// Whether a shortcut was pressed: once, without modifiers, and not intended for something else. A text field takes
/// every key; any other focused widget only the keys that click it.
fn pressed(ui: &Ui, key: Key) -> bool {
    let focused = ui.ctx().memory(|memory| memory.focused().is_some());
    let taken = ui.ctx().text_edit_focused() || focused && matches!(key, Key::Space | Key::Enter);
    let is_press = |event: &Event| {
        matches!(event, Event::Key { key: k, pressed: true, repeat: false, modifiers, .. }
            if *k == key && modifiers.is_none())
    };
    !taken && ui.input(|input| input.events.iter().any(is_press))
}
