//! How the state is displayed. Views read the state and collect actions; they change nothing except the address field's
//! text.

mod camera_rig;
mod connection;
mod export;
mod files;
mod joints;
mod menus;
mod notices;
mod stage;
mod status;
mod takes;
mod timeline;
mod transport;
mod viewport;
mod widgets;

use eframe::egui::{self, Margin, Stroke, Ui};
use eframe::egui_wgpu::RenderState;

use self::files::{Answer, Files};
use super::action::Action;
use super::state::{Listed, State};
use super::{commands, theme};
use crate::engine::command::CharacterChoice;

const LEFT_WIDTH: f32 = 336.0;

/// What the views remember between frames: camera, scroll position, an open file dialog.
#[derive(Debug, Default)]
pub(super) struct View {
    viewport: viewport::Viewport,
    joints: joints::JointList,
    palette: menus::Palette,
    takes: takes::TakeList,
    timeline: timeline::Timeline,
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
        let mut actions = commands::pressed(ui.ctx(), state);
        if std::mem::take(&mut state.wishes.open_character) {
            self.files.ask(ui.ctx());
        }
        if let Some(folder) = state.wishes.folder.take()
            && let Err(problem) = files::show(&folder)
        {
            actions.push(Action::Report(problem));
        }
        match self.files.answer(ui.ctx()) {
            Some(Answer::File(path)) => actions.push(Action::Load(CharacterChoice::File(path))),
            Some(Answer::NoDialog) => actions.push(Action::Report(files::no_dialog())),
            None => {}
        }
        egui::Panel::top("menus")
            .exact_size(30.0)
            .resizable(false)
            .frame(egui::Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(10, 2)))
            .show(ui, |ui| menus::bar(ui, state, &mut actions));
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
                ui.horizontal(|ui| {
                    for (listed, text) in [(Listed::Joints, "Joints"), (Listed::Takes, "Takes")] {
                        let button = egui::Button::selectable(state.listed == listed, text);
                        if ui.add(button).clicked() {
                            actions.push(Action::List(listed));
                        }
                    }
                });
                if state.listed == Listed::Takes {
                    takes::show(ui, state, &mut self.takes, &mut actions);
                } else {
                    joints::show(ui, state, &mut self.joints, &mut actions);
                }
            });
        if state.desk.open.is_some() {
            egui::Panel::bottom("timeline")
                .default_size(230.0)
                .size_range(120.0..=420.0)
                .resizable(true)
                .frame(egui::Frame::new().fill(theme::PANEL).inner_margin(Margin::symmetric(10, 8)))
                .show(ui, |ui| timeline::show(ui, state, &mut self.timeline, &mut actions));
        }
        egui::CentralPanel::no_frame()
            .frame(egui::Frame::new().fill(egui::Color32::from_rgb(24, 27, 32)).stroke(Stroke::NONE))
            .show(ui, |ui| self.viewport.show(ui, state, graphics, &mut actions));
        export::dialog(ui.ctx(), state, &mut actions);
        menus::overlay(ui.ctx(), state, &mut self.palette, &mut actions);
        actions
    }
}
