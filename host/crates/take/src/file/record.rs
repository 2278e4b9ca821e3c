//! The contents of a take.

use armature_rig::{Calibration, Dynamics, Ground, JointTree, Mapping, RawSample, Skeleton, TargetChange};

use super::packed_pose::PackedPose;
use super::record_kind::RecordKind;

/// The origin of a take. Nothing here is filled in behind the caller's back: equal input gives equal bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Version of the program that records.
    pub program_version: String,
    /// Name of the character.
    pub character_name: String,
    /// Hash of the character's content, so that a replay can check that it has the same one.
    pub character_hash: [u8; 32],
    /// The sample rate requested from the device, samples per second.
    pub nominal_samples_per_second: Option<f64>,
    /// Seed of a simulated device.
    pub seed: Option<u64>,
    /// Whether time was simulated as well.
    pub virtual_clock: bool,
    /// Wall-clock time of the start, microseconds since 1970-01-01 UTC, if the caller wants it recorded.
    pub unix_micros: Option<i64>,
    /// How bones without a joint were posed; `None`: they stayed in the rest pose.
    pub inverse_kinematics: Option<InverseKinematicsHeader>,
}

/// Records that the character's shape determined bones without a joint. Solving such a take again needs the character.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InverseKinematicsHeader {
    /// Names of the bones that were pinned in place.
    pub pins: Vec<String>,
    /// The bones' preferences, in a notation of the recording program.
    pub preferences: Vec<String>,
    /// The limits of the bones' joints, in a notation of the recording program.
    pub limits: Vec<String>,
    /// How the shape was reduced, in a notation of the recording program; empty for what is usual.
    pub settings: Vec<String>,
}

impl Header {
    /// The lowest minor version of the format that can store this.
    pub(super) fn minor_version(&self) -> u16 {
        self.inverse_kinematics.as_ref().map_or(0, |ik| match (ik.limits.is_empty(), ik.settings.is_empty()) {
            (_, false) => 3,
            (false, true) => 2,
            (true, true) => 1,
        })
    }
}

/// A puppet as plugged together from here on.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Topology {
    /// Samples with this epoch are numbered by this tree.
    pub epoch: u16,
    /// The parts.
    pub tree: JointTree,
}

/// One reading of all sensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The device's sample.
    pub raw: RawSample,
    /// When its last byte arrived, on the host's clock, seconds from a start of the recorder's choosing.
    pub host_receive_seconds: Option<f64>,
}

/// Something that happened to the stream.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// The device's clock at the last sample before it.
    pub device_micros: Option<u64>,
    /// The host's clock, as in [`Sample::host_receive_seconds`].
    pub host_seconds: Option<f64>,
    /// What happened.
    pub kind: EventKind,
}

/// What a device's clock must not do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ClockFault {
    /// It leapt ahead.
    Leapt,
    /// It stood still.
    Stood,
    /// It went back.
    WentBack,
}

/// What can happen to a stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Samples that the device sent and the host never got.
    LostSamples {
        /// How many.
        count: u64,
        /// The last sequence number that arrived before them.
        after_sequence: u32,
    },
    /// Bytes that were not a message.
    Noise {
        /// Frames with a wrong checksum.
        crc_errors: u64,
        /// Bytes skipped between frames.
        discarded_bytes: u64,
    },
    /// The device restarted; its clock and its sequence numbers may start from zero.
    Restart,
    /// The line was lost and came back.
    Reconnect,
    /// Parts were plugged in or out; a [`Topology`] with this epoch follows.
    TopologyChange {
        /// The new epoch.
        epoch: u16,
    },
    /// A note by the user who records.
    Marker {
        /// The note.
        text: String,
    },
    /// Pieces of the stream were not frames, until it was resynchronised after them.
    Resync {
        /// How many pieces.
        count: u64,
    },
    /// The device's clock showed times that cannot be; from here on those of this kind are rejected, or rebuilt from
    /// numbers and host time before they are recorded. Said once a connection and kind.
    ClockFault {
        /// What it did.
        fault: ClockFault,
        /// By how much, microseconds.
        micros: u64,
    },
    /// How long it took from the last byte of a sample until the character was posed, over the samples of the take so
    /// far; only where time was not simulated.
    Posing {
        /// Half of them took no longer, microseconds.
        p50_micros: u32,
        /// 99 of 100 took no longer.
        p99_micros: u32,
        /// The longest.
        max_micros: u32,
    },
}

/// The totals that a cleanly finished take states at its end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Totals {
    /// All records before the end record, header included.
    pub records: u64,
    /// Samples.
    pub samples: u64,
    /// Poses.
    pub poses: u64,
    /// Events.
    pub events: u64,
    /// Bytes before the end record, preamble included.
    pub bytes: u64,
}

impl Totals {
    pub(super) fn count(&mut self, kind: Option<RecordKind>, bytes: u64) {
        self.records += 1;
        self.samples += u64::from(kind == Some(RecordKind::Sample));
        self.poses += u64::from(kind == Some(RecordKind::Pose));
        self.events += u64::from(kind == Some(RecordKind::Event));
        self.bytes += bytes;
    }
}

/// One record between header and end.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// The character's skeleton; once a take, before the first pose.
    Skeleton(Skeleton),
    /// The puppet, from here on.
    Topology(Topology),
    /// What counts mean, from here on; replaces the former calibration as a whole.
    Calibration(Calibration),
    /// Which part drives which bone, from here on; replaces the former mapping as a whole.
    Mapping(Mapping),
    /// One reading.
    Sample(Sample),
    /// One solved pose.
    Pose(PackedPose),
    /// One event.
    Event(Event),
    /// How parts that come back move their bones, from here on.
    Engagement {
        /// Over how long, microseconds of the device's clock.
        micros: u32,
        /// The whole puppet comes back here.
        all: bool,
    },
    /// How joints whose readings were missing take their bones along, from here on.
    ReadingsReturn {
        /// Over how long at most, microseconds of the device's clock; no longer than they were missing.
        micros: u32,
    },
    /// How the roots follow the feet, from here on, beginning anew; `None`: they do not.
    Ground(Option<Ground>),
    /// A blend shape is set by hand, from here on.
    Shape(ShapeSetting),
    /// Which bones swing and how, from here on, beginning anew; `None`: none do.
    Dynamics(Option<Dynamics>),
    /// A point of the character is dragged, or let go, from the next sample on.
    Target(TargetChange),
    /// From here on bones without a joint are posed by inverse kinematics, in a take that began without it.
    InverseKinematics(InverseKinematicsHeader),
}

/// A blend shape that is set by hand. One that a joint drives is set by the mapping instead, with every sample.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeSetting {
    /// The device's clock at the last sample before it.
    pub device_micros: Option<u64>,
    /// Its name in the character.
    pub name: String,
    /// Its weight: 0 is not at all, 1 wholly.
    pub weight: f32,
}

impl Record {
    /// The record's type.
    pub fn kind(&self) -> RecordKind {
        match self {
            Self::Skeleton(_) => RecordKind::Skeleton,
            Self::Topology(_) => RecordKind::Topology,
            Self::Calibration(_) => RecordKind::Calibration,
            Self::Mapping(_) => RecordKind::Mapping,
            Self::Sample(_) => RecordKind::Sample,
            Self::Pose(_) => RecordKind::Pose,
            Self::Event(_) => RecordKind::Event,
            Self::Engagement { .. } => RecordKind::Engagement,
            Self::ReadingsReturn { .. } => RecordKind::ReadingsReturn,
            Self::Ground(_) => RecordKind::Ground,
            Self::Shape(_) => RecordKind::Shape,
            Self::Dynamics(_) => RecordKind::Dynamics,
            Self::Target(_) => RecordKind::Target,
            Self::InverseKinematics(_) => RecordKind::InverseKinematics,
        }
    }
}
