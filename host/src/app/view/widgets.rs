//! The few building blocks that the views share.

use eframe::egui::{
    self, Align2, Button, Color32, FontId, Response, RichText, Role, Sense, Stroke, Ui, Vec2, WidgetInfo, pos2,
};

use crate::app::theme;

/// A small heading over a group.
pub(super) fn caption(ui: &mut Ui, text: &str) {
    ui.label(RichText::new(text).size(11.5).color(theme::QUIET).strong());
}

/// Text that explains.
pub(super) fn quiet(ui: &mut Ui, text: impl Into<String>) -> Response {
    ui.add(egui::Label::new(RichText::new(text).color(theme::QUIET)).wrap())
}

/// The primary button.
pub(super) fn primary(text: &str) -> Button<'static> {
    let label = RichText::new(text).color(Color32::WHITE).strong();
    Button::new(label).fill(Color32::from_rgb(38, 110, 205)).stroke(Stroke::new(1.0, Color32::from_rgb(66, 138, 235)))
}

/// A coloured dot in a line of text.
pub(super) fn dot(ui: &mut Ui, color: Color32) -> Response {
    let (rect, response) = ui.allocate_exact_size(Vec2::splat(9.0), Sense::hover());
    ui.painter().circle_filled(rect.center(), 3.6, color);
    response
}

/// A dot that blinks while work goes on. It is drawn a few times a second: on a software adapter, a spinner that is drawn
/// as often as possible takes half of a core from the work.
pub(super) fn pulse(ui: &mut Ui, color: Color32) {
    let is_bright = ui.input(|input| input.time).rem_euclid(1.0) < 0.5;
    ui.ctx().request_repaint_after(std::time::Duration::from_millis(250));
    dot(ui, if is_bright { color } else { color.gamma_multiply(0.4) });
}

/// A small cross that closes a card.
pub(super) fn close(ui: &mut Ui, label: &str) -> Response {
    let (rect, response) = ui.allocate_exact_size(Vec2::splat(18.0), Sense::click());
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, label));
    let color = if response.hovered() { theme::TEXT } else { theme::QUIET };
    let cross = rect.shrink(5.5);
    let stroke = Stroke::new(1.5, color);
    ui.painter().line_segment([cross.left_top(), cross.right_bottom()], stroke);
    ui.painter().line_segment([cross.right_top(), cross.left_bottom()], stroke);
    response.on_hover_text(label)
}

/// A button that fills its place.
pub(super) fn wide(ui: &mut Ui, button: Button<'_>, height: f32) -> Response {
    ui.add_sized(Vec2::new(ui.available_width(), height), button)
}

/// A pill with a dot: "● Live".
pub(super) fn pill(ui: &mut Ui, text: &str, color: Color32) {
    let galley = ui.painter().layout_no_wrap(text.into(), FontId::proportional(12.0), color);
    let size = Vec2::new(galley.size().x + 31.0, 23.0);
    let (rect, response) = ui.allocate_exact_size(size, Sense::hover());
    response.widget_info(|| WidgetInfo::labeled(Role::Label, true, text));
    ui.painter().rect_filled(rect, 11.5, color.gamma_multiply(0.15));
    ui.painter().circle_filled(pos2(rect.left() + 12.0, rect.center().y), 3.6, color);
    ui.painter().galley(pos2(rect.left() + 21.0, rect.center().y - galley.size().y * 0.5), galley, color);
}

/// One line of text, ending in an ellipsis if it does not fit.
pub(super) fn line(ui: &Ui, left_middle: egui::Pos2, width: f32, text: &str, color: Color32) {
    let text = egui::WidgetText::from(RichText::new(text).size(13.5).color(color));
    let galley = text.into_galley(ui, Some(egui::TextWrapMode::Truncate), width, egui::TextStyle::Body);
    ui.painter().galley(left_middle - Vec2::new(0.0, galley.size().y * 0.5), galley, color);
}

/// A track from −180° to 180° with a bar from its middle; `None` leaves it empty.
pub(super) fn angle_bar(ui: &mut Ui, angle: Option<f32>, color: Color32, width: f32) {
    let (rect, _) = ui.allocate_exact_size(Vec2::new(width, 6.0), Sense::hover());
    ui.painter().rect_filled(rect, 3.0, theme::WELL);
    if let Some(angle) = angle {
        let share = (angle / std::f32::consts::PI).clamp(-1.0, 1.0) * 0.5;
        let middle = rect.center().x;
        let end = middle + share * rect.width();
        let bar = egui::Rect::from_x_y_ranges(middle.min(end)..=middle.max(end), rect.y_range());
        ui.painter().rect_filled(bar, 3.0, color.gamma_multiply(0.75));
        ui.painter().circle_filled(pos2(end, rect.center().y), 4.0, color);
    }
    let middle = [rect.center_top() - Vec2::new(0.0, 2.0), rect.center_bottom() + Vec2::new(0.0, 2.0)];
    ui.painter().line_segment(middle, Stroke::new(1.0, theme::GREY));
}

/// The red button: a dot and "Record", or a square, "Stop" and the time, blinking slowly.
pub(super) fn record(ui: &mut Ui, recording: Option<f64>, enabled: bool, size: Vec2) -> Response {
    let (rect, response) = ui.allocate_exact_size(size, if enabled { Sense::click() } else { Sense::hover() });
    let label = if recording.is_some() { "Stop" } else { "Record" };
    response.widget_info(|| WidgetInfo::labeled(Role::Button, enabled, label));
    let strength = match (enabled, recording.is_some(), response.hovered()) {
        (false, ..) => 0.10,
        (true, true, false) => 0.75,
        (true, false, false) => 0.26,
        (true, ..) => 0.9,
    };
    ui.painter().rect_filled(rect, 8.0, theme::RED.gamma_multiply(strength));
    ui.painter().rect_stroke(
        rect,
        8.0,
        Stroke::new(1.0, theme::RED.gamma_multiply(strength.max(0.35))),
        egui::StrokeKind::Inside,
    );
    let ink = if enabled { Color32::WHITE } else { theme::GREY };
    let mark = pos2(rect.left() + 20.0, rect.center().y);
    let font = FontId::proportional(14.0);
    if let Some(seconds) = recording {
        let lit = ui.input(|input| input.time).rem_euclid(1.2) < 0.75;
        ui.ctx().request_repaint_after(std::time::Duration::from_millis(150));
        ui.painter().circle_filled(mark, 5.5, if lit { Color32::WHITE } else { Color32::WHITE.gamma_multiply(0.25) });
        let text = format!("Stop   {}", clock(seconds));
        ui.painter().text(mark + Vec2::new(14.0, 0.0), Align2::LEFT_CENTER, text, font, ink);
    } else {
        let mark_color = if response.hovered() { Color32::WHITE } else { theme::RED };
        ui.painter().circle_filled(mark, 5.5, if enabled { mark_color } else { theme::GREY });
        ui.painter().text(mark + Vec2::new(14.0, 0.0), Align2::LEFT_CENTER, label, font, ink);
    }
    response
}

/// Capitalised.
pub(super) fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |first| first.to_uppercase().chain(chars).collect())
}

/// As a sentence: errors come without a capital and full stop, to follow a colon.
pub(super) fn sentence(text: &str) -> String {
    let text = capitalised(text.trim());
    if text.is_empty() || text.ends_with(['.', '!', '?']) { text } else { text + "." }
}

/// Minutes, seconds and tenths: "1:04.2".
pub(super) fn clock(seconds: f64) -> String {
    // A float cast saturates; NaN becomes zero.
    let tenths = (seconds.max(0.0) * 10.0) as u64;
    format!("{}:{:02}.{}", tenths / 600, tenths / 10 % 60, tenths % 10)
}

/// A name, capitalised.
pub(super) fn titled(name: &str) -> String {
    let mut letters = name.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// Digits in groups of three: "1 234 567".
pub(super) fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut out = String::with_capacity(digits.len() * 4 / 3);
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            out.push('\u{2009}');
        }
        out.push(digit);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clocks_and_numbers_read_well() {
        assert_eq!(clock(64.27), "1:04.2");
        assert_eq!(clock(f64::NAN), "0:00.0");
        assert_eq!(clock(-3.0), "0:00.0");
        assert_eq!(grouped(1_234_567).replace('\u{2009}', " "), "1 234 567");
        assert_eq!(grouped(999), "999");
        assert_eq!([titled("human8"), titled("")], ["Human8", ""]);
        assert_eq!(sentence("the puppet is silent "), "The puppet is silent.");
        assert_eq!(sentence("Why?"), "Why?");
        assert_eq!(sentence(""), "");
    }
}
