//! Cards over the picture's upper right: problems with their remedy, the last take, long work.

use armature_rig::CalibrationStep;
use eframe::egui::{self, Align, Color32, Layout, RichText, Ui};

use super::widgets::{self, clock, grouped, sentence};
use super::{export, takes};
use crate::app::action::Action;
use crate::app::state::{SavedTake, State, Zeroed};
use crate::app::theme;

/// How long a successful zero stays on screen.
const ZERO_SECONDS: f64 = 4.0;

/// All cards, newest problem first.
pub(super) fn show(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    if let Some((task, fraction)) = &state.busy {
        card(ui, theme::ACCENT, |ui| busy(ui, task, *fraction, actions));
    }
    for (index, notice) in state.notices.iter().enumerate().rev() {
        card(ui, theme::RED, |ui| {
            let times = if notice.count > 1 { format!("  (×{})", notice.count) } else { String::new() };
            title(ui, &format!("{}{times}", sentence(&notice.problem.what)), "Dismiss", || {
                actions.push(Action::DismissNotice(index));
            });
            if !notice.problem.remedy.is_empty() {
                widgets::quiet(ui, sentence(&notice.problem.remedy));
            }
        });
    }
    if let Some(seconds) = state.desk.counting {
        card(ui, theme::RED, |ui| {
            title(ui, &format!("Recording in {seconds} s"), "Cancel", || actions.push(Action::Cancel));
        });
    }
    if let Some(path) = &state.desk.discarded {
        card(ui, theme::AMBER, |ui| takes::discarded(ui, path, actions));
    }
    if let Some(receipt) = &state.desk.exported {
        card(ui, theme::GREEN, |ui| export::receipt(ui, receipt, actions));
    }
    if let Some(take) = &state.saved {
        card(ui, theme::GREEN, |ui| saved(ui, take, actions));
    }
    if let Some(zero) = state.zeroed {
        zeroed(ui, zero, actions);
    }
}

/// Successes fade on their own, failures stay.
fn zeroed(ui: &mut Ui, zero: Zeroed, actions: &mut Vec<Action>) {
    let seen = egui::Id::unique("zero seen at");
    let now = ui.input(|input| input.time);
    let (number, since) = ui.data(|data| data.get_temp(seen)).unwrap_or((0, now));
    let since = if number == zero.number { since } else { now };
    ui.data_mut(|data| data.insert_temp(seen, (zero.number, since)));
    let Zeroed { step, sensors, unreadable, .. } = zero;
    let taken = match step {
        CalibrationStep::Zero => format!("Zero taken for {sensors} sensors"),
        CalibrationStep::Sweep => format!("Range and direction found for {sensors} sensors"),
        CalibrationStep::Mounting => format!("Mounting found for {sensors} parts"),
        CalibrationStep::Heading if sensors > 0 => "The puppet faces forward now".to_owned(),
        CalibrationStep::Heading => "No heading found".to_owned(),
    };
    if unreadable > 0 {
        card(ui, theme::AMBER, |ui| {
            title(ui, &format!("{taken}, but not for {unreadable}"), "Close", || actions.push(Action::DismissZeroed));
            let advice = match step {
                CalibrationStep::Zero => {
                    "Those gave no good reading or moved. Look for grey, amber and violet dots, then press Zero again."
                }
                CalibrationStep::Sweep => "Those hardly moved, or too fast; they keep what they had. Sweep them again.",
                CalibrationStep::Mounting => {
                    "Those were not bent and twisted, or never zeroed; they keep what they had."
                }
                CalibrationStep::Heading => "No part of the puppet moves a bone of this character.",
            };
            widgets::quiet(ui, advice);
        });
    } else if now - since < ZERO_SECONDS {
        card(ui, theme::GREEN, |ui| {
            ui.label(RichText::new(taken).strong());
        });
        ui.ctx().request_repaint_after(std::time::Duration::from_secs_f64(ZERO_SECONDS - (now - since)));
    }
}

fn card(ui: &mut Ui, color: Color32, content: impl FnOnce(&mut Ui)) {
    let response =
        theme::floating().inner_margin(egui::Margin { left: 16, right: 12, top: 10, bottom: 10 }).show(ui, |ui| {
            ui.set_width(ui.available_width());
            ui.spacing_mut().item_spacing.y = 4.0;
            content(ui);
        });
    let rect = response.response.rect;
    let stripe =
        egui::Rect::from_min_max(rect.min + egui::vec2(5.0, 9.0), egui::pos2(rect.min.x + 8.0, rect.max.y - 9.0));
    ui.painter().rect_filled(stripe, 1.5, color);
}

/// A bold line, and a cross that closes the card.
fn title(ui: &mut Ui, text: &str, close_label: &str, close: impl FnOnce()) {
    ui.horizontal_top(|ui| text_and_cross(ui, RichText::new(text).strong(), close_label, close));
}

fn text_and_cross(ui: &mut Ui, text: RichText, close_label: &str, close: impl FnOnce()) {
    let width = ui.available_width() - 26.0;
    ui.vertical(|ui| {
        ui.set_width(width);
        ui.add(egui::Label::new(text).wrap());
    });
    if widgets::close(ui, close_label).clicked() {
        close();
    }
}

fn saved(ui: &mut Ui, take: &SavedTake, actions: &mut Vec<Action>) {
    let heading = format!("Take saved: {}", clock(take.seconds));
    title(ui, &heading, "Close", || actions.push(Action::DismissSaved));
    let lost = if take.lost == 0 { "none lost".into() } else { format!("{} lost", grouped(take.lost)) };
    widgets::quiet(ui, format!("{} samples, {lost}", grouped(take.samples)));
    let path = take.path.display().to_string();
    let name = take.path.file_name().map_or_else(|| path.clone(), |name| name.to_string_lossy().into_owned());
    let folder = take.path.parent().map(|folder| folder.display().to_string()).unwrap_or_default();
    ui.add(egui::Label::new(RichText::new(name).monospace()).truncate()).on_hover_text(path.as_str());
    ui.horizontal(|ui| {
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if ui.small_button("Open the take").on_hover_text("Play it").clicked() {
                actions.push(Action::OpenTake(take.path.clone()));
                actions.push(Action::DismissSaved);
            }
            if ui.small_button("Copy path").on_hover_text("Copy the file's path").clicked() {
                ui.copy_text(path.clone());
            }
            ui.with_layout(Layout::left_to_right(Align::Center), |ui| {
                let text = RichText::new(folder).size(12.0).color(theme::QUIET);
                ui.add(egui::Label::new(text).truncate()).on_hover_text(path.as_str());
            });
        });
    });
}

fn busy(ui: &mut Ui, task: &str, fraction: Option<f32>, actions: &mut Vec<Action>) {
    ui.horizontal_top(|ui| {
        widgets::pulse(ui, theme::ACCENT);
        text_and_cross(ui, RichText::new(task), "Cancel", || actions.push(Action::Cancel));
    });
    if let Some(fraction) = fraction {
        let bar = egui::ProgressBar::new(fraction.clamp(0.0, 1.0)).desired_height(5.0).fill(theme::ACCENT);
        ui.add(bar);
    }
}
