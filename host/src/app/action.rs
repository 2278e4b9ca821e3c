//! What the user at the window asks for, and as much of it as the window does itself.

use armature_rig::{CalibrationStep, PartUid};

use super::controls::Controls;
use super::state::{Connection, Overlay, State};
use crate::engine::command::{CharacterChoice, Command};
use crate::engine::event::Problem;

/// What the user at the window asks for.
#[derive(Clone, Debug, PartialEq)]
pub enum Action {
    /// Connect to the address.
    Connect(String),
    /// Disconnect, or stop trying to connect.
    Disconnect,
    /// Connect to the address in the field, unless already connected.
    ConnectToField,
    /// Look for serial ports.
    ListDevices,
    /// Take zero.
    Zero,
    /// Start a calibration step.
    Calibrate(CalibrationStep),
    /// Start a take.
    Record,
    /// Finish the take.
    StopRecording,
    /// Show another character.
    Load(CharacterChoice),
    /// Choose a file with a character.
    OpenCharacter,
    /// Let a part blink.
    Blink(PartUid),
    /// Select a part, or none.
    Select(Option<usize>),
    /// Show or hide the bones.
    ToggleBones,
    /// Show the whole character.
    FrameAll,
    /// Follow another program's habits.
    Follow(Controls),
    /// Open or close a panel over the window.
    Toggle(Overlay),
    /// Close the panel over the window, or deselect.
    Back,
    /// Say why something cannot be done now.
    Explain(&'static str),
    /// Cancel the work in progress.
    Cancel,
    /// Show a problem of the window itself.
    Report(Problem),
    /// Close a problem's card.
    DismissNotice(usize),
    /// Close the card of the last take.
    DismissSaved,
    /// Close the card of the last zero.
    DismissZeroed,
}

impl State {
    /// Does as much of an action as the window can, and returns what the engine must do.
    pub fn act(&mut self, action: Action) -> Option<Command> {
        self.explanation = None;
        match action {
            Action::Connect(address) => {
                let address = address.trim().to_owned();
                if address.is_empty() {
                    return None;
                }
                self.address.clone_from(&address);
                self.is_connecting_to(address.clone());
                Some(Command::Connect(address))
            }
            Action::ConnectToField if self.connection == Connection::Off => {
                self.act(Action::Connect(self.address.clone()))
            }
            Action::ConnectToField => None,
            Action::Disconnect => self.can_disconnect().is_ok().then_some(Command::Disconnect),
            Action::ListDevices => Some(Command::ListDevices),
            Action::Zero => self.can_calibrate().is_ok().then_some(Command::Zero),
            Action::Calibrate(step) => self.can_calibrate().is_ok().then_some(Command::Calibrate(step)),
            Action::Record => self.can_record().is_ok().then_some(Command::StartRecording),
            Action::StopRecording => self.recording.is_some().then_some(Command::StopRecording),
            Action::Load(choice) => self.can_change_character().is_ok().then_some(Command::LoadCharacter(choice)),
            Action::Blink(uid) => self.is_live().then_some(Command::Blink(uid)),
            Action::Cancel => self.busy.is_some().then_some(Command::Cancel),
            action => {
                self.act_alone(action);
                None
            }
        }
    }

    /// What needs no engine.
    fn act_alone(&mut self, action: Action) {
        match action {
            Action::OpenCharacter => self.wishes.open_character = true,
            Action::FrameAll => self.wishes.frame_all = true,
            Action::Select(part) => self.selected = part,
            Action::ToggleBones => self.show_bones = !self.show_bones,
            Action::Follow(controls) => self.controls = controls,
            Action::Toggle(overlay) => self.overlay = (self.overlay != Some(overlay)).then_some(overlay),
            Action::Back if self.overlay.is_some() => self.overlay = None,
            Action::Back => self.selected = None,
            Action::Explain(why) => self.explanation = Some(why),
            Action::Report(problem) => self.note(problem, false),
            Action::DismissNotice(index) => self.dismiss_notice(index),
            Action::DismissZeroed => self.zeroed = None,
            Action::DismissSaved => self.saved = None,
            _ => {}
        }
    }

    /// Whether zero and the other calibration steps are possible: never in the middle of a take. Otherwise why not.
    pub fn can_calibrate(&self) -> Result<(), &'static str> {
        self.live()?;
        self.not_recording()
    }

    /// Whether a take can be started.
    pub fn can_record(&self) -> Result<(), &'static str> {
        self.live()?;
        self.not_recording()
    }

    /// Whether the line may be closed: never in the middle of a take.
    pub fn can_disconnect(&self) -> Result<(), &'static str> {
        self.not_recording()?;
        if self.connection == Connection::Off { Err("No puppet is connected") } else { Ok(()) }
    }

    /// Whether a line can be opened.
    pub fn can_connect(&self) -> Result<(), &'static str> {
        if self.connection == Connection::Off { Ok(()) } else { Err("Disconnect first") }
    }

    /// Whether a take is being recorded.
    pub fn recorded(&self) -> Result<(), &'static str> {
        self.recording.map(|_| ()).ok_or("No take is being recorded")
    }

    /// Whether another character may be shown.
    pub fn can_change_character(&self) -> Result<(), &'static str> {
        self.not_recording()
    }

    /// Whether poses arrive, and otherwise why not.
    pub fn live(&self) -> Result<(), &'static str> {
        match self.connection {
            _ if self.is_live() => Ok(()),
            Connection::Off => Err("Connect a puppet first"),
            Connection::Connecting { .. } => Err("The puppet does not answer yet"),
            Connection::On { .. } if self.is_line_broken() => Err("The line to the puppet is broken"),
            Connection::On { .. } => Err("No sample of the puppet has come yet"),
        }
    }

    fn not_recording(&self) -> Result<(), &'static str> {
        if self.recording.is_some() { Err("Stop recording first") } else { Ok(()) }
    }
}

#[cfg(test)]
#[path = "state_tests.rs"]
mod tests;
