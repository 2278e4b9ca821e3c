//! The lower left: every joint with its live angles and states, and the selected one in detail.

use armature_rig::{JointTree, PartKind, SensorState};
use eframe::egui::{
    self, Align, Align2, FontId, Layout, Rect, RichText, Role, ScrollArea, Sense, Ui, Vec2, WidgetInfo, pos2,
};

use super::widgets;
use crate::app::action::Action;
use crate::app::state::{Connection, PartRow, State, axis_label, kind_label, state_label};
use crate::app::theme;
use crate::terminal::counted;

const ROW: f32 = 26.0;
const READING: f32 = 42.0;

/// What the list remembers between frames.
#[derive(Debug, Default)]
pub(super) struct JointList {
    /// The selection last scrolled to.
    scrolled_to: Option<usize>,
}

/// The list, and the details below it.
pub(super) fn show(ui: &mut Ui, state: &State, list: &mut JointList, actions: &mut Vec<Action>) {
    let Some(tree) = &state.tree else {
        empty(ui, state);
        return;
    };
    ui.horizontal(|ui| {
        let joints = tree.parts().iter().filter(|part| !part.kind.axes().is_empty()).count();
        widgets::caption(ui, "JOINTS");
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let sensors = counted(tree.sensor_count(), "sensor", "sensors");
            let text = format!("{}, {sensors}", counted(joints, "joint", "joints"));
            let told = ui.label(RichText::new(text).size(11.5).color(theme::QUIET));
            let solved = state.solved.iter().filter(|solved| **solved).count();
            if solved > 0 {
                let bones = counted(solved, "bone without a joint is", "bones without a joint are");
                told.on_hover_text(format!("{bones} found from the shape (blue in the picture)"));
            }
        });
    });
    if let Some(part) = state.selected.filter(|&part| part < tree.parts().len()) {
        egui::Panel::bottom("details")
            .resizable(false)
            .show_separator_line(false)
            .frame(egui::Frame::new().inner_margin(egui::Margin { top: 8, ..egui::Margin::ZERO }))
            .show(ui, |ui| details(ui, state, tree, part, actions));
    } else {
        egui::Panel::bottom("legend")
            .resizable(false)
            .show_separator_line(false)
            .frame(egui::Frame::new().inner_margin(egui::Margin { top: 6, ..egui::Margin::ZERO }))
            .show(ui, legend);
    }
    let follow = state.selected != list.scrolled_to;
    list.scrolled_to = state.selected;
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        for &row in &state.rows {
            let response = line(ui, state, tree, row);
            if response.clicked() {
                actions.push(Action::Select((state.selected != Some(row.part)).then_some(row.part)));
            }
            if follow && state.selected == Some(row.part) {
                response.scroll_to_me(None);
            }
        }
    });
}

fn empty(ui: &mut Ui, state: &State) {
    ui.add_space(18.0);
    ui.vertical_centered(|ui| {
        ui.set_max_width(250.0);
        let (title, text) = match &state.connection {
            Connection::Off => (
                "No puppet connected",
                "Start a simulated one above, or plug a puppet in and choose its port. Its joints appear here, each with its live angle.",
            ),
            Connection::Connecting { .. } => ("Saying hello", "Waiting for the puppet to describe itself."),
            Connection::On { .. } => ("Reading the puppet", "Waiting for it to report which joints are plugged together."),
        };
        ui.label(RichText::new(title).size(15.0).strong());
        widgets::quiet(ui, text);
    });
}

fn line(ui: &mut Ui, state: &State, tree: &JointTree, row: PartRow) -> egui::Response {
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), ROW), Sense::click());
    let label = state.part_label(row.part);
    let selected = state.selected == Some(row.part);
    response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, selected, label.clone()));
    if !ui.is_rect_visible(rect) {
        return response;
    }
    if selected {
        ui.painter().rect_filled(rect, 6.0, theme::ACCENT.gamma_multiply(0.22));
        let mark = Rect::from_min_size(rect.min + Vec2::new(0.0, 5.0), Vec2::new(3.0, ROW - 10.0));
        ui.painter().rect_filled(mark, 1.5, theme::ACCENT);
    } else if response.hovered() {
        ui.painter().rect_filled(rect, 6.0, theme::CARD);
    }
    let kind = tree.parts()[row.part].kind;
    let is_splitter = matches!(kind, PartKind::Splitter { .. });
    let mut x = rect.left() + 12.0 + row.depth.min(6) as f32 * 14.0;
    let middle = rect.center().y;
    if is_splitter {
        ui.painter().circle_stroke(pos2(x, middle), 3.2, egui::Stroke::new(1.3, theme::GREY));
    } else {
        ui.painter().circle_filled(pos2(x, middle), 3.6, theme::state_color(state.worst_state(row.part)));
    }
    x += 12.0;
    let sensors = tree.sensors(row.part);
    let readings_left = rect.right() - 8.0 - READING * sensors.len() as f32;
    let named = state.bone_name(row.part).is_some();
    let color = if named || selected { theme::TEXT } else { theme::QUIET };
    widgets::line(ui, pos2(x, middle), readings_left - x, &label, color);
    for (column, sensor) in sensors.enumerate() {
        let right = readings_left + READING * (column as f32 + 1.0);
        let (sensor_state, angle) = state.reading(sensor);
        let color = if sensor_state == SensorState::Ok { theme::TEXT } else { theme::state_color(sensor_state) };
        let font = FontId::monospace(12.0);
        ui.painter().text(pos2(right, middle), Align2::RIGHT_CENTER, whole_degrees(angle), font, color);
    }
    response.on_hover_ui(|ui| tooltip(ui, state, tree, row.part))
}

fn tooltip(ui: &mut Ui, state: &State, tree: &JointTree, part: usize) {
    let kind = tree.parts()[part].kind;
    ui.label(RichText::new(kind_label(kind)).strong());
    match state.bone_name(part) {
        Some(bone) => widgets::quiet(ui, format!("Moves the bone {bone}")),
        None if kind.axes().is_empty() => widgets::quiet(ui, "Branches the puppet; measures nothing"),
        None => widgets::quiet(ui, "Moves no bone of this character"),
    };
    for (axis, sensor) in kind.axes().iter().zip(tree.sensors(part)) {
        let (sensor_state, angle) = state.reading(sensor);
        widgets::quiet(ui, format!("{} {}: {}", axis_label(*axis), degrees(angle), state_label(sensor_state)));
    }
}

fn details(ui: &mut Ui, state: &State, tree: &JointTree, part: usize, actions: &mut Vec<Action>) {
    let plugged = &tree.parts()[part];
    theme::card().show(ui, |ui| {
        ui.set_width(ui.available_width());
        ui.horizontal(|ui| {
            ui.label(RichText::new(state.part_label(part)).size(15.0).strong());
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                if widgets::close(ui, "Deselect").clicked() {
                    actions.push(Action::Select(None));
                }
                let blink = ui.add_enabled(state.is_live(), egui::Button::new("Blink"));
                if blink.on_hover_text("Make this part's light blink, to find it on the puppet").clicked() {
                    actions.push(Action::Blink(plugged.uid));
                }
            });
        });
        let bone = match state.bone_name(part) {
            Some(bone) => format!("{}, moves the bone {bone}", kind_label(plugged.kind)),
            None => kind_label(plugged.kind),
        };
        widgets::quiet(ui, bone);
        for (axis, sensor) in plugged.kind.axes().iter().zip(tree.sensors(part)) {
            let (sensor_state, angle) = state.reading(sensor);
            ui.horizontal(|ui| {
                widgets::dot(ui, theme::state_color(sensor_state)).on_hover_text(state_label(sensor_state));
                ui.add_sized([40.0, 18.0], egui::Label::new(RichText::new(axis_label(*axis)).size(12.5)));
                widgets::angle_bar(ui, angle, theme::state_color(sensor_state), ui.available_width() - 70.0);
                ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                    ui.label(RichText::new(degrees(angle)).monospace());
                });
            });
        }
        let uid = RichText::new(format!("No. {}", plugged.uid)).size(11.0).color(theme::GREY).monospace();
        ui.add(egui::Label::new(uid).truncate());
    });
}

fn legend(ui: &mut Ui) {
    ui.horizontal(|ui| {
        ui.spacing_mut().item_spacing.x = 5.0;
        for state in [SensorState::Ok, SensorState::MagnetWeak, SensorState::Outlier, SensorState::NoData] {
            widgets::dot(ui, theme::state_color(state));
            ui.label(RichText::new(state_label(state)).size(11.0).color(theme::QUIET));
            ui.add_space(5.0);
        }
    });
}

/// "-12°", or a dash without data: calm enough to read while it moves.
fn whole_degrees(angle: Option<f32>) -> String {
    angle.map_or_else(|| "—".into(), |angle| format!("{:.0}°", angle.to_degrees().round() + 0.0))
}

/// "-12.3°", or a dash without data.
fn degrees(angle: Option<f32>) -> String {
    angle.map_or_else(|| "—".into(), |angle| format!("{:.1}°", angle.to_degrees() + 0.0))
}
