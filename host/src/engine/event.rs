//! What the engine reports: everything there is to see of a session.

use std::path::PathBuf;
use std::sync::Arc;

use armature_rig::{CalibrationStep, JointTree, Progress, SensorState, StepReport};

use super::playback::Playback;
use super::run_summary::RunSummary;
use crate::characters::LoadedCharacter;
use crate::failure::Failure;
use crate::takes::library::Library;
use crate::takes::opened::OpenedTake;
use crate::takes::orders::ExportReceipt;

/// What the engine reports.
#[derive(Clone, Debug)]
pub enum EngineEvent {
    /// A connection is being made.
    Connecting {
        /// The device address.
        address: String,
    },
    /// The line is open; the puppet has not sent anything yet.
    LineOpened {
        /// The line itself; for a simulated puppet, where its process serves it.
        line: String,
        /// The process ID of a simulated puppet.
        process: Option<u32>,
    },
    /// The handshake succeeded.
    Connected {
        /// The device address.
        address: String,
        /// What the device calls itself, firmware and protocol version: one line for display.
        device: String,
    },
    /// The line is broken: no samples arrive until [`LineRestored`](Self::LineRestored). A problem that says why
    /// precedes it.
    LineBroken,
    /// The line is back.
    LineRestored,
    /// There is no connection, or no longer.
    Disconnected {
        /// Why, unless it was requested.
        problem: Option<Problem>,
    },
    /// The puppet as it is plugged together now; sent again whenever a part is plugged in or unplugged.
    Topology {
        /// Parts and sensors; [`Frame::angles`] and [`Frame::states`] are in its sensor order.
        tree: Arc<JointTree>,
    },
    /// Which bone follows which part; sent again with a new topology or character.
    Mapping {
        /// One entry per part: index of the bone in the character's skeleton.
        bone_of_part: Vec<Option<usize>>,
        /// For each bone of the skeleton, whether inverse kinematics turns it; empty if it is off.
        solved: Vec<bool>,
    },
    /// The newest pose.
    Frame(Box<Frame>),
    /// The next good sample will be taken as the rest pose.
    RestPoseAwaited,
    /// Zero was taken.
    Zeroed {
        /// How many sensors have a zero now.
        sensors: usize,
        /// How many sensors could not be zeroed because they gave no good reading.
        unreadable: usize,
    },
    /// A calibration step is in progress; sent again with every second and every instruction.
    Calibrating {
        /// The step.
        step: CalibrationStep,
        /// Its progress; never [`Progress::Over`].
        progress: Progress,
    },
    /// A calibration step is over.
    Calibrated {
        /// The step.
        step: CalibrationStep,
        /// Sensors or parts that it measured.
        measured: usize,
        /// Those it could not measure; they keep their earlier values.
        failed: usize,
    },
    /// All the steps of [`Command::CalibrateAll`](super::command::Command::CalibrateAll) are over, with one report
    /// each, or one of them failed.
    CalibrationOver(Result<Vec<StepReport>, Failure>),
    /// A take is being written.
    Recording {
        /// Device time since the take began.
        seconds: f64,
        /// Samples written.
        samples: u64,
    },
    /// A take is complete on disk.
    Saved {
        /// The file.
        path: PathBuf,
        /// Its length.
        seconds: f64,
        /// Samples in it.
        samples: u64,
        /// Samples that never arrived meanwhile.
        lost: u64,
    },
    /// A take could not be written to its end; what is in the file until then can be read. The session goes on.
    RecordingFailed(Problem),
    /// A take begins in this many seconds; 0: not any more.
    Countdown {
        /// How long yet.
        seconds_left: u32,
    },
    /// The takes of the folder.
    Takes(Arc<Library>),
    /// A take is shown in place of the puppet; sent again when its edits change.
    TakeOpened(Arc<OpenedTake>),
    /// The puppet is shown again.
    TakeClosed,
    /// Where the open take is.
    Playback(Playback),
    /// A take is in the bin.
    Discarded {
        /// Where it lies.
        path: PathBuf,
    },
    /// A take was written for another program.
    Exported(ExportReceipt),
    /// A run is over. An error: there is no result. Trouble along the way (such as an unplugged cable) ends a run too,
    /// but the take up to there is finished and safe, and in the summary.
    RunOver(Box<Result<RunSummary, Failure>>),
    /// The character to draw from now on; later frames belong to it.
    CharacterLoaded(Arc<LoadedCharacter>),
    /// The serial ports (and other devices) found.
    Devices(Vec<FoundDevice>),
    /// Work in progress.
    Busy {
        /// What, in plain words: "Computing weights".
        task: String,
        /// How much is done, 0 to 1, if known.
        fraction: Option<f32>,
    },
    /// The work is over.
    Idle,
    /// Something went wrong; the session continues.
    Problem(Problem),
    /// Why the puppet does not answer yet; true until the next [`Connected`](Self::Connected).
    Waiting(Problem),
}

/// What went wrong and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Problem {
    /// One sentence: "The puppet stopped answering."
    pub what: String,
    /// One sentence: "Check the cable, then connect again."
    pub remedy: String,
}

impl Problem {
    /// A sentence that itself says what to do.
    pub fn of(what: &dyn std::fmt::Display) -> Self {
        Self { what: what.to_string(), remedy: String::new() }
    }
}

impl From<&Failure> for Problem {
    fn from(failure: &Failure) -> Self {
        Self { what: failure.what.clone(), remedy: failure.remedy.clone() }
    }
}

/// A device that can be connected to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundDevice {
    /// For [`Command::Connect`](super::command::Command::Connect).
    pub address: String,
    /// Product name or similar.
    pub label: String,
}

/// One moment of the puppet and the character. Buffers are kept and reused: see
/// [`Shell::frame_buffer`](super::input::Shell::frame_buffer).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// n skinned positions in model space (empty: the rest positions).
    pub positions: Vec<[f32; 3]>,
    /// n skinned unit normals.
    pub normals: Vec<[f32; 3]>,
    /// Head and tail of every bone in model space.
    pub bones: Vec<([f32; 3], [f32; 3])>,
    /// Calibrated angle of every sensor in radians; meaningless if the state is `NoData`.
    pub angles: Vec<f32>,
    /// State of every sensor.
    pub states: Vec<SensorState>,
    /// How well the stream is doing.
    pub stats: Stats,
}

/// Counters since the connection was made; rates and percentiles over about the last second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stats {
    /// Samples per second.
    pub samples_per_second: f32,
    /// Samples received.
    pub samples: u64,
    /// Samples that never arrived, by their sequence numbers.
    pub lost_samples: u64,
    /// Frames discarded because of their checksum.
    pub crc_errors: u64,
    /// Pieces of the stream that were not frames; decoding continued with the next frame.
    pub resyncs: u64,
    /// From the last byte of a sample to the skinned character: median.
    pub latency_p50_micros: f32,
    /// The same, 99th percentile.
    pub latency_p99_micros: f32,
}
