//! What can be asked of the engine.

use std::path::PathBuf;

use armature_rig::{CalibrationStep, PartUid, Target, TargetPoint};
use armature_take::{EditList, Header};

use super::playback::Play;
use crate::characters::OWN;
use crate::characters::shapes::ShapeWeight;
use crate::files::Overwrite;
use crate::takes::orders::ExportOrder;

/// What the window or a subcommand asks of the engine.
#[derive(Clone, Debug, PartialEq)]
pub enum Command {
    /// Connect to a device address, as given to `--device`. An open connection is closed first.
    Connect(String),
    /// Close the connection; a recording is finished and saved first.
    Disconnect,
    /// Look for serial ports; answered by [`EngineEvent::Devices`](super::event::EngineEvent::Devices).
    ListDevices,
    /// The puppet is in its rest pose now: make this zero.
    Zero,
    /// Start a calibration step: [`Calibrating`](super::event::EngineEvent::Calibrating) says what the user has to do,
    /// [`Calibrated`](super::event::EngineEvent::Calibrated) reports the result.
    Calibrate(CalibrationStep),
    /// Do these calibration steps one after the other as soon as samples arrive; ends with
    /// [`CalibrationOver`](super::event::EngineEvent::CalibrationOver).
    CalibrateAll(Vec<CalibrationStep>),
    /// Perform by this plan as soon as the puppet is there; ends with [`RunOver`](super::event::EngineEvent::RunOver),
    /// after which there is no connection.
    Run(Box<RunPlan>),
    /// Start a take; the engine chooses the file's name.
    StartRecording,
    /// Finish the take; answered by [`Saved`](super::event::EngineEvent::Saved).
    StopRecording,
    /// Start a take after this many seconds; without any, at once.
    RecordAfter(f64),
    /// Put the take that is being recorded into the bin, or else the last one, and start another.
    RecordAgain,
    /// Record these bones, each with everything below it, over the open take while it plays; what comes of it is an edit
    /// of that take.
    Overdub {
        /// Their names.
        bones: Vec<String>,
    },
    /// Look at the folder of takes; answered by [`Takes`](super::event::EngineEvent::Takes).
    ListTakes,
    /// Open a take and show it in place of the puppet; answered by
    /// [`TakeOpened`](super::event::EngineEvent::TakeOpened).
    OpenTake(PathBuf),
    /// Show the puppet again.
    CloseTake,
    /// Play the open take.
    Play(Play),
    /// Replace the edits of the open take, and save them beside it.
    EditTake(EditList),
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
    /// Take one out of it.
    Restore(PathBuf),
    /// Write a take for another program; answered by [`Exported`](super::event::EngineEvent::Exported).
    Export(ExportOrder),
    /// Make or read a character and show it.
    LoadCharacter(CharacterChoice),
    /// Blend the character towards one of its shapes. Takes do not hold this.
    SetShape(ShapeWeight),
    /// Drag a point of the character to a place in the world from the next sample on, besides what the puppet does; where it
    /// has a target already, this one replaces it. A take records it.
    SetTarget {
        /// Where to.
        target: Target,
        /// Over how long it goes there from where it is, microseconds of the device's clock; 0 for a hand that moves it
        /// itself.
        over_micros: u32,
    },
    /// Let a point go that was dragged.
    ReleaseTarget {
        /// Which.
        point: TargetPoint,
        /// Over how long the character goes back, microseconds of the device's clock.
        over_micros: u32,
    },
    /// Cancel the work in progress: loading a character, a calibration step, work on takes, a countdown.
    Cancel,
    /// Make one part blink, so that it can be found by hand.
    Blink(PartUid),
    /// Finish what is in progress (a recording, a run), close the connection, end the engine.
    Quit,
}

/// Which character to show.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CharacterChoice {
    /// A built-in one, by its name among [`OWN`].
    BuiltIn(&'static str),
    /// A rigged or unrigged mesh file.
    File(PathBuf),
}

impl CharacterChoice {
    /// The character meant by a name or path on the command line.
    pub fn named(source: &str) -> Self {
        let built_in = OWN.iter().find(|&&name| name == source);
        built_in.map_or_else(|| Self::File(source.into()), |name| Self::BuiltIn(name))
    }

    /// Its name or path on the command line.
    pub fn source(&self) -> String {
        match self {
            Self::BuiltIn(name) => (*name).into(),
            Self::File(path) => path.display().to_string(),
        }
    }
}

impl Default for CharacterChoice {
    fn default() -> Self {
        Self::BuiltIn(OWN[0])
    }
}

/// A run: from the first hello to the finished take.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RunPlan {
    /// For how long, in seconds from the first pose after zeroing; without it, until the engine quits.
    pub seconds: Option<f64>,
    /// The take.
    pub record: Option<PathBuf>,
    /// Whether an existing take of this name may be replaced.
    pub overwrite: Overwrite,
    /// The take's header.
    pub header: Header,
}
