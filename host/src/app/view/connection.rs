//! The upper left: which puppet is connected, and how to connect one.

use armature_sim::Body;
use eframe::egui::{self, Align, Layout, RichText, Ui, Vec2};

use super::widgets;
use crate::app::action::Action;
use crate::app::state::{Connection, State};
use crate::app::theme;
use crate::characters::default_for;
use crate::engine::command::CharacterChoice;

/// Three and a half serial ports, so that it is visible when there are more.
const PORTS_HEIGHT: f32 = 130.0;

/// The program's name, and whether a puppet is connected.
pub(super) fn header(ui: &mut Ui, state: &State) {
    ui.horizontal(|ui| {
        ui.label(RichText::new("Armature").size(19.0).strong());
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| match &state.connection {
            Connection::Off => widgets::pill(ui, "Not connected", theme::QUIET),
            Connection::Connecting { .. } => widgets::pill(ui, "Connecting", theme::AMBER),
            Connection::On { .. } if state.is_live() => widgets::pill(ui, "Live", theme::GREEN),
            Connection::On { .. } if state.is_line_broken() => widgets::pill(ui, "Line broken", theme::AMBER),
            Connection::On { .. } => widgets::pill(ui, "Waiting for samples", theme::AMBER),
        });
    });
}

/// The card for connecting, or the current connection.
pub(super) fn card(ui: &mut Ui, state: &mut State, actions: &mut Vec<Action>) {
    theme::card().show(ui, |ui| {
        ui.set_width(ui.available_width());
        match &state.connection {
            Connection::Off => offer(ui, state, actions),
            Connection::Connecting { address } => {
                ui.horizontal(|ui| {
                    ui.label(format!("Connecting to {address}…"));
                });
                close(ui, "Give up", state, actions);
            }
            Connection::On { address, device } => {
                ui.label(RichText::new(device).strong());
                widgets::quiet(ui, address.as_str());
                close(ui, "Disconnect", state, actions);
            }
        }
    });
}

fn close(ui: &mut Ui, label: &str, state: &State, actions: &mut Vec<Action>) {
    let possible = state.can_disconnect();
    let button = ui.add_enabled_ui(possible.is_ok(), |ui| widgets::wide(ui, egui::Button::new(label), 30.0)).inner;
    let button = match possible {
        Ok(()) => button.on_hover_text("Close the connection"),
        Err(why) => button.on_disabled_hover_text(why),
    };
    if button.clicked() {
        actions.push(Action::Disconnect);
    }
}

fn offer(ui: &mut Ui, state: &mut State, actions: &mut Vec<Action>) {
    widgets::caption(ui, "SIMULATED PUPPET");
    ui.horizontal(|ui| {
        let count = Body::presets().count() as f32;
        let width = (ui.available_width() - (count - 1.0) * ui.spacing().item_spacing.x) / count;
        for (name, what) in Body::presets() {
            let address = format!("sim:{name}");
            let button = egui::Button::new(widgets::titled(name)).min_size(Vec2::new(width, 32.0));
            if ui.add(button).on_hover_text(format!("A simulated {what}")).clicked() {
                let character = CharacterChoice::named(default_for(&address));
                // Anyone who tries a simulated hand wants to see a hand, unless a file was opened.
                if !state.shows(&character) && !matches!(state.choice, CharacterChoice::File(_)) {
                    actions.push(Action::Load(character));
                }
                actions.push(Action::Connect(address));
            }
        }
    });
    ui.add_space(4.0);
    serial_ports(ui, state, actions);
    ui.add_space(4.0);
    widgets::caption(ui, "ADDRESS");
    let field = egui::TextEdit::singleline(&mut state.address)
        .hint_text("serial:/dev/ttyACM0 or tcp:host:port")
        .margin(egui::Margin::symmetric(10, 7))
        .desired_width(f32::INFINITY);
    let response = ui.add(field);
    let entered = response.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
    response.on_hover_text("sim:human · serial:/dev/ttyACM0 · tcp:192.168.0.12:4100");
    let can = !state.address.trim().is_empty();
    let connect = ui.add_enabled_ui(can, |ui| widgets::wide(ui, widgets::primary("Connect"), 34.0)).inner;
    let connect = connect.on_hover_text("Connect to this address");
    if can && (connect.clicked() || entered) {
        actions.push(Action::Connect(state.address.clone()));
    }
}

fn serial_ports(ui: &mut Ui, state: &State, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        widgets::caption(ui, "SERIAL PORTS");
        ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
            let refresh = egui::Button::new(RichText::new("Refresh").size(11.5).color(theme::ACCENT)).frame(false);
            if ui.add(refresh).on_hover_text("Look for plugged-in puppets again").clicked() {
                actions.push(Action::ListDevices);
            }
        });
    });
    if state.devices.is_empty() {
        widgets::quiet(ui, "None found. Plug the puppet in, then refresh.");
    }
    egui::ScrollArea::vertical().max_height(PORTS_HEIGHT).show(ui, |ui| {
        ui.spacing_mut().item_spacing.y = 6.0;
        for device in &state.devices {
            let port = device.address.strip_prefix("serial:").unwrap_or(&device.address);
            let label = RichText::new(&device.label).size(11.5).color(theme::QUIET);
            let button = egui::Button::new(port).right_text(label).truncate();
            let response = widgets::wide(ui, button, 32.0);
            if response.on_hover_text(format!("Connect to {}", device.label)).clicked() {
                actions.push(Action::Connect(device.address.clone()));
            }
        }
    });
}
