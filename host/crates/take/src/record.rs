//! What a take is made of.

use std::fmt;

use armature_rig::{Calibration, JointTree, Mapping, RawSample, Skeleton};

use crate::PackedPose;

/// The type of a record; the numbers stand in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u16)]
pub enum RecordKind {
    /// [`Header`].
    Header = 1,
    /// A skeleton.
    Skeleton = 2,
    /// [`Topology`].
    Topology = 3,
    /// A calibration.
    Calibration = 4,
    /// A mapping.
    Mapping = 5,
    /// [`Sample`].
    Sample = 6,
    /// [`PackedPose`].
    Pose = 7,
    /// [`Event`].
    Event = 8,
    /// [`Totals`].
    End = 9,
    /// What a calibration says beyond zeros; part of a [`Record::Calibration`].
    JointSettings = 10,
    /// [`Record::Engagement`].
    Engagement = 11,
}

impl RecordKind {
    /// The kind with this number; `None` for one that a newer minor version brought.
    pub fn from_code(code: u16) -> Option<Self> {
        Some(match code {
            1 => Self::Header,
            2 => Self::Skeleton,
            3 => Self::Topology,
            4 => Self::Calibration,
            5 => Self::Mapping,
            6 => Self::Sample,
            7 => Self::Pose,
            8 => Self::Event,
            9 => Self::End,
            10 => Self::JointSettings,
            11 => Self::Engagement,
            _ => return None,
        })
    }

    /// The number that stands in the file.
    pub fn code(self) -> u16 {
        self as u16
    }

    /// A generous bound on payloads, used only to pass over false starts when searching after damage.
    pub(crate) fn plausible_payload_bytes(self) -> usize {
        match self {
            Self::Skeleton | Self::Calibration | Self::Mapping | Self::JointSettings => crate::MAX_PAYLOAD_BYTES,
            Self::Pose => 4 << 20,
            Self::Header | Self::Topology | Self::Sample | Self::Event | Self::End | Self::Engagement => 1 << 20,
        }
    }
}

impl fmt::Display for RecordKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Header => "header",
            Self::Skeleton => "skeleton",
            Self::Topology => "topology",
            Self::Calibration => "calibration",
            Self::Mapping => "mapping",
            Self::Sample => "sample",
            Self::Pose => "pose",
            Self::Event => "event",
            Self::End => "end",
            Self::JointSettings => "joint settings",
            Self::Engagement => "engagement",
        })
    }
}

/// Where a take comes from. Nothing here is filled in behind the caller's back: equal input gives equal bytes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Header {
    /// Version of the program that records.
    pub program_version: String,
    /// Name of the character.
    pub character_name: String,
    /// Hash of the character's content, so that a replay can tell whether it has the same one.
    pub character_hash: [u8; 32],
    /// Samples a second the device was asked for.
    pub nominal_samples_per_second: Option<f64>,
    /// Seed of a simulated device.
    pub seed: Option<u64>,
    /// Whether time was simulated as well.
    pub virtual_clock: bool,
    /// Wall-clock time of the start, microseconds since 1970-01-01 UTC, where the caller wants it recorded.
    pub unix_micros: Option<i64>,
    /// How bones without a joint were turned; `None`: they were left in the rest pose.
    pub inverse_kinematics: Option<InverseKinematicsHeader>,
}

/// That the character's shape decided about bones without a joint. Solving such a take again needs the character.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InverseKinematicsHeader {
    /// Names of the bones that were held in their place.
    pub pins: Vec<String>,
    /// What bones preferred, in words that whoever recorded understands.
    pub preferences: Vec<String>,
}

impl Header {
    /// The lowest minor version of the format that can say this.
    pub(crate) fn minor_version(&self) -> u16 {
        u16::from(self.inverse_kinematics.is_some())
    }
}

/// A puppet as it is plugged together from here on.
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
    /// What the device said.
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
    /// Bytes that were no message.
    Noise {
        /// Frames whose checksum did not hold.
        crc_errors: u64,
        /// Bytes passed over between frames.
        discarded_bytes: u64,
    },
    /// The device started anew; its clock and its sequence numbers may start from zero.
    Restart,
    /// The line was lost and came back.
    Reconnect,
    /// The puppet was plugged together differently; a [`Topology`] with this epoch follows.
    TopologyChange {
        /// The new epoch.
        epoch: u16,
    },
    /// A note by the person who records.
    Marker {
        /// The note.
        text: String,
    },
    /// Pieces of the stream were no frame at all, until it was found again behind them.
    Resync {
        /// How many pieces.
        count: u64,
    },
}

/// What a cleanly finished take says about itself at its end.
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
    pub(crate) fn count(&mut self, kind: Option<RecordKind>, bytes: u64) {
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
    /// How parts that come back take their bones along, from here on.
    Engagement {
        /// Over how long, microseconds of the device's clock.
        micros: u32,
        /// The whole puppet comes back here.
        all: bool,
    },
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
        }
    }
}
