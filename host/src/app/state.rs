//! Everything the window knows, and the single function that updates it with the engine's events.
//!
//! No drawing, no clock, no files: tests drive it with a list of events.

use std::path::PathBuf;
use std::sync::Arc;

use armature_rig::{CalibrationStep, JointAxis, JointTree, PartKind, Progress, SensorState};

use super::controls::Controls;
use super::desk::Desk;
use crate::characters::LoadedCharacter;
use crate::engine::command::CharacterChoice;
use crate::engine::event::{EngineEvent, FoundDevice, Frame, Problem};

/// Most problems shown at once; older ones are dropped.
const NOTICES_SHOWN: usize = 3;

/// Whether a puppet is connected.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Connection {
    /// No.
    #[default]
    Off,
    /// Being connected.
    Connecting {
        /// Device address.
        address: String,
    },
    /// Yes.
    On {
        /// Device address.
        address: String,
        /// What it calls itself.
        device: String,
    },
}

/// A problem on display.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// What happened, and the remedy.
    pub problem: Problem,
    /// How often it occurred.
    pub count: u32,
    /// Whether it disappears as soon as a new connection is tried.
    about_connection: bool,
}

/// A finished take.
#[derive(Clone, Debug, PartialEq)]
pub struct SavedTake {
    /// The file.
    pub path: PathBuf,
    /// Its length.
    pub seconds: f64,
    /// Samples in it.
    pub samples: u64,
    /// Samples that never arrived.
    pub lost: u64,
}

/// A zero that was taken, or another calibration step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Zeroed {
    /// Increases with every zero taken in this window.
    pub number: u64,
    /// What was calibrated.
    pub step: CalibrationStep,
    /// Sensors that have a zero now.
    pub sensors: usize,
    /// Sensors that gave no good reading.
    pub unreadable: usize,
}

/// What is listed on the left.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Listed {
    /// The puppet's joints.
    #[default]
    Joints,
    /// The takes of the folder.
    Takes,
}

/// What can lie over the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overlay {
    /// A field to find commands in.
    Palette,
    /// All shortcuts.
    Shortcuts,
}

/// What only the view can do; it takes them when it is drawn.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Wishes {
    /// Show the whole character.
    pub frame_all: bool,
    /// Ask for a file with a character.
    pub open_character: bool,
    /// Show this folder in the system's file manager.
    pub folder: Option<PathBuf>,
}

/// One line of the joint list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PartRow {
    /// Index into the joint tree.
    pub part: usize,
    /// Number of splitters between it and the root: a limb stays one straight list.
    pub depth: usize,
}

/// Everything the window knows.
#[derive(Debug)]
pub struct State {
    /// Whether a puppet is connected.
    pub connection: Connection,
    /// The text in the address field.
    pub address: String,
    /// Serial ports found.
    pub devices: Vec<FoundDevice>,
    /// The puppet.
    pub tree: Option<Arc<JointTree>>,
    /// Its parts in the order of the list.
    pub rows: Vec<PartRow>,
    /// Bone of every part; may be shorter than the tree.
    pub bone_of_part: Vec<Option<usize>>,
    /// Bones that inverse kinematics turns; shorter than the skeleton if it is off.
    pub solved: Vec<bool>,
    /// The newest pose.
    pub frame: Option<Box<Frame>>,
    /// Increases with every frame.
    pub frame_number: u64,
    /// What is drawn.
    pub character: Option<Arc<LoadedCharacter>>,
    /// Increases with every character.
    pub character_number: u64,
    /// Which character that is.
    pub choice: CharacterChoice,
    /// Seconds and samples of the take being recorded.
    pub recording: Option<(f64, u64)>,
    /// The last take.
    pub saved: Option<SavedTake>,
    /// The last zero.
    pub zeroed: Option<Zeroed>,
    /// Work in progress: what, and how much is done.
    pub busy: Option<(String, Option<f32>)>,
    /// Problems, newest last.
    pub notices: Vec<Notice>,
    /// Selected part.
    pub selected: Option<usize>,
    /// Whether bones are drawn.
    pub show_bones: bool,
    /// Whose habits mouse and keys follow.
    pub controls: Controls,
    /// What lies over the window.
    pub overlay: Option<Overlay>,
    /// Why the last thing asked for could not be done.
    pub explanation: Option<&'static str>,
    /// What the view is asked for.
    pub wishes: Wishes,
    /// Everything about takes.
    pub desk: Desk,
    /// What is listed on the left.
    pub listed: Listed,
    /// Whether the pose belongs to the puppet connected now, not to an earlier one.
    posed: bool,
    line_broken: bool,
    zeros: u64,
}

impl Default for State {
    fn default() -> Self {
        Self {
            connection: Connection::Off,
            address: "sim:human".into(),
            devices: Vec::new(),
            tree: None,
            rows: Vec::new(),
            bone_of_part: Vec::new(),
            solved: Vec::new(),
            frame: None,
            frame_number: 0,
            character: None,
            character_number: 0,
            choice: CharacterChoice::default(),
            recording: None,
            saved: None,
            zeroed: None,
            busy: None,
            notices: Vec::new(),
            selected: None,
            show_bones: true,
            controls: Controls::default(),
            overlay: None,
            explanation: None,
            wishes: Wishes::default(),
            desk: Desk::default(),
            listed: Listed::default(),
            posed: false,
            line_broken: false,
            zeros: 0,
        }
    }
}

impl State {
    /// Applies one event. Returns the frame that is no longer shown, for reuse.
    pub fn update_state(&mut self, event: EngineEvent) -> Option<Box<Frame>> {
        self.desk.update(&event);
        match event {
            EngineEvent::Frame(frame) => {
                self.frame_number += 1;
                // What a take shows says nothing of the puppet.
                self.posed |= self.desk.open.is_none();
                return self.frame.replace(frame);
            }
            EngineEvent::Connecting { address } => {
                self.notices.retain(|notice| !notice.about_connection);
                self.forget_puppet();
                self.connection = Connection::Connecting { address };
            }
            EngineEvent::LineBroken => self.line_broken = true,
            EngineEvent::LineRestored => self.line_broken = false,
            EngineEvent::Connected { address, device } => {
                self.line_broken = false;
                self.notices.retain(|notice| !notice.about_connection);
                self.connection = Connection::On { address, device };
            }
            EngineEvent::Disconnected { problem } => {
                self.forget_puppet();
                self.connection = Connection::Off;
                if let Some(problem) = problem {
                    self.note(problem, true);
                }
            }
            EngineEvent::Topology { tree } => {
                self.rows = rows(&tree);
                self.selected = self.selected_in(&tree);
                self.tree = Some(tree);
            }
            EngineEvent::Mapping { bone_of_part, solved } => (self.bone_of_part, self.solved) = (bone_of_part, solved),
            EngineEvent::Zeroed { sensors, unreadable } => {
                self.zeros += 1;
                let step = CalibrationStep::Zero;
                self.zeroed = Some(Zeroed { number: self.zeros, step, sensors, unreadable });
            }
            EngineEvent::Calibrating { progress, .. } => self.busy = instruction(progress).map(|task| (task, None)),
            EngineEvent::Calibrated { step, measured, failed } => {
                self.zeros += 1;
                self.zeroed = Some(Zeroed { number: self.zeros, step, sensors: measured, unreadable: failed });
            }
            EngineEvent::Recording { seconds, samples } => {
                self.saved = None;
                self.recording = Some((seconds, samples));
            }
            EngineEvent::Saved { path, seconds, samples, lost } => {
                self.recording = None;
                self.saved = Some(SavedTake { path, seconds, samples, lost });
            }
            EngineEvent::RecordingFailed(problem) => {
                self.recording = None;
                self.update_state(EngineEvent::Problem(problem));
            }
            EngineEvent::CharacterLoaded(character) => {
                self.busy = None;
                self.bone_of_part.clear();
                self.solved.clear();
                self.choice = CharacterChoice::named(&character.source);
                self.character = Some(character);
                self.character_number += 1;
                self.frame_number += 1;
                // The angles are still true; the positions are those of another mesh.
                if let Some(frame) = &mut self.frame {
                    frame.positions.clear();
                    frame.normals.clear();
                    frame.bones.clear();
                }
            }
            EngineEvent::Devices(devices) => self.devices = devices,
            EngineEvent::Busy { task, fraction } => self.busy = Some((task, fraction)),
            EngineEvent::Idle => self.busy = None,
            EngineEvent::Problem(problem) => self.note(problem, false),
            EngineEvent::Waiting(problem) => self.note(problem, true),
            // Events that a window does not ask for, and the opening of a line, which the handshake describes better.
            EngineEvent::LineOpened { .. }
            | EngineEvent::RestPoseAwaited
            | EngineEvent::RunOver(_)
            | EngineEvent::CalibrationOver(_)
            // The desk has them.
            | EngineEvent::Takes(_)
            | EngineEvent::TakeClosed
            | EngineEvent::Playback(_)
            | EngineEvent::Countdown { .. }
            | EngineEvent::Discarded { .. }
            | EngineEvent::Exported(_) => {}
            EngineEvent::TakeOpened(_) => self.listed = Listed::Takes,
        }
        None
    }

    /// A connection to this address is being made.
    pub(super) fn is_connecting_to(&mut self, address: String) {
        self.connection = Connection::Connecting { address };
        self.notices.retain(|notice| !notice.about_connection);
    }

    /// Closes a problem's card.
    pub(super) fn dismiss_notice(&mut self, index: usize) {
        if index < self.notices.len() {
            self.notices.remove(index);
        }
    }

    /// The engine has ended: nothing asked for now will happen.
    pub fn engine_is_gone(&mut self) {
        self.forget_puppet();
        self.connection = Connection::Off;
        self.busy = None;
        let problem = Problem {
            what: "The engine of this program has stopped.".into(),
            remedy: "Close the window and start armature again; takes are safe on disk.".into(),
        };
        self.note(problem, false);
    }

    /// Whether poses arrive.
    pub fn is_live(&self) -> bool {
        matches!(self.connection, Connection::On { .. }) && self.posed && !self.line_broken
    }

    /// Whether the line is broken and expected back.
    pub fn is_line_broken(&self) -> bool {
        matches!(self.connection, Connection::On { .. }) && self.line_broken
    }

    /// Whether this is the character on screen.
    pub fn shows(&self, choice: &CharacterChoice) -> bool {
        self.character.is_some() && self.choice == *choice
    }

    /// State and angle (radians, `None` without data) of a sensor.
    pub fn reading(&self, sensor: usize) -> (SensorState, Option<f32>) {
        let Some(frame) = self.frame.as_ref().filter(|_| self.posed) else { return (SensorState::NoData, None) };
        let state = frame.states.get(sensor).copied().unwrap_or_default();
        let angle = frame.angles.get(sensor).copied().filter(|angle| angle.is_finite());
        if state == SensorState::NoData { (state, None) } else { (state, angle) }
    }

    /// The bone that follows a part.
    pub fn bone(&self, part: usize) -> Option<usize> {
        let bone = self.bone_of_part.get(part).copied().flatten()?;
        (bone < self.character.as_ref()?.skeleton.len()).then_some(bone)
    }

    /// Name of the bone that follows a part.
    pub fn bone_name(&self, part: usize) -> Option<&str> {
        let bone = self.bone(part)?;
        self.character.as_ref()?.skeleton.bones().get(bone).map(|bone| bone.name.as_str())
    }

    /// A part's name in the list: that of its bone (with the axis, if several parts move it), or its kind.
    pub fn part_label(&self, part: usize) -> String {
        if let (Some(name), Some(bone)) = (self.bone_name(part), self.bone(part)) {
            let shared = self.parts_of_bone(bone).nth(1).is_some();
            let axes = self.tree.as_ref().and_then(|tree| tree.parts().get(part)).map_or(&[][..], |p| p.kind.axes());
            return match axes {
                [axis] if shared => format!("{name} {}", axis_label(*axis).to_lowercase()),
                _ => name.to_owned(),
            };
        }
        self.tree
            .as_ref()
            .and_then(|tree| tree.parts().get(part))
            .map_or_else(String::new, |part| kind_label(part.kind))
    }

    /// Whether inverse kinematics turns a bone.
    pub fn is_solved(&self, bone: usize) -> bool {
        self.solved.get(bone).copied().unwrap_or(false)
    }

    /// The parts that a bone follows.
    pub fn parts_of_bone(&self, bone: usize) -> impl Iterator<Item = usize> + '_ {
        self.bone_of_part.iter().enumerate().filter(move |(_, b)| **b == Some(bone)).map(|(part, _)| part)
    }

    /// The worst state among the parts that a bone follows; `None` if it follows none. In a take every joint counts as
    /// good: what it missed is on the timeline.
    pub fn bone_state(&self, bone: usize) -> Option<SensorState> {
        if let Some(take) = &self.desk.open {
            return take.driven.get(bone).copied().unwrap_or(false).then_some(SensorState::Ok);
        }
        self.parts_of_bone(bone).map(|part| self.worst_state(part)).max_by_key(|state| severity(*state))
    }

    /// The worst state among a part's sensors; `Ok` for a part without sensors.
    pub fn worst_state(&self, part: usize) -> SensorState {
        let Some(tree) = &self.tree else { return SensorState::NoData };
        tree.sensors(part)
            .map(|sensor| self.reading(sensor).0)
            .max_by_key(|state| severity(*state))
            .unwrap_or(SensorState::Ok)
    }

    fn forget_puppet(&mut self) {
        self.posed = false;
        self.line_broken = false;
        self.tree = None;
        self.rows.clear();
        self.bone_of_part.clear();
        self.solved.clear();
        self.selected = None;
        self.recording = None;
        self.zeroed = None;
    }

    /// Shows a problem. `about_connection`: until the next one is tried.
    pub(super) fn note(&mut self, problem: Problem, about_connection: bool) {
        if let Some(index) = self.notices.iter().position(|notice| notice.problem == problem) {
            let mut notice = self.notices.remove(index);
            notice.count += 1;
            self.notices.push(notice);
            return;
        }
        self.notices.push(Notice { problem, count: 1, about_connection });
        if self.notices.len() > NOTICES_SHOWN {
            self.notices.remove(0);
        }
    }

    /// The selected part keeps its number wherever it is plugged in now.
    fn selected_in(&self, new: &JointTree) -> Option<usize> {
        let part = self.tree.as_ref()?.parts().get(self.selected?)?;
        new.find(part.uid)
    }
}

/// What the user has to do during a calibration step, and for how long.
fn instruction(progress: Progress) -> Option<String> {
    let (words, left, instruction) = match progress {
        Progress::Countdown { seconds_left, instruction } => ("Get ready", seconds_left, instruction),
        Progress::Measuring { seconds_left, instruction } => ("Measuring", seconds_left, instruction),
        Progress::Over => return None,
    };
    Some(format!("{words}, {:.0} s: {instruction}", left.ceil()))
}

/// How little a reading can be trusted.
fn severity(state: SensorState) -> u8 {
    match state {
        SensorState::Ok => 0,
        SensorState::MagnetWeak => 1,
        SensorState::Outlier => 2,
        SensorState::NoData => 3,
    }
}

/// A part's kind, in words.
pub fn kind_label(kind: PartKind) -> String {
    match kind {
        PartKind::Bend => "Bend joint".into(),
        PartKind::Twist => "Twist joint".into(),
        PartKind::TwistBendTwist => "Three-axis joint".into(),
        PartKind::Splitter { outlets: 1 } => "Splitter, 1 outlet".into(),
        PartKind::Splitter { outlets } => format!("Splitter, {outlets} outlets"),
    }
}

/// What a sensor measures, in words.
pub fn axis_label(axis: JointAxis) -> &'static str {
    match axis {
        JointAxis::Bend => "Bend",
        JointAxis::Twist => "Twist",
    }
}

/// A sensor's state, in words.
pub fn state_label(state: SensorState) -> &'static str {
    match state {
        SensorState::Ok => "good",
        SensorState::NoData => "no data",
        SensorState::MagnetWeak => "weak magnet",
        SensorState::Outlier => "outlier",
    }
}

/// Every part after the one it is plugged into, limb by limb.
fn rows(tree: &JointTree) -> Vec<PartRow> {
    let mut rows = Vec::with_capacity(tree.parts().len());
    let roots = (0..tree.parts().len()).filter(|&part| tree.parts()[part].parent.is_none());
    let mut open: Vec<PartRow> = roots.map(|part| PartRow { part, depth: 0 }).collect();
    open.reverse();
    while let Some(row) = open.pop() {
        rows.push(row);
        let splits = matches!(tree.parts()[row.part].kind, PartKind::Splitter { .. });
        let depth = row.depth + usize::from(splits);
        open.extend(tree.children(row.part).into_iter().rev().map(|part| PartRow { part, depth }));
    }
    rows
}
