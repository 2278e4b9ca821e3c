//! The types of records.

use std::fmt;

use super::format::MAX_PAYLOAD_BYTES;

/// The type of a record; the numbers are those in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u16)]
pub enum RecordKind {
    /// [`Header`](super::Header).
    Header = 1,
    /// A skeleton.
    Skeleton = 2,
    /// [`Topology`](super::Topology).
    Topology = 3,
    /// A calibration.
    Calibration = 4,
    /// A mapping.
    Mapping = 5,
    /// [`Sample`](super::Sample).
    Sample = 6,
    /// [`PackedPose`](super::PackedPose).
    Pose = 7,
    /// [`Event`](super::Event).
    Event = 8,
    /// [`Totals`](super::Totals).
    End = 9,
    /// What a calibration holds beyond zeros; part of a [`Record::Calibration`](super::Record::Calibration).
    JointSettings = 10,
    /// [`Record::Engagement`](super::Record::Engagement).
    Engagement = 11,
    /// [`Record::ReadingsReturn`](super::Record::ReadingsReturn).
    ReadingsReturn = 12,
    /// [`Record::Ground`](super::Record::Ground).
    Ground = 13,
    /// [`Record::Shape`](super::Record::Shape).
    Shape = 14,
    /// [`Record::Dynamics`](super::Record::Dynamics).
    Dynamics = 15,
    /// [`Record::Target`](super::Record::Target).
    Target = 20,
    /// [`Record::InverseKinematics`](super::Record::InverseKinematics).
    InverseKinematics = 21,
}

impl RecordKind {
    /// The kind with this number; `None` for one that a newer minor version added.
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
            12 => Self::ReadingsReturn,
            13 => Self::Ground,
            14 => Self::Shape,
            15 => Self::Dynamics,
            20 => Self::Target,
            21 => Self::InverseKinematics,
            _ => return None,
        })
    }

    /// The number in the file.
    pub fn code(self) -> u16 {
        self as u16
    }

    /// A generous limit on payloads, used only to skip false starts when searching after damage.
    pub(super) fn plausible_payload_bytes(self) -> usize {
        match self {
            Self::Skeleton
            | Self::Calibration
            | Self::Mapping
            | Self::JointSettings
            | Self::Ground
            | Self::Dynamics
            | Self::InverseKinematics => MAX_PAYLOAD_BYTES,
            Self::Pose => 4 << 20,
            Self::Header
            | Self::Topology
            | Self::Sample
            | Self::Event
            | Self::End
            | Self::Engagement
            | Self::ReadingsReturn
            | Self::Shape
            | Self::Target => 1 << 20,
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
            Self::ReadingsReturn => "return of readings",
            Self::Ground => "ground",
            Self::Shape => "shape",
            Self::Dynamics => "dynamics",
            Self::Target => "target",
            Self::InverseKinematics => "inverse kinematics",
        })
    }
}
