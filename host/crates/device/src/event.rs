//! Everything a session can report.

use std::time::Duration;

use crate::clock::ClockEstimate;
use crate::topology::Topology;
use crate::{DeviceNotice, DeviceProblem, PartUid, SensorState};

/// Everything a session can report, in the order in which it happened. A recorded list of events replays a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// The device has said who it is: at the beginning, and again after each restart.
    Connected(DeviceInfo),
    /// The tree of parts: after each connection, and whenever parts were plugged in or out.
    Topology(Topology),
    /// The device's answer to the rate asked for, samples in 1,000 seconds.
    RateGranted {
        /// What was asked for.
        asked_millihertz: u32,
        /// What it will be.
        granted_millihertz: u32,
    },
    /// Samples come from now on.
    Started,
    /// One reading of every sensor. Its epoch is that of the last [`Event::Topology`].
    Sample(Sample),
    /// The device took samples that did not arrive.
    Lost {
        /// How many.
        count: u32,
        /// Number of the first one after the gap.
        next_sequence: u32,
    },
    /// Bytes that were no frame.
    Noise {
        /// Pieces with a wrong checksum.
        checksum_errors: u64,
        /// Pieces that were no frame at all.
        framing_errors: u64,
        /// Their bytes.
        bytes: u64,
    },
    /// A better estimate of the device's clock.
    Clock(ClockEstimate),
    /// The part shows itself.
    Blinking {
        /// Which part.
        uid: PartUid,
    },
    /// No more samples come, as asked.
    Stopped,
    /// The device has started anew; the session goes through hello and topology again by itself.
    Restarted,
    /// Something worth telling the user, although all goes on.
    Notice(DeviceNotice),
    /// Something is wrong. The session goes on trying unless the connection is closed.
    Problem(DeviceProblem),
}

/// Who the device is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DeviceInfo {
    /// Product name.
    pub name: String,
    /// Number of the part that holds the microcontroller.
    pub uid: PartUid,
    /// Protocol: major, minor.
    pub protocol: [u8; 2],
    /// Firmware: major, minor, patch.
    pub firmware: [u8; 3],
    /// Abilities, see [`features`](crate::features).
    pub features: u32,
    /// Fastest sampling, samples in 1,000 seconds.
    pub max_rate_millihertz: u32,
}

/// One reading of every sensor.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sample {
    /// When the sensors were read, microseconds of the device's clock.
    pub device_micros: u64,
    /// The device's running number; a gap is a loss.
    pub sequence: u32,
    /// Which topology the sensors are numbered by.
    pub epoch: u16,
    /// When its last byte was received, in the session's time.
    pub received: Duration,
    /// Raw counts, in the topology's sensor order.
    pub counts: Vec<u16>,
    /// One state a count.
    pub states: Vec<SensorState>,
}

/// What a session has counted since it began.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SessionCounters {
    /// Bytes received.
    pub bytes: u64,
    /// Frames that passed every check.
    pub frames: u64,
    /// Samples handed on.
    pub samples: u64,
    /// Samples the device took that were not handed on: missing on the line, or without a fitting topology.
    pub lost_samples: u64,
    /// Of those, samples that arrived but could not be laid out.
    pub unusable_samples: u64,
    /// Samples that came again; dropped.
    pub duplicate_samples: u64,
    /// Samples that came before this session asked for any; dropped.
    pub stale_samples: u64,
    /// Pieces with a wrong checksum.
    pub checksum_errors: u64,
    /// Pieces that were no frame at all.
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
    /// Times the device started anew.
    pub restarts: u64,
}
