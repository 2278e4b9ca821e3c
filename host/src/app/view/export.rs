//! The export dialog, and the card that says what was written.

use eframe::egui::{self, Align2, Button, Context, RichText, Ui, Vec2};

use super::widgets;
use crate::app::action::Action;
use crate::app::desk::{FORMATS, PRESETS};
use crate::app::state::State;
use crate::app::theme;
use crate::takes::orders::ExportReceipt;

/// The dialog, while it is open.
pub(super) fn dialog(ctx: &Context, state: &mut State, actions: &mut Vec<Action>) {
    let (can_range, range) = (state.desk.playback.range.is_some(), state.desk.playback.range);
    let Some(form) = &mut state.desk.export else { return };
    let mut close = false;
    egui::Window::new("Export the take")
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .frame(theme::floating().inner_margin(egui::Margin::same(16)).fill(theme::CARD))
        .show(ctx, |ui| {
            ui.set_width(440.0);
            widgets::caption(ui, "FOR");
            ui.horizontal(|ui| {
                for (index, preset) in PRESETS.iter().enumerate() {
                    let button =
                        Button::new(preset.name).selected(form.preset == index).min_size(Vec2::new(76.0, 30.0));
                    if ui.add(button).on_hover_text(format!("In the program: {}", preset.how)).clicked() {
                        form.choose(index);
                    }
                }
            });
            widgets::quiet(ui, format!("In the program: {}.", PRESETS[form.preset.min(PRESETS.len() - 1)].how));
            egui::Grid::new("export").num_columns(2).spacing([14.0, 8.0]).show(ui, |ui| {
                ui.label("Format");
                ui.horizontal_wrapped(|ui| {
                    for (target, extension, label) in FORMATS {
                        if ui.selectable_label(form.target == target, label).clicked() {
                            form.target = target;
                            form.to = std::path::Path::new(&form.to).with_extension(extension).display().to_string();
                        }
                    }
                });
                ui.end_row();
                ui.label("Frames a second");
                ui.add(egui::TextEdit::singleline(&mut form.rate).desired_width(80.0))
                    .on_hover_text("24, 25, 29.97, 30, 60, or a fraction such as 24000/1001");
                ui.end_row();
                ui.label("Range");
                ui.add_enabled(
                    can_range,
                    egui::Checkbox::new(&mut form.only_range, "Only from the in to the out point"),
                )
                .on_disabled_hover_text("Set an in and an out point on the timeline first (I and O)");
                ui.end_row();
                ui.label("File");
                ui.add(egui::TextEdit::singleline(&mut form.to).desired_width(f32::INFINITY));
                ui.end_row();
                ui.label("");
                ui.checkbox(&mut form.replace, "Replace a file that is there");
                ui.end_row();
            });
            let order = form.order(range);
            if let Err(why) = &order {
                ui.label(RichText::new(widgets::sentence(why)).color(theme::AMBER));
            }
            ui.horizontal(|ui| {
                let export = widgets::primary("Export").min_size(Vec2::new(110.0, 32.0));
                if ui.add_enabled(order.is_ok(), export).clicked()
                    && let Ok(order) = order
                {
                    actions.push(Action::Export(order));
                }
                close = ui.add(Button::new("Cancel").min_size(Vec2::new(90.0, 32.0))).clicked();
            });
        });
    if close {
        state.desk.export = None;
    }
}

/// What was written.
pub(super) fn receipt(ui: &mut Ui, receipt: &ExportReceipt, actions: &mut Vec<Action>) {
    let name = receipt.path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    ui.horizontal(|ui| {
        ui.label(RichText::new(format!("Exported: {name}")).strong()).on_hover_text(receipt.path.display().to_string());
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            if widgets::close(ui, "Close").clicked() {
                actions.push(Action::DismissExported);
            }
        });
    });
    widgets::quiet(ui, widgets::sentence(&receipt.contents));
    widgets::quiet(ui, widgets::sentence(&receipt.measured));
    for note in &receipt.notes {
        ui.label(RichText::new(widgets::sentence(note)).color(theme::AMBER));
    }
    if ui.small_button("Show in folder").clicked()
        && let Some(folder) = receipt.path.parent()
    {
        actions.push(Action::ShowFolder(folder.to_owned()));
    }
}
