//! What a take contains, at a glance.

use std::collections::BTreeMap;

use armature_rig::{JointTree, PartUid, RawSample, SensorState};

use crate::file::{ClockFault, EventKind, Record, Take};
use crate::time::{ClockFaults, DeviceClock};

/// Counts, times and losses of a take.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Summary {
    /// Samples.
    pub samples: u64,
    /// Poses.
    pub poses: u64,
    /// From the earliest to the latest sample, seconds of the device's clock; restarts are bridged as in a
    /// [`crate::Timeline`].
    pub duration_seconds: f64,
    /// Samples per second over that time; `None` with fewer than two different times.
    pub samples_per_second: Option<f64>,
    /// Samples that never arrived, according to the events.
    pub lost_samples: u64,
    /// Frames with a wrong checksum, according to the events.
    pub crc_errors: u64,
    /// Pieces of the stream that were not frames at all.
    pub resyncs: u64,
    /// Bytes that were not frames, according to the events.
    pub discarded_bytes: u64,
    /// Restarts of the device in mid-take, announced or detected from its clock.
    pub restarts: u64,
    /// Samples whose device time could not be believed and was rebuilt.
    pub clock_faults: ClockFaults,
    /// What the session reported of the device's clock while it recorded, and by how many seconds; the times in the take
    /// are mended already.
    pub mended_clock: Vec<(ClockFault, f64)>,
    /// Joints that had no good reading for a second or longer, by the time it began.
    pub silent_joints: Vec<SilentJoint>,
    /// Times the connection came back.
    pub reconnects: u64,
    /// Notes by the user who recorded, each with its time, seconds since the first sample.
    pub markers: Vec<(f64, String)>,
}

/// A joint that had no good reading for a second or longer; its bone kept its last rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SilentJoint {
    /// Its part.
    pub part: PartUid,
    /// When it fell silent, seconds since the take's first sample.
    pub at_seconds: f64,
    /// For how long, seconds; up to the end of the take, or until it was plugged out.
    pub seconds: f64,
}

/// A joint without a good reading for this long is named, microseconds.
const SILENT_MICROS: i64 = 1_000_000;

/// Which joints have no good reading, and since when.
#[derive(Debug, Default)]
struct Silence {
    tree: JointTree,
    since: BTreeMap<PartUid, i64>,
    latest: i64,
    found: Vec<SilentJoint>,
}

impl Silence {
    fn topology(&mut self, tree: &JointTree) {
        self.tree = tree.clone();
        let gone: Vec<PartUid> = self.since.keys().copied().filter(|&uid| tree.find(uid).is_none()).collect();
        gone.into_iter().for_each(|uid| self.ends(uid));
    }

    fn sample(&mut self, sample: &RawSample, micros: i64) {
        self.latest = micros;
        if sample.states.len() != self.tree.sensor_count() {
            return;
        }
        for index in 0..self.tree.parts().len() {
            let uid = self.tree.parts()[index].uid;
            let is_bad = |state: &SensorState| matches!(state, SensorState::NoData | SensorState::Outlier);
            if sample.states[self.tree.sensors(index)].iter().any(is_bad) {
                self.since.entry(uid).or_insert(micros);
            } else if !self.since.is_empty() {
                self.ends(uid);
            }
        }
    }

    fn ends(&mut self, part: PartUid) {
        let Some(since) = self.since.remove(&part) else { return };
        let lasted = self.latest.saturating_sub(since);
        if lasted >= SILENT_MICROS {
            let (at_seconds, seconds) = (since as f64 * 1e-6, lasted as f64 * 1e-6);
            self.found.push(SilentJoint { part, at_seconds, seconds });
        }
    }

    fn finish(mut self) -> Vec<SilentJoint> {
        let still: Vec<PartUid> = self.since.keys().copied().collect();
        still.into_iter().for_each(|uid| self.ends(uid));
        self.found.sort_by(|a, b| a.at_seconds.total_cmp(&b.at_seconds));
        self.found
    }
}

/// Summarises a take.
pub fn summarize(take: &Take) -> Summary {
    let mut summary = Summary::default();
    let mut clock = DeviceClock::new(take);
    let mut silence = Silence::default();
    let (mut first, mut last) = (i64::MAX, i64::MIN);
    for record in take.records() {
        match record {
            Record::Sample(sample) => {
                let micros = clock.next_sample();
                silence.sample(&sample.raw, micros);
                (first, last) = (first.min(micros), last.max(micros));
                summary.samples += 1;
            }
            Record::Pose(_) => summary.poses += 1,
            Record::Event(event) => match &event.kind {
                EventKind::LostSamples { count, .. } => {
                    summary.lost_samples = summary.lost_samples.saturating_add(*count);
                }
                EventKind::Noise { crc_errors, discarded_bytes } => {
                    summary.crc_errors = summary.crc_errors.saturating_add(*crc_errors);
                    summary.discarded_bytes = summary.discarded_bytes.saturating_add(*discarded_bytes);
                }
                EventKind::Reconnect => summary.reconnects += 1,
                EventKind::Resync { count } => summary.resyncs = summary.resyncs.saturating_add(*count),
                EventKind::Marker { text } => {
                    summary.markers.push((last.max(0) as f64 * 1e-6, text.clone()));
                }
                EventKind::ClockFault { fault, micros } => summary.mended_clock.push((*fault, *micros as f64 * 1e-6)),
                EventKind::Restart | EventKind::TopologyChange { .. } | EventKind::Posing { .. } => {}
            },
            Record::Topology(topology) => silence.topology(&topology.tree),
            Record::Skeleton(_)
            | Record::Calibration(_)
            | Record::Mapping(_)
            | Record::Engagement { .. }
            | Record::ReadingsReturn { .. }
            | Record::Ground(_)
            | Record::Shape(_)
            | Record::Dynamics(_)
            | Record::Target(_)
            | Record::InverseKinematics(_) => {}
        }
    }
    summary.duration_seconds = if summary.samples > 0 { last.saturating_sub(first) as f64 * 1e-6 } else { 0.0 };
    summary.samples_per_second =
        (summary.duration_seconds > 0.0).then(|| (summary.samples - 1) as f64 / summary.duration_seconds);
    let (restarts, clock_faults) = clock.finish();
    summary.restarts = restarts.len() as u64;
    summary.clock_faults = clock_faults;
    summary.silent_joints = silence.finish();
    summary
}
