//! The line at the bottom: how well the stream is doing, and what draws the picture.

use eframe::egui::{Align, Color32, Layout, RichText, Ui};

use super::widgets::grouped;
use crate::app::state::{Connection, State};
use crate::app::theme;

pub(super) fn show(ui: &mut Ui, state: &State, adapter: &str) {
    ui.horizontal_centered(|ui| {
        ui.spacing_mut().item_spacing.x = 6.0;
        match (&state.connection, &state.frame) {
            _ if state.explanation.is_some() => {
                let why = state.explanation.unwrap_or_default();
                ui.label(RichText::new(why).size(12.0).color(theme::AMBER));
            }
            (Connection::On { .. }, Some(frame)) if state.is_live() => {
                let stats = &frame.stats;
                let alarm = |count: u64| if count == 0 { theme::TEXT } else { theme::AMBER };
                item(ui, "Rate", &format!("{:.0} Hz", stats.samples_per_second), theme::TEXT, "Samples a second");
                let lost = grouped(stats.lost_samples);
                item(ui, "Lost", &lost, alarm(stats.lost_samples), "Samples that never arrived since connecting");
                let errors = grouped(stats.crc_errors);
                item(
                    ui,
                    "Checksum errors",
                    &errors,
                    alarm(stats.crc_errors),
                    "Frames dropped because they arrived damaged",
                );
                let resyncs = grouped(stats.resyncs);
                let hint = "Bytes that formed no frame; reading continued with the next one";
                item(ui, "Resyncs", &resyncs, alarm(stats.resyncs), hint);
                let millis = |micros: f32| format!("{:.2}", micros / 1000.0);
                let latency = format!("{} / {} ms", millis(stats.latency_p50_micros), millis(stats.latency_p99_micros));
                item(
                    ui,
                    "Latency",
                    &latency,
                    theme::TEXT,
                    "From the last byte of a sample to the skinned character: median / 99th percentile",
                );
            }
            _ => {
                let how = format!("{}. F1 shows all keys", state.controls.navigation());
                ui.label(RichText::new(how).size(12.0).color(theme::QUIET));
            }
        }
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            ui.label(RichText::new(adapter).size(12.0).color(theme::QUIET)).on_hover_text("What draws the picture");
        });
    });
}

fn item(ui: &mut Ui, name: &str, value: &str, color: Color32, hint: &str) {
    ui.label(RichText::new(name).size(12.0).color(theme::QUIET)).on_hover_text(hint);
    ui.label(RichText::new(value).size(12.0).color(color)).on_hover_text(hint);
    ui.add_space(14.0);
}
