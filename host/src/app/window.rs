//! The window itself: events in, picture out, actions to commands.

use eframe::{CreationContext, egui};

use super::action::Action;
use super::state::State;
use super::view::View;
use super::{paint, theme};
use crate::engine::command::{CharacterChoice, Command};
use crate::engine::link::AppLink;

/// What to do as soon as the window is open.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Start {
    /// A puppet to connect to.
    pub device: Option<String>,
    /// The character to show.
    pub character: CharacterChoice,
}

/// The application.
#[derive(Debug)]
pub struct Window {
    state: State,
    view: View,
    link: AppLink,
    adapter: String,
    engine_is_gone: bool,
}

impl Window {
    /// Applies the theme, compiles the shaders, and sends the first commands.
    pub fn new(context: &CreationContext<'_>, link: AppLink, start: Start) -> Self {
        theme::apply(&context.egui_ctx);
        let adapter = context.wgpu_render_state.as_ref().map_or_else(|| "no graphics adapter".into(), paint::install);
        let mut window = Self { state: State::default(), view: View::default(), link, adapter, engine_is_gone: false };
        window.act(Action::ListDevices);
        window.act(Action::ListTakes);
        window.act(Action::Load(start.character));
        if let Some(address) = start.device {
            window.act(Action::Connect(address));
        }
        window
    }

    /// What the window knows.
    pub fn state(&self) -> &State {
        &self.state
    }

    fn act(&mut self, action: Action) {
        let Some(command) = self.state.act(action) else { return };
        if !self.link.send(command) && !self.engine_is_gone {
            self.engine_is_gone = true;
            self.state.engine_is_gone();
        }
    }
}

impl eframe::App for Window {
    fn logic(&mut self, _: &egui::Context, _: &mut eframe::Frame) {
        while let Some(event) = self.link.next_event() {
            if let Some(frame) = self.state.update_state(event) {
                self.link.recycle(frame);
            }
        }
    }

    fn ui(&mut self, ui: &mut egui::Ui, frame: &mut eframe::Frame) {
        let actions = self.view.show(ui, &mut self.state, frame.wgpu_render_state(), &self.adapter);
        for action in actions {
            self.act(action);
        }
    }

    fn on_exit(&mut self) {
        self.link.send(Command::Quit);
    }
}
