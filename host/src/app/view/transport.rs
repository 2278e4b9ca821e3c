//! The bar at the bottom of the picture: zero, record, frame, bones.

use armature_rig::CalibrationStep;
use eframe::egui::{self, Align, Layout, Rect, Ui, UiBuilder, Vec2, vec2};

use super::widgets;
use crate::app::state::{Action, State};
use crate::app::theme;

const HEIGHT: f32 = 36.0;
const ZERO: f32 = 84.0;
const RECORD: f32 = 158.0;
const GAP: f32 = 8.0;

/// Returns whether the camera should frame the whole character.
pub(super) fn show(ui: &mut Ui, rect: Rect, state: &State, actions: &mut Vec<Action>) -> bool {
    let size = vec2(ZERO * 3.0 + RECORD + GAP * 3.0 + 16.0, HEIGHT + 16.0);
    let place = Rect::from_center_size(egui::pos2(rect.center().x, rect.bottom() - 18.0 - size.y * 0.5), size);
    let live = state.is_live();
    let mut frame = false;
    ui.scope_builder(UiBuilder::new().max_rect(place).layout(Layout::left_to_right(Align::Center)), |ui| {
        theme::floating().inner_margin(egui::Margin::same(8)).show(ui, |ui| {
            ui.spacing_mut().item_spacing.x = GAP;
            let plain = |text: &'static str| egui::Button::new(text).min_size(Vec2::new(ZERO, HEIGHT));
            let zero = ui.add_enabled(state.can_calibrate(), plain("Zero"));
            zero.context_menu(|ui| {
                for step in CalibrationStep::ALL {
                    if ui.button(format!("Calibrate: {step}")).clicked() {
                        actions.push(Action::Calibrate(step));
                        ui.close();
                    }
                }
            });
            let hint = "The puppet is in the character's rest pose now: make this zero (Z). \
                        A right click offers the steps of a calibration, with a countdown";
            let disabled = if live { "Stop recording first" } else { "Connect a puppet first" };
            if zero.on_hover_text(hint).on_disabled_hover_text(disabled).clicked() {
                actions.push(Action::Zero);
            }
            let recording = state.recording.map(|(seconds, _)| seconds);
            let record = widgets::record(ui, recording, live || recording.is_some(), Vec2::new(RECORD, HEIGHT));
            let hint = if recording.is_some() { "Finish the take and save it (R)" } else { "Record a take (R)" };
            if record.on_hover_text(hint).clicked() {
                actions.push(Action::ToggleRecording);
            }
            frame = ui.add(plain("Frame")).on_hover_text("Show the whole character (F)").clicked();
            let bones = plain("Bones").selected(state.show_bones);
            if ui.add(bones).on_hover_text("Show or hide the bones (B)").clicked() {
                actions.push(Action::ToggleBones);
            }
        });
    });
    frame
}
