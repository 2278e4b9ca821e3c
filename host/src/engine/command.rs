//! What can be asked of the engine.

use std::path::PathBuf;

use armature_rig::{CalibrationStep, PartUid};
use armature_take::Header;

use crate::characters::OWN;
use crate::characters::shapes::ShapeWeight;
use crate::files::Overwrite;

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
    /// Make or read a character and show it.
    LoadCharacter(CharacterChoice),
    /// Blend the character towards one of its shapes. Takes do not hold this.
    SetShape(ShapeWeight),
    /// Cancel the work in progress: loading a character, or a calibration step.
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
