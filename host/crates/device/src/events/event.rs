//! Everything a session can report.

use std::time::Duration;

use firmware_protocol::{PartUid, SensorState};

use super::clock_estimate::ClockEstimate;
use super::notice::DeviceNotice;
use super::problem::DeviceProblem;
use crate::topology::Topology;

/// Everything a session can report, in the order in which it happened. A recorded list of events replays a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The device has said who it is: at the beginning, and again after each restart.
    Connected(DeviceInfo),
    /// The tree of parts: after each connection, and whenever parts were plugged in or out.
    Topology(Topology),
    /// The device's answer to the requested rate, samples per 1,000 seconds.
    RateGranted {
        /// The requested rate.
        asked_millihertz: u32,
        /// The granted rate.
        granted_millihertz: u32,
    },
    /// Samples come from now on.
    Started,
    /// One reading of every sensor. Its epoch is that of the last [`Event::Topology`].
    Sample(Sample),
    /// The device took samples that are not handed on: they did not arrive, could not be laid out, or have an
    /// impossible time. All of them together are [`SessionCounters::lost_samples`].
    Lost {
        /// How many.
        count: u32,
        /// Number of the first one after the gap.
        next_sequence: u32,
    },
    /// Bytes that were not frames.
    Noise {
        /// Pieces with a wrong checksum.
        checksum_errors: u64,
        /// Pieces that were not frames at all.
        framing_errors: u64,
        /// Their bytes.
        bytes: u64,
    },
    /// A better estimate of the device's clock.
    Clock(ClockEstimate),
    /// The part is blinking.
    Blinking {
        /// Which part.
        uid: PartUid,
    },
    /// No more samples come, as requested.
    Stopped,
    /// The device has restarted; the session goes through hello and topology again automatically.
    Restarted,
    /// Something worth reporting to the user although everything continues.
    Notice(DeviceNotice),
    /// Something is wrong. The session keeps trying unless the connection is closed.
    Problem(DeviceProblem),
}

/// A name that a device gave itself, on one line: control characters are replaced by U+FFFD.
pub(crate) fn printable(name: &str) -> String {
    name.chars().map(|c| if c.is_control() { char::REPLACEMENT_CHARACTER } else { c }).collect()
}

/// Who the device is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Product name; control characters in it are replaced by U+FFFD.
    pub name: String,
    /// Number of the part that holds the microcontroller.
    pub uid: PartUid,
    /// Protocol: major, minor.
    pub protocol: [u8; 2],
    /// Firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Supported features, see [`features`](crate::features).
    pub features: u32,
    /// Fastest sampling, samples per 1,000 seconds.
    pub max_rate_millihertz: u32,
}

/// One reading of every sensor.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// When the sensors were read, microseconds of the device's clock.
    pub device_micros: u64,
    /// The device's sequence number; a gap is a loss.
    pub sequence: u32,
    /// Which topology the sensors are numbered by.
    pub epoch: u16,
    /// When its last byte was received, in the session's time.
    pub received: Duration,
    /// Raw counts, in the topology's sensor order.
    pub counts: Vec<u16>,
    /// One state per count.
    pub states: Vec<SensorState>,
}

/// A session's counters since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionCounters {
    /// Bytes received.
    pub bytes: u64,
    /// Frames that passed every check.
    pub frames: u64,
    /// Samples delivered.
    pub samples: u64,
    /// Samples the device took that were not delivered: lost on the line, or without a matching topology.
    pub lost_samples: u64,
    /// Of those, samples that arrived but could not be laid out.
    pub unusable_samples: u64,
    /// Samples whose clock could not be believed: rejected and counted as lost, or handed on with a rebuilt time.
    pub clock_faults: u64,
    /// Samples received twice; dropped.
    pub duplicate_samples: u64,
    /// Samples that arrived before this session requested any; dropped.
    pub stale_samples: u64,
    /// Pieces with a wrong checksum.
    pub checksum_errors: u64,
    /// Pieces that were not frames at all.
    pub framing_errors: u64,
    /// Bytes that belonged to no frame.
    pub discarded_bytes: u64,
    /// Frames of a type that this version does not know; skipped.
    pub unknown_messages: u64,
    /// Frames of a known type whose content was too short or impossible; skipped.
    pub malformed_messages: u64,
    /// Requests sent again because no answer had come.
    pub repeated_requests: u64,
    /// Times the device introduced itself to this session.
    pub connections: u64,
    /// Times the device restarted.
    pub restarts: u64,
}
