//! The bar at the bottom of the picture: zero, record, frame, bones.

use armature_rig::CalibrationStep;
use eframe::egui::{self, Align, Layout, Rect, Ui, UiBuilder, Vec2, vec2};

use super::{menus, widgets};
use crate::app::action::Action;
use crate::app::commands;
use crate::app::state::State;
use crate::app::theme;

const HEIGHT: f32 = 36.0;
const ZERO: f32 = 84.0;
const RECORD: f32 = 158.0;
const GAP: f32 = 8.0;

/// Draws the bar.
pub(super) fn show(ui: &mut Ui, rect: Rect, state: &State, actions: &mut Vec<Action>) {
    let size = vec2(ZERO * 3.0 + RECORD + GAP * 3.0 + 16.0, HEIGHT + 16.0);
    let place = Rect::from_center_size(egui::pos2(rect.center().x, rect.bottom() - 18.0 - size.y * 0.5), size);
    let plain = Vec2::new(ZERO, HEIGHT);
    ui.scope_builder(UiBuilder::new().max_rect(place).layout(Layout::left_to_right(Align::Center)), |ui| {
        theme::floating().inner_margin(egui::Margin::same(8)).show(ui, |ui| {
            ui.spacing_mut().item_spacing.x = GAP;
            if let Some(zero) = menus::button(ui, &Action::Zero, plain, state, actions) {
                zero.context_menu(|ui| calibration(ui, state, actions));
            }
            record(ui, state, actions);
            for action in [Action::FrameAll, Action::ToggleBones] {
                menus::button(ui, &action, plain, state, actions);
            }
        });
    });
}

/// The steps of a calibration, behind a right click on the button.
fn calibration(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    for step in CalibrationStep::ALL {
        if menus::button(ui, &Action::Calibrate(step), Vec2::new(160.0, 24.0), state, actions)
            .is_some_and(|button| button.clicked())
        {
            ui.close();
        }
    }
}

fn record(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    let recording = state.recording.map(|(seconds, _)| seconds);
    let action = if recording.is_some() { Action::StopRecording } else { Action::Record };
    let Some(entry) = commands::of(&action) else { return };
    let possible = entry.possible(state);
    let button = widgets::record(ui, recording, possible.is_ok(), Vec2::new(RECORD, HEIGHT));
    let hint = match possible {
        Ok(()) => entry.hint(ui.ctx(), state.controls),
        Err(why) => format!("{}. {why}", entry.tip),
    };
    if button.on_hover_text(hint).clicked() {
        actions.push(action);
    }
}
