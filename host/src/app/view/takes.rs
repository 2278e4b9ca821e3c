//! The list of takes: open one, rate it, note something, throw it into the bin and take it out again.

use eframe::egui::{
    self, Align, Align2, FontId, Layout, RichText, Role, ScrollArea, Sense, Ui, Vec2, WidgetInfo, pos2,
};

use super::widgets::{self, clock};
use crate::app::action::Action;
use crate::app::state::State;
use crate::app::theme;
use crate::takes::library::{ListedTake, MOST_STARS};
use crate::terminal::counted;

const ROW: f32 = 42.0;

/// What the list remembers between frames.
#[derive(Debug, Default)]
pub(super) struct TakeList {
    /// The take whose note is being written, and the note.
    note: Option<(std::path::PathBuf, String)>,
    shows_bin: bool,
}

/// Draws the list.
pub(super) fn show(ui: &mut Ui, state: &State, list: &mut TakeList, actions: &mut Vec<Action>) {
    let library = state.desk.library.clone();
    ui.horizontal(|ui| {
        let folder = library.folder.display().to_string();
        widgets::quiet(ui, counted(library.takes.len(), "take", "takes")).on_hover_text(folder);
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if ui.small_button("Folder").on_hover_text("Show the folder of the takes").clicked() {
                actions.push(Action::ShowFolder(library.folder.clone()));
            }
            if !library.bin.is_empty() {
                let label = format!("Bin ({})", library.bin.len());
                let button = egui::Button::new(label).small().selected(list.shows_bin);
                if ui.add(button).on_hover_text("Takes that were thrown away").clicked() {
                    list.shows_bin = !list.shows_bin;
                }
            }
        });
    });
    if list.shows_bin && !library.bin.is_empty() {
        ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
            for take in &library.bin {
                ui.horizontal(|ui| {
                    if ui.small_button("Restore").on_hover_text("Take it out of the bin").clicked() {
                        actions.push(Action::Restore(take.path.clone()));
                    }
                    ui.add(egui::Label::new(format!("{}  {}", take.name(), clock(take.seconds))).truncate());
                });
            }
        });
        return;
    }
    if library.takes.is_empty() {
        ui.add_space(12.0);
        widgets::quiet(ui, "No take yet. Connect a puppet and press Record (R).");
        return;
    }
    ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 2.0;
        for take in &library.takes {
            row(ui, state, take, list, actions);
        }
    });
}

fn row(ui: &mut Ui, state: &State, take: &ListedTake, list: &mut TakeList, actions: &mut Vec<Action>) {
    let is_open = state.desk.open.as_ref().is_some_and(|open| open.path == take.path);
    let (rect, response) = ui.allocate_exact_size(Vec2::new(ui.available_width(), ROW), Sense::click());
    let label = format!("Open {}", take.name());
    response.widget_info(|| WidgetInfo::selected(Role::ListBoxOption, true, is_open, label.clone()));
    if is_open {
        ui.painter().rect_filled(rect, 6.0, theme::ACCENT.gamma_multiply(0.22));
    } else if response.hovered() {
        ui.painter().rect_filled(rect, 6.0, theme::CARD);
    }
    let (upper, lower) = (rect.top() + 13.0, rect.bottom() - 11.0);
    let left = rect.left() + 10.0;
    widgets::line(ui, pos2(left, upper), rect.width() - 110.0, &take.name(), theme::TEXT);
    let second = match &take.trouble {
        Some(trouble) => trouble.clone(),
        None if take.note.is_empty() => {
            let lost = if take.lost == 0 { "none lost".to_owned() } else { format!("{} lost", take.lost) };
            let edited = if take.edited { ", edited" } else { "" };
            format!("{} samples, {lost}{edited}", take.samples)
        }
        None => take.note.clone(),
    };
    let color = if take.trouble.is_some() { theme::AMBER } else { theme::QUIET };
    widgets::line(ui, pos2(left, lower), rect.width() - 110.0, &second, color);
    let font = FontId::monospace(12.0);
    ui.painter().text(pos2(rect.right() - 10.0, upper), Align2::RIGHT_CENTER, clock(take.seconds), font, theme::TEXT);
    stars(ui, pos2(rect.right() - 10.0, lower), take, actions);
    response.context_menu(|ui| {
        if ui.button("Note…").clicked() {
            list.note = Some((take.path.clone(), take.note.clone()));
            ui.close();
        }
        if ui.button("Discard").clicked() {
            actions.push(Action::Discard(take.path.clone()));
            ui.close();
        }
    });
    let hint = "Click to open it; a right click offers more";
    if response.on_hover_text(hint).clicked() && take.trouble.is_none() {
        actions.push(Action::OpenTake(take.path.clone()));
    }
    if let Some((_, text)) = list.note.as_mut().filter(|(path, _)| *path == take.path) {
        let field = egui::TextEdit::singleline(text).hint_text("Note").desired_width(f32::INFINITY);
        let response = ui.add(field);
        if response.lost_focus() {
            actions.push(Action::Annotate { take: take.path.clone(), note: text.clone(), rating: take.rating });
            list.note = None;
        } else {
            response.request_focus();
        }
    }
}

/// A click on the star that is lit last takes the rating back.
fn stars(ui: &mut Ui, right_middle: egui::Pos2, take: &ListedTake, actions: &mut Vec<Action>) {
    for star in 1..=MOST_STARS {
        let at = right_middle - Vec2::new(13.0 * f32::from(MOST_STARS - star) + 5.0, 0.0);
        let id = ui.scope_id().with((&take.path, star));
        let response = ui.interact(egui::Rect::from_center_size(at, Vec2::splat(13.0)), id, Sense::click());
        let lit = star <= take.rating;
        response.widget_info(|| {
            WidgetInfo::labeled(Role::Button, true, format!("{star} of {} for {}", MOST_STARS, take.name()))
        });
        let color = if lit || response.hovered() { theme::AMBER } else { theme::GREY };
        star_shape(ui, at, lit, color);
        if response.clicked() {
            let rating = if star == take.rating { 0 } else { star };
            actions.push(Action::Annotate { take: take.path.clone(), note: take.note.clone(), rating });
        }
    }
}

/// Drawn, since the font has no stars.
fn star_shape(ui: &Ui, at: egui::Pos2, lit: bool, color: egui::Color32) {
    let corner = |index: u16| {
        let angle = std::f32::consts::TAU * f32::from(index) / 10.0 - std::f32::consts::FRAC_PI_2;
        at + Vec2::angled(angle) * if index.is_multiple_of(2) { 5.5 } else { 2.4 }
    };
    let corners: Vec<egui::Pos2> = (0..10).map(corner).collect();
    if lit {
        // A star is not convex, its five kites are.
        for tip in (0..10).step_by(2) {
            let points = vec![corners[tip], corners[(tip + 1) % 10], at, corners[(tip + 9) % 10]];
            ui.painter().add(egui::Shape::convex_polygon(points, color, egui::Stroke::NONE));
        }
    } else {
        ui.painter().add(egui::Shape::closed_line(corners, egui::Stroke::new(1.0, color)));
    }
}

/// The card about the take that was thrown away last.
pub(super) fn discarded(ui: &mut Ui, path: &std::path::Path, actions: &mut Vec<Action>) {
    let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    ui.horizontal(|ui| {
        ui.label(RichText::new(format!("{name} is in the bin")).strong());
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            if widgets::close(ui, "Close").clicked() {
                actions.push(Action::DismissDiscarded);
            }
            if ui.small_button("Bring it back").clicked() {
                actions.push(Action::Restore(path.to_owned()));
                actions.push(Action::DismissDiscarded);
            }
        });
    });
}
