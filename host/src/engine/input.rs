//! Everything that can happen to the engine, and everything it asks of the world around it.
//!
//! Times are seconds of the engine's clock, which the driver keeps: a real one, or a virtual one.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use armature_device::{Event, PartUid, SessionCounters};
use armature_rig::{Calibration, PuppetHints, ShapeWeights};
use glam::Affine3A;

use super::command::Command;
use super::event::{EngineEvent, FoundDevice, Frame, Problem};
use crate::characters::LoadedCharacter;
use crate::failure::Failure;
use crate::files::{GrowingFile, Overwrite};
use crate::takes::orders::{TakeOrder, TakeResult};

/// Everything that can happen to the engine. A recorded list of inputs and their times replays a whole session.
#[derive(Clone, Debug)]
pub enum Input {
    /// Someone asks for something.
    Command(Command),
    /// News from a line to a puppet.
    Device {
        /// Which line.
        line: LineId,
        /// What its session has counted so far.
        counters: SessionCounters,
        /// The news.
        news: LineNews,
    },
    /// A character that was asked for.
    Loaded {
        /// By which [`Request::Load`]; [`LoadId::BROUGHT_ALONG`] if none.
        load: LoadId,
        /// Its progress or result.
        news: LoadNews,
    },
    /// The result of [`Request::Connect`].
    Connected {
        /// Which line.
        line: LineId,
        /// The open line.
        outcome: Result<OpenLine, Failure>,
    },
    /// Progress or result of [`Request::Work`].
    Worked {
        /// Which work.
        work: WorkId,
        /// Its progress or result.
        news: WorkNews,
    },
    /// The result of [`Request::ListDevices`].
    Listed(Result<Vec<FoundDevice>, Failure>),
    /// Time has passed.
    Tick,
}

/// Numbers the engine's lines, so that late news of an abandoned one is not attributed to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LineId(pub u32);

/// Numbers the characters that the engine asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadId(pub u32);

impl LoadId {
    /// A character that was not asked for, such as a subcommand's.
    pub const BROUGHT_ALONG: Self = Self(0);
}

/// Numbers the work on takes that the engine asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WorkId(pub u32);

/// Progress of work on takes.
#[derive(Clone, Debug)]
pub enum WorkNews {
    /// In progress.
    Progress {
        /// The current stage.
        stage: String,
        /// 0 to 1.
        done: f64,
    },
    /// Over.
    Over(Result<TakeResult, Failure>),
}

/// News from a line.
#[derive(Clone, Debug)]
pub enum LineNews {
    /// An event of the puppet's session.
    Event(Event),
    /// It ended on its own, and every event has been passed on.
    Over,
    /// It is closed, as requested by [`Request::Close`]; there is no more news after this.
    Closed,
}

/// Progress of loading a character.
#[derive(Clone, Debug)]
pub enum LoadNews {
    /// In progress.
    Progress {
        /// The current stage.
        stage: String,
        /// 0 to 1.
        done: f64,
    },
    /// Over: the character, and what the user should know about it, in sentences.
    Over(Result<(Arc<LoadedCharacter>, Vec<String>), Failure>),
}

/// A line that has just been opened.
#[derive(Clone, Debug, Default)]
pub struct OpenLine {
    /// The line itself; for a simulated puppet, where its process serves it.
    pub address: String,
    /// The process ID of a simulated puppet.
    pub process: Option<u32>,
    /// When its session's time was zero.
    pub began: f64,
    /// The saved calibration for this puppet, if there is one or it could not be read; `None` means that the engine's
    /// own settings contain one.
    pub calibration: Option<Result<Calibration, Failure>>,
    /// What is known of the puppet before it describes itself.
    pub hints: PuppetHints,
    /// What the user should know about it.
    pub doubts: Vec<Problem>,
}

/// What the engine asks of the world around it. None of this blocks; answers arrive as [`Input`]s.
#[derive(Clone, Debug, PartialEq)]
pub enum Request {
    /// Open a line to this device; answered by [`Input::Connected`].
    Connect {
        /// The line's number from now on.
        line: LineId,
        /// The device address.
        address: String,
    },
    /// The character is prepared for the puppet as it is plugged together now: samples may start.
    Stream {
        /// On which line.
        line: LineId,
        /// How many per second.
        samples_per_second: f64,
    },
    /// Make a part show itself.
    Blink {
        /// On which line.
        line: LineId,
        /// Which part.
        uid: PartUid,
        /// For how long.
        millis: u16,
    },
    /// Stop the puppet and close the line; answered by [`LineNews::Closed`].
    Close(LineId),
    /// Make or read a character; answered by [`Input::Loaded`].
    Load {
        /// Which one this is.
        load: LoadId,
        /// Its name or path, as on the command line.
        source: String,
    },
    /// Cancel loading a character at its next progress report.
    CancelLoad(LoadId),
    /// Do something with takes on disk; answered by [`Input::Worked`].
    Work {
        /// Which one this is.
        work: WorkId,
        /// What to do.
        order: TakeOrder,
    },
    /// Cancel work on takes at its next progress report.
    CancelWork(WorkId),
    /// Look for devices; answered by [`Input::Listed`].
    ListDevices,
}

/// Where an engine's answers go, and what it needs while working. Nothing here blocks for long.
pub trait Shell {
    /// Receives an event.
    fn tell(&mut self, event: EngineEvent);
    /// Receives a request.
    fn ask(&mut self, request: Request);
    /// Sees each new pose and the weights of shapes. `seconds`: the device's clock.
    fn posed(&mut self, seconds: f64, model_from_bone: &[Affine3A], shapes: &ShapeWeights) {
        let _ = (seconds, model_from_bone, shapes);
    }
    /// How long ago this was, now that the engine has processed it; `None` on a virtual clock.
    fn age(&self, at: f64) -> Option<Duration>;
    /// Whether someone has asked to cancel or quit while the engine works on something long. The command itself arrives
    /// as an [`Input`] afterwards, as always.
    fn is_stopped(&mut self) -> bool {
        false
    }
    /// A frame to fill, with the buffers of an earlier one if there is one.
    fn frame_buffer(&mut self) -> Box<Frame>;
    /// Opens a file for a new take; an existing one is replaced only if the name allows it.
    fn create_take(&mut self, name: TakeName) -> Result<NewTake, Failure>;
    /// Saves a calibration where this line's puppet has its own, if it has one.
    fn keep_calibration(&mut self, line: LineId, calibration: &Calibration) -> Result<(), Failure>;
}

/// How to name a new take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum TakeName {
    /// With this path, in an existing folder.
    Path {
        /// Where.
        path: PathBuf,
        /// Whether an existing file of this name may be replaced.
        overwrite: Overwrite,
    },
    /// After this character, in the user's folder, with a free name.
    After(String),
    /// After this take and in its folder, with a free name.
    Beside(PathBuf),
}

/// An empty file for a take.
#[derive(Debug)]
pub struct NewTake {
    /// Its path.
    pub path: PathBuf,
    /// Where the take is written.
    pub file: Box<dyn TakeFile>,
    /// The wall clock, microseconds since 1970 UTC, if known.
    pub unix_micros: Option<i64>,
}

/// What a take is written to.
pub trait TakeFile: Write + Send {
    /// Makes sure that what was written survives anything that happens to the machine. `succeeded`: it may take the
    /// place of the file that it replaces. Returns where it is, if it did not.
    fn settle(&mut self, succeeded: bool) -> io::Result<Option<PathBuf>>;
}

impl TakeFile for io::BufWriter<GrowingFile> {
    fn settle(&mut self, succeeded: bool) -> io::Result<Option<PathBuf>> {
        self.flush()?;
        self.get_mut().settle(succeeded)
    }
}

impl std::fmt::Debug for dyn TakeFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("TakeFile")
    }
}
