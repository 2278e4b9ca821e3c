//! What the user at the window asks for, and as much of it as the window does itself.

use std::path::PathBuf;

use armature_rig::{CalibrationStep, PartUid};
use armature_take::Edit;

use super::controls::Controls;
use super::desk::ExportForm;
use super::state::{Connection, Listed, Overlay, State};
use crate::engine::command::{CharacterChoice, Command};
use crate::engine::event::Problem;
use crate::engine::playback::Play;
use crate::takes::orders::ExportOrder;

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
    /// Put the take being recorded, or the last one, into the bin and start another.
    RecordAgain,
    /// How long to wait before a take begins, seconds.
    Countdown(u8),
    /// Look at the folder of takes.
    ListTakes,
    /// Open a take.
    OpenTake(PathBuf),
    /// Show the puppet again.
    CloseTake,
    /// Play or pause.
    TogglePlay,
    /// Go to the next or the former pose.
    Step {
        /// Whether to the next one.
        forward: bool,
    },
    /// Go to the start or the end.
    GoTo {
        /// Whether to the end.
        end: bool,
    },
    /// Begin again at the end, or not.
    ToggleLoop,
    /// Move the playhead, or change how it moves.
    Play(Play),
    /// The in point is here.
    SetIn,
    /// The out point is here.
    SetOut,
    /// Without in and out points.
    ClearRange,
    /// A marker is here.
    Mark,
    /// Keep only what is between the in and the out point.
    Trim,
    /// Take the last edit of the open take back.
    UndoEdit,
    /// Bring an edit back that was taken back.
    RedoEdit,
    /// Record a bone and what is below it over the open take, or not.
    Arm(String),
    /// Keep a note and a rating of a take.
    Annotate {
        /// Its file.
        take: PathBuf,
        /// The note.
        note: String,
        /// 0 for none.
        rating: u8,
    },
    /// Put a take into the bin.
    Discard(PathBuf),
    /// Put the open take into the bin.
    DiscardOpen,
    /// Take one out of it.
    Restore(PathBuf),
    /// Ask how to export the open take.
    ShowExport,
    /// Write it.
    Export(ExportOrder),
    /// Show a folder in the system's file manager.
    ShowFolder(PathBuf),
    /// List joints or takes on the left.
    List(Listed),
    /// Close the card of the last export.
    DismissExported,
    /// Close the card of the take in the bin.
    DismissDiscarded,
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
            Action::Record => self.can_record().is_ok().then(|| self.begin_to_record()),
            Action::StopRecording => self.recording.is_some().then_some(Command::StopRecording),
            Action::Load(choice) => self.can_change_character().is_ok().then_some(Command::LoadCharacter(choice)),
            Action::Blink(uid) => self.is_live().then_some(Command::Blink(uid)),
            Action::Cancel => (self.busy.is_some() || self.desk.counting.is_some()).then_some(Command::Cancel),
            action => self.act_on_takes(action),
        }
    }

    /// At once or after a countdown, alone or over the open take.
    fn begin_to_record(&self) -> Command {
        let bones: Vec<String> = self.desk.armed.iter().cloned().collect();
        match self.desk.countdown {
            _ if self.desk.open.is_some() && !bones.is_empty() => Command::Overdub { bones },
            0 => Command::StartRecording,
            seconds => Command::RecordAfter(f64::from(seconds)),
        }
    }

    fn act_on_takes(&mut self, action: Action) -> Option<Command> {
        let now = self.desk.playback.seconds;
        match action {
            Action::RecordAgain => self.live().is_ok().then_some(Command::RecordAgain),
            Action::ListTakes => Some(Command::ListTakes),
            Action::OpenTake(path) => self.can_open().is_ok().then_some(Command::OpenTake(path)),
            Action::CloseTake => self.desk.open.is_some().then_some(Command::CloseTake),
            Action::TogglePlay => self.play(if self.desk.playback.playing { Play::Pause } else { Play::Start }),
            Action::Step { forward } => self.play(Play::Step { forward }),
            Action::GoTo { end } => {
                let (first, last) = self.desk.open.as_ref()?.span();
                let (from, to) = self.desk.playback.range.unwrap_or((first, last));
                self.play(Play::Seek(if end { to } else { from }))
            }
            Action::ToggleLoop => self.play(Play::Loop(!self.desk.playback.looping)),
            Action::Play(play) => self.play(play),
            Action::SetIn => self.play(Play::Range(self.desk.range_with(Some(now), None))),
            Action::SetOut => self.play(Play::Range(self.desk.range_with(None, Some(now)))),
            Action::ClearRange => self.play(Play::Range(None)),
            Action::Mark => {
                self.can_edit().ok()?;
                let number = self.desk.open.as_ref()?.markers.len() + 1;
                let text = format!("Marker {number}");
                self.desk.with(Edit::Marker { at: now, text }).map(Command::EditTake)
            }
            Action::Trim => {
                self.can_trim().ok()?;
                let (from, to) = self.desk.playback.range?;
                self.desk.with(Edit::Trim { from, to }).map(Command::EditTake)
            }
            Action::UndoEdit => self.can_undo().ok().and_then(|()| self.desk.without_last()).map(Command::EditTake),
            Action::RedoEdit => self.can_redo().ok().and_then(|()| self.desk.with_undone()).map(Command::EditTake),
            Action::Annotate { take, note, rating } => Some(Command::Annotate { take, note, rating }),
            Action::Discard(path) => Some(Command::Discard(path)),
            Action::DiscardOpen => {
                self.can_edit().ok()?;
                self.desk.open.as_ref().map(|open| Command::Discard(open.path.clone()))
            }
            Action::Restore(path) => Some(Command::Restore(path)),
            Action::Export(order) => Some(Command::Export(order)),
            action => {
                self.act_alone(action);
                None
            }
        }
    }

    fn play(&self, play: Play) -> Option<Command> {
        self.can_play().is_ok().then_some(Command::Play(play))
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
            Action::Back if self.desk.export.is_some() => self.desk.export = None,
            Action::Back => self.selected = None,
            Action::Explain(why) => self.explanation = Some(why),
            Action::Report(problem) => self.note(problem, false),
            Action::DismissNotice(index) => self.dismiss_notice(index),
            Action::DismissZeroed => self.zeroed = None,
            Action::DismissSaved => self.saved = None,
            Action::DismissExported => self.desk.exported = None,
            Action::DismissDiscarded => self.desk.discarded = None,
            Action::Countdown(seconds) => self.desk.countdown = seconds,
            Action::Arm(bone) if !self.desk.armed.remove(&bone) => {
                self.desk.armed.insert(bone);
            }
            Action::ShowExport => {
                let has_range = self.desk.playback.range.is_some();
                self.desk.export = self.desk.open.as_ref().map(|open| ExportForm::new(open.path.clone(), has_range));
            }
            Action::ShowFolder(folder) => self.wishes.folder = Some(folder),
            Action::List(listed) => self.listed = listed,
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

    /// Whether a take may be opened.
    pub fn can_open(&self) -> Result<(), &'static str> {
        self.not_recording()
    }

    /// Whether there is a take to play.
    pub fn can_play(&self) -> Result<(), &'static str> {
        if self.desk.open.is_none() { Err("Open a take first") } else { self.not_recording() }
    }

    /// Whether the open take can be edited.
    pub fn can_edit(&self) -> Result<(), &'static str> {
        self.can_play()
    }

    /// Whether there is a part of the open take to keep.
    pub fn can_trim(&self) -> Result<(), &'static str> {
        self.can_edit()?;
        self.desk.playback.range.map(|_| ()).ok_or("Set an in and an out point first")
    }

    /// Whether an edit can be taken back.
    pub fn can_undo(&self) -> Result<(), &'static str> {
        self.can_edit()?;
        if self.desk.can_undo() { Ok(()) } else { Err("The open take has no edit") }
    }

    /// Whether an edit can be brought back.
    pub fn can_redo(&self) -> Result<(), &'static str> {
        self.can_edit()?;
        if self.desk.can_redo() { Ok(()) } else { Err("No edit was taken back") }
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
