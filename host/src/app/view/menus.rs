//! The table of commands on screen: the menu bar, the palette, the sheet of shortcuts, and buttons.

use eframe::egui::{self, Align2, Button, Context, Key, Response, RichText, ScrollArea, Ui, Vec2};

use super::widgets;
use crate::app::action::Action;
use crate::app::commands::{self, Entry, Menu};
use crate::app::state::{Overlay, State};
use crate::app::theme;

/// What the palette remembers while it is open.
#[derive(Debug, Default)]
pub(super) struct Palette {
    text: String,
    chosen: usize,
    is_open: bool,
}

/// The menus.
pub(super) fn bar(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    egui::MenuBar::new().ui(ui, |ui| {
        for menu in Menu::ALL {
            ui.menu_button(menu.title(), |ui| {
                ui.set_min_width(230.0);
                for entry in commands::all().filter(|entry| entry.menu == menu) {
                    let mut button = Button::new(entry.text).selected(entry.is_on(state));
                    if let Some(key) = entry.key(ui.ctx(), state.controls) {
                        button = button.shortcut_text(key);
                    }
                    if shown(ui, button, entry, state).on_hover_text(entry.tip).clicked() {
                        actions.push(entry.action.clone());
                        ui.close();
                    }
                }
            });
        }
    });
}

/// A button of a command; `None` for what is not in the table.
pub(super) fn button(
    ui: &mut Ui,
    action: &Action,
    size: Vec2,
    state: &State,
    actions: &mut Vec<Action>,
) -> Option<Response> {
    labelled(ui, commands::of(action)?.text, action, size, state, actions)
}

/// The same with another label.
pub(super) fn labelled(
    ui: &mut Ui,
    label: &str,
    action: &Action,
    size: Vec2,
    state: &State,
    actions: &mut Vec<Action>,
) -> Option<Response> {
    let entry = commands::of(action)?;
    let button = Button::new(label).min_size(size).selected(entry.is_on(state));
    let response = shown(ui, button, entry, state).on_hover_text(entry.hint(ui.ctx(), state.controls));
    if response.clicked() {
        actions.push(action.clone());
    }
    Some(response)
}

fn shown(ui: &mut Ui, button: Button<'_>, entry: &Entry, state: &State) -> Response {
    let possible = entry.possible(state);
    let response = ui.add_enabled(possible.is_ok(), button);
    match possible {
        Ok(()) => response,
        Err(why) => response.on_disabled_hover_text(format!("{}. {why}", entry.tip)),
    }
}

/// What lies over the window.
pub(super) fn overlay(ctx: &Context, state: &State, palette: &mut Palette, actions: &mut Vec<Action>) {
    match state.overlay {
        Some(Overlay::Palette) => find(ctx, state, palette, actions),
        Some(Overlay::Shortcuts) => sheet(ctx, state, actions),
        None => {}
    }
    if state.overlay != Some(Overlay::Palette) {
        *palette = Palette::default();
    }
}

fn find(ctx: &Context, state: &State, palette: &mut Palette, actions: &mut Vec<Action>) {
    let found: Vec<&Entry> = commands::all()
        .filter(|entry| entry.action != Action::Toggle(Overlay::Palette) && fits(entry, &palette.text))
        .collect();
    let (up, down, enter) = ctx.input_mut(|input| {
        let mut took = |key| input.consume_key(egui::Modifiers::NONE, key);
        (took(Key::ArrowUp), took(Key::ArrowDown), took(Key::Enter))
    });
    let last = found.len().saturating_sub(1);
    palette.chosen = (palette.chosen + usize::from(down)).min(last).saturating_sub(usize::from(up));
    let mut run = found.get(palette.chosen).copied().filter(|_| enter);
    panel("palette", "Find a command").anchor(Align2::CENTER_TOP, [0.0, 90.0]).default_width(440.0).show(ctx, |ui| {
        let field =
            egui::TextEdit::singleline(&mut palette.text).hint_text("Part of its name").desired_width(f32::INFINITY);
        let response = ui.add(field);
        if !std::mem::replace(&mut palette.is_open, true) {
            response.request_focus();
        }
        if response.changed() {
            palette.chosen = 0;
        }
        ScrollArea::vertical().max_height(330.0).show(ui, |ui| {
            ui.spacing_mut().item_spacing.y = 2.0;
            ui.set_width(ui.available_width());
            for (index, entry) in found.iter().enumerate() {
                let text = format!("{}: {}", entry.menu.title(), entry.text);
                let mut button =
                    Button::new(text).selected(index == palette.chosen).frame_when_inactive(index == palette.chosen);
                if let Some(key) = entry.key(ui.ctx(), state.controls) {
                    button = button.shortcut_text(key);
                }
                let button = button.min_size(Vec2::new(ui.available_width(), 26.0));
                let response = shown(ui, button, entry, state).on_hover_text(entry.tip);
                if index == palette.chosen && (up || down) {
                    response.scroll_to_me(None);
                }
                if response.clicked() {
                    run = Some(entry);
                }
            }
            if found.is_empty() {
                widgets::quiet(ui, "No command has this in its name.");
            }
        });
    });
    if let Some(entry) = run {
        actions.push(Action::Toggle(Overlay::Palette));
        actions.push(entry.possible(state).map_or_else(Action::Explain, |()| entry.action.clone()));
    }
}

/// Every word that was typed is somewhere in what the command is called or does.
fn fits(entry: &Entry, typed: &str) -> bool {
    let told = format!("{} {} {}", entry.menu.title(), entry.text, entry.tip).to_lowercase();
    typed.to_lowercase().split_whitespace().all(|word| told.contains(word))
}

fn sheet(ctx: &Context, state: &State, actions: &mut Vec<Action>) {
    panel("shortcuts", "Keys and mouse").anchor(Align2::CENTER_CENTER, [0.0, 0.0]).show(ctx, |ui| {
        ui.set_width(620.0);
        ui.horizontal(|ui| {
            let name = state.controls.name();
            widgets::quiet(ui, format!("As in {name} (menu View). {}.", state.controls.navigation()));
        });
        ScrollArea::vertical().max_height((ctx.content_rect().height() - 190.0).max(120.0)).show(ui, |ui| {
            ui.columns(2, |columns| {
                for (index, menu) in Menu::ALL.into_iter().enumerate() {
                    section(&mut columns[usize::from(index > 2)], menu, state);
                }
            });
        });
        if ui.button("Close").clicked() {
            actions.push(Action::Toggle(Overlay::Shortcuts));
        }
    });
}

fn section(ui: &mut Ui, menu: Menu, state: &State) {
    let with_keys = commands::all().filter(|entry| entry.menu == menu && !entry.keys_of(state.controls).is_empty());
    let with_keys: Vec<&Entry> = with_keys.collect();
    if with_keys.is_empty() {
        return;
    }
    ui.add_space(4.0);
    widgets::caption(ui, &menu.title().to_uppercase());
    ui.spacing_mut().item_spacing.y = 3.0;
    for entry in with_keys {
        ui.horizontal(|ui| {
            let keys: Vec<String> =
                entry.keys_of(state.controls).iter().take(2).map(|key| commands::written(ui.ctx(), *key)).collect();
            let text = RichText::new(keys.join(" or ")).monospace().color(theme::ACCENT);
            ui.add_sized([118.0, 18.0], egui::Label::new(text));
            ui.label(entry.text).on_hover_text(entry.tip);
        });
    }
}

fn panel(id: &str, title: &str) -> egui::Window<'static> {
    egui::Window::new(title.to_owned())
        .id(egui::Id::unique(id))
        .collapsible(false)
        .resizable(false)
        .frame(theme::floating().inner_margin(egui::Margin::same(14)).fill(theme::CARD))
}
