//! The open take from left to right: transport, ruler, and what every joint said, with what went wrong drawn on it.

use armature_take::JointCurve;
use eframe::egui::{
    self, Align2, Color32, FontId, Pos2, Rect, Response, Role, ScrollArea, Sense, Stroke, Ui, Vec2, WidgetInfo, pos2,
    vec2,
};

use super::{menus, widgets};
use crate::app::action::Action;
use crate::app::desk::edit_label;
use crate::app::state::{State, axis_label};
use crate::app::theme;
use crate::engine::playback::Play;
use crate::takes::opened::OpenedTake;

const NAMES: f32 = 190.0;
const RULER: f32 = 22.0;
const TRACK: f32 = 30.0;
const TALL_TRACK: f32 = 96.0;
const BUTTON: Vec2 = Vec2::new(30.0, 26.0);
/// Below this width the transport needs two lines.
const ONE_LINE: f32 = 860.0;
/// Nothing for longer than this is a break in a curve.
const GAP_SECONDS: f64 = 0.1;
/// Speeds to choose from.
const SPEEDS: [f64; 5] = [0.1, 0.25, 0.5, 1.0, 2.0];

/// What the timeline remembers between frames.
#[derive(Debug, Default)]
pub(super) struct Timeline {
    /// The track drawn large.
    tall: Option<usize>,
}

/// Seconds to pixels, on the clock of what is drawn.
#[derive(Clone, Copy)]
struct Scale {
    left: f32,
    width: f32,
    first: f64,
    last: f64,
}

impl Scale {
    fn x(self, seconds: f64) -> f32 {
        let part = (seconds - self.first) / (self.last - self.first).max(1e-9);
        self.left + self.width * part as f32
    }

    fn seconds(self, x: f32) -> f64 {
        self.first + f64::from((x - self.left) / self.width.max(1.0)) * (self.last - self.first)
    }
}

/// Draws it.
pub(super) fn show(ui: &mut Ui, state: &State, timeline: &mut Timeline, actions: &mut Vec<Action>) {
    let Some(take) = state.desk.open.clone() else { return };
    transport(ui, state, &take, actions);
    let whole = ui.available_rect_before_wrap();
    let left = whole.left() + NAMES;
    // Drawn is the recording's own clock, so that what was trimmed away is seen; where edits change the speed there is
    // only the clock of the result.
    let (first, last) = take.span();
    let scale = Scale {
        left,
        width: (whole.right() - left - 10.0).max(50.0),
        first: if take.begins.is_some() { 0.0 } else { first },
        last: if take.begins.is_some() { take.curves.seconds } else { last },
    };
    let begins = take.begins.unwrap_or(0.0);
    ruler(ui, state, &take, scale, begins, actions);
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 1.0;
        if take.begins.is_none() {
            widgets::quiet(
                ui,
                "The edits of this take change its speed or repeat it, so the curves of the recording are not drawn.",
            );
            return;
        }
        for (index, joint) in take.curves.joints.iter().enumerate() {
            track(ui, state, &take, (index, joint), scale, timeline, actions);
        }
    });
    // The playhead lies over everything.
    let x = scale.x(state.desk.playback.seconds + begins);
    let line = [pos2(x, whole.top()), pos2(x, whole.bottom())];
    ui.painter().line_segment(line, Stroke::new(1.5, theme::ACCENT));
}

fn transport(ui: &mut Ui, state: &State, take: &OpenedTake, actions: &mut Vec<Action>) {
    let is_narrow = ui.available_width() < ONE_LINE;
    ui.horizontal(|ui| {
        moves(ui, state, take, actions);
        if !is_narrow {
            edits(ui, state, actions);
        }
        title(ui, take, actions);
    });
    if is_narrow {
        ui.horizontal(|ui| edits(ui, state, actions));
    }
}

/// What moves the playhead.
fn moves(ui: &mut Ui, state: &State, take: &OpenedTake, actions: &mut Vec<Action>) {
    let playback = state.desk.playback;
    ui.spacing_mut().item_spacing.x = 5.0;
    ui.spacing_mut().button_padding.x = 8.0;
    menus::labelled(ui, "|<", &Action::GoTo { end: false }, BUTTON, state, actions);
    menus::labelled(ui, "<", &Action::Step { forward: false }, BUTTON, state, actions);
    let label = if playback.playing { "Pause" } else { "Play" };
    menus::labelled(ui, label, &Action::TogglePlay, Vec2::new(64.0, 26.0), state, actions);
    menus::labelled(ui, ">", &Action::Step { forward: true }, BUTTON, state, actions);
    menus::labelled(ui, ">|", &Action::GoTo { end: true }, BUTTON, state, actions);
    let (first, last) = take.span();
    let clock = format!("{:.2} / {:.2} s", playback.seconds - first, last - first);
    ui.add_sized([120.0, 20.0], egui::Label::new(egui::RichText::new(clock).monospace()));
    let speeds = egui::ComboBox::from_id_salt("speed").width(58.0).selected_text(format!("× {}", playback.speed));
    speeds.show_ui(ui, |ui| {
        for speed in SPEEDS {
            if ui.selectable_label((playback.speed - speed).abs() < 1e-9, format!("× {speed}")).clicked() {
                actions.push(Action::Play(Play::Speed(speed)));
            }
        }
    });
    menus::button(ui, &Action::ToggleLoop, BUTTON, state, actions);
}

/// What is done to the take.
fn edits(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    ui.spacing_mut().item_spacing.x = 5.0;
    ui.spacing_mut().button_padding.x = 8.0;
    for action in [Action::SetIn, Action::SetOut, Action::Mark, Action::Trim, Action::ShowExport] {
        menus::button(ui, &action, BUTTON, state, actions);
    }
}

/// The take's name and edits, and the way back to the puppet.
fn title(ui: &mut Ui, take: &OpenedTake, actions: &mut Vec<Action>) {
    ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
        if widgets::close(ui, "Close the take").clicked() {
            actions.push(Action::CloseTake);
        }
        let edits = crate::terminal::counted(take.list.edits.len(), "edit", "edits");
        let label = egui::RichText::new(format!("{}, {edits}", take.name())).strong();
        ui.add(egui::Label::new(label).truncate()).on_hover_ui(|ui| {
            for edit in &take.list.edits {
                ui.label(edit_label(edit));
            }
            ui.label(take.receipt.to_string());
            take.notes.iter().for_each(|note| {
                ui.label(note);
            });
        });
    });
}

fn ruler(ui: &mut Ui, state: &State, take: &OpenedTake, scale: Scale, begins: f64, actions: &mut Vec<Action>) {
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), RULER), Sense::click_and_drag());
    response.widget_info(|| WidgetInfo::labeled(Role::Slider, true, "Time"));
    seek(&response, scale, begins, actions);
    let painter = ui.painter_at(rect);
    let lane = Rect::from_min_max(pos2(scale.left, rect.top()), pos2(scale.left + scale.width, rect.bottom()));
    painter.rect_filled(lane, 3.0, theme::WELL);
    let step = tick_step((scale.last - scale.first) / f64::from(scale.width) * 70.0);
    let mut at = (scale.first / step).ceil() * step;
    while at <= scale.last {
        let x = scale.x(at);
        painter.line_segment([pos2(x, rect.bottom() - 6.0), pos2(x, rect.bottom())], Stroke::new(1.0, theme::GREY));
        let font = FontId::proportional(11.0);
        painter.text(pos2(x + 3.0, rect.top() + 8.0), Align2::LEFT_CENTER, format!("{at:.1}"), font, theme::QUIET);
        at += step;
    }
    let (first, last) = take.span();
    // What was trimmed away.
    shade(&painter, lane, scale.first, begins + first, scale, Color32::from_black_alpha(150));
    shade(&painter, lane, begins + last, scale.last, scale, Color32::from_black_alpha(150));
    if let Some((from, to)) = state.desk.playback.range {
        shade(&painter, lane, begins + from, begins + to, scale, theme::ACCENT.gamma_multiply(0.3));
    }
    for (at, text) in &take.markers {
        let x = scale.x(at + begins);
        painter.line_segment([pos2(x, rect.top()), pos2(x, rect.bottom())], Stroke::new(2.0, theme::GREEN));
        painter.text(
            pos2(x + 4.0, rect.bottom() - 6.0),
            Align2::LEFT_CENTER,
            text,
            FontId::proportional(10.0),
            theme::GREEN,
        );
    }
    let text =
        format!("{}, {} lost", crate::terminal::counted(take.pose_count(), "pose", "poses"), take.receipt.lost_samples);
    widgets::line(ui, pos2(rect.left(), rect.center().y), NAMES - 10.0, &text, theme::QUIET);
}

/// Where a click or a drag is, the playhead goes.
fn seek(response: &Response, scale: Scale, begins: f64, actions: &mut Vec<Action>) {
    if let Some(pointer) = response.interact_pointer_pos().filter(|_| response.dragged() || response.clicked()) {
        actions.push(Action::Play(Play::Seek(scale.seconds(pointer.x) - begins)));
    }
}

fn shade(painter: &egui::Painter, lane: Rect, from: f64, to: f64, scale: Scale, color: Color32) {
    if to > from {
        let (a, b) = (scale.x(from).max(lane.left()), scale.x(to).min(lane.right()));
        painter.rect_filled(Rect::from_x_y_ranges(a..=b, lane.y_range()), 0.0, color);
    }
}

fn track(
    ui: &mut Ui,
    state: &State,
    take: &OpenedTake,
    (index, joint): (usize, &JointCurve),
    scale: Scale,
    timeline: &mut Timeline,
    actions: &mut Vec<Action>,
) {
    let height = if timeline.tall == Some(index) { TALL_TRACK } else { TRACK };
    let (rect, response) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::click_and_drag());
    let bone =
        take.bone_of_curve.get(index).copied().flatten().and_then(|bone| take.character.skeleton.bones().get(bone));
    let name = bone.map_or_else(|| format!("{}", joint.part), |bone| bone.name.clone());
    let label = format!("{name} {}", axis_label(joint.axis).to_lowercase());
    response.widget_info(|| WidgetInfo::labeled(Role::Button, true, label.clone()));
    if !ui.is_rect_visible(rect) {
        return;
    }
    let pointer = response.interact_pointer_pos();
    let on_names = pointer.is_some_and(|pointer| pointer.x < scale.left);
    if response.clicked() && on_names {
        timeline.tall = (timeline.tall != Some(index)).then_some(index);
    } else if !on_names {
        seek(&response, scale, take.begins.unwrap_or(0.0), actions);
    }
    let middle = rect.center().y;
    widgets::line(ui, pos2(rect.left() + 22.0, middle), NAMES - 30.0, &label, theme::TEXT);
    if let Some(bone) = bone {
        arm(ui, pos2(rect.left() + 9.0, middle), &bone.name, state, actions);
    }
    let lane = Rect::from_min_max(pos2(scale.left, rect.top()), pos2(scale.left + scale.width, rect.bottom()));
    let painter = ui.painter_at(lane);
    painter.rect_filled(lane, 3.0, theme::WELL);
    for gap in &take.receipt.gaps {
        shade(&painter, lane, gap.start_seconds, gap.end_seconds, scale, theme::RED.gamma_multiply(0.35));
    }
    for silent in take.silent.iter().filter(|silent| silent.part == joint.part) {
        shade(
            &painter,
            lane,
            silent.at_seconds,
            silent.at_seconds + silent.seconds,
            scale,
            theme::AMBER.gamma_multiply(0.35),
        );
    }
    let all = joint.raw.iter().chain(&joint.filtered).flatten();
    let (low, high) = all.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), [a, b]| (low.min(*a), high.max(*b)));
    if low > high {
        painter.text(lane.center(), Align2::CENTER_CENTER, "no good reading", FontId::proportional(11.0), theme::QUIET);
        return;
    }
    // A joint that hardly moved is a line, not noise as tall as the track.
    let room = (high - low).max(0.1) * 1.15;
    let centre = (low + high) * 0.5;
    let y = |angle: f32| lane.center().y - (angle - centre) / room * lane.height();
    let most_empty = (GAP_SECONDS / take.curves.seconds.max(1e-9) * joint.raw.len() as f64).ceil() as usize;
    curve(&painter, &joint.raw, most_empty, lane, y, theme::GREY);
    curve(&painter, &joint.filtered, most_empty, lane, y, theme::GREEN);
    if timeline.tall == Some(index) {
        let ends = [(high, Align2::LEFT_TOP, lane.top() + 2.0), (low, Align2::LEFT_BOTTOM, lane.bottom() - 2.0)];
        for (angle, align, y) in ends {
            let at = pos2(lane.left() + 4.0, y);
            painter.text(at, align, format!("{:.0}°", angle.to_degrees()), FontId::monospace(10.5), theme::QUIET);
        }
    }
    let hint =
        "Grey: as measured. Green: after the filter. Red: no samples came. Amber: this joint had no good reading";
    response.on_hover_text(hint);
}

/// A curve as the band between its lowest and highest value in each pixel, broken where nothing was measured for longer
/// than `most_empty` steps.
fn curve(
    painter: &egui::Painter,
    steps: &[Option<armature_take::Span>],
    most_empty: usize,
    lane: Rect,
    y: impl Fn(f32) -> f32,
    color: Color32,
) {
    let columns = (lane.width() as usize).max(1);
    let mut line: Vec<Pos2> = Vec::with_capacity(columns * 2);
    let flush = |line: &mut Vec<Pos2>| {
        if line.len() > 1 {
            painter.add(egui::Shape::line(std::mem::take(line), Stroke::new(1.2, color)));
        } else if let Some(only) = line.pop() {
            painter.circle_filled(only, 1.0, color);
        }
    };
    let (mut column_span, mut column, mut empty): (Option<[f32; 2]>, usize, usize) = (None, 0, 0);
    let put = |line: &mut Vec<Pos2>, column: usize, span: Option<[f32; 2]>| {
        let Some([low, high]) = span else { return };
        let x = lane.left() + column as f32 + 0.5;
        line.push(pos2(x, y(low)));
        if high > low {
            line.push(pos2(x, y(high)));
        }
    };
    for (step, span) in steps.iter().enumerate() {
        let here = step * columns / steps.len();
        if here != column {
            put(&mut line, column, column_span.take());
            column = here;
        }
        let Some([low, high]) = span else {
            empty += 1;
            continue;
        };
        if empty > most_empty {
            put(&mut line, column, column_span.take());
            flush(&mut line);
        }
        empty = 0;
        column_span = Some(column_span.map_or([*low, *high], |[a, b]| [a.min(*low), b.max(*high)]));
    }
    put(&mut line, column, column_span);
    flush(&mut line);
}

/// The dot that arms a limb for an overdub.
fn arm(ui: &mut Ui, at: Pos2, bone: &str, state: &State, actions: &mut Vec<Action>) {
    let rect = Rect::from_center_size(at, Vec2::splat(16.0));
    let id = ui.scope_id().with(("arm", at.y as i32, bone));
    let response = ui.interact(rect, id, Sense::click());
    let is_armed = state.desk.armed.contains(bone);
    response.widget_info(|| WidgetInfo::selected(Role::CheckBox, true, is_armed, format!("Arm {bone}")));
    if is_armed {
        ui.painter().circle_filled(at, 5.0, theme::RED);
    } else {
        ui.painter().circle_stroke(at, 4.5, Stroke::new(1.2, theme::GREY));
    }
    let hint = format!("Record {bone} and everything below it over this take, while it plays");
    if response.on_hover_text(hint).clicked() {
        actions.push(Action::Arm(bone.to_owned()));
    }
}

/// A round number of seconds, at least this many.
fn tick_step(least: f64) -> f64 {
    let power = 10_f64.powf(least.max(1e-3).log10().floor());
    [1.0, 2.0, 5.0, 10.0].into_iter().map(|n| n * power).find(|step| *step >= least).unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_numbers() {
        for (least, step) in [(0.03, 0.05), (0.7, 1.0), (1.1, 2.0), (33.0, 50.0), (60.0, 100.0)] {
            assert!((tick_step(least) - step).abs() < 1e-9, "{least}");
        }
    }

    #[test]
    fn a_place_is_its_time_and_back() {
        let scale = Scale { left: 190.0, width: 800.0, first: 0.0, last: 12.5 };
        for seconds in [0.0, 3.3, 12.5] {
            assert!((scale.seconds(scale.x(seconds)) - seconds).abs() < 1e-3);
        }
    }
}
