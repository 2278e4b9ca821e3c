//! What a take holds, at a glance.

use crate::device_clock::DeviceClock;
use crate::{EventKind, Record, Take};

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
    /// Samples a second over that time; `None` with fewer than two different times.
    pub samples_per_second: Option<f64>,
    /// Samples that never arrived, as the events tell.
    pub lost_samples: u64,
    /// Frames with a wrong checksum, as the events tell.
    pub crc_errors: u64,
    /// Pieces of the stream that were no frame at all.
    pub resyncs: u64,
    /// Bytes that were no frame, as the events tell.
    pub discarded_bytes: u64,
    /// Starts of the device in mid-take, announced or seen from its clock.
    pub restarts: u64,
    /// Times the line came back.
    pub reconnects: u64,
    /// Notes by the person who recorded, each with its time, seconds since the first sample.
    pub markers: Vec<(f64, String)>,
}

/// Sums a take up.
pub fn summarize(take: &Take) -> Summary {
    let mut summary = Summary::default();
    let mut clock = DeviceClock::new(take.header().nominal_samples_per_second);
    let (mut first, mut last) = (i64::MAX, i64::MIN);
    for record in take.records() {
        match record {
            Record::Sample(sample) => {
                let micros = clock.sample(sample.raw.device_micros, sample.host_receive_seconds);
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
                EventKind::Restart => clock.announce_restart(),
                EventKind::Reconnect => summary.reconnects += 1,
                EventKind::Resync { count } => summary.resyncs = summary.resyncs.saturating_add(*count),
                EventKind::Marker { text } => {
                    summary.markers.push((last.max(0) as f64 * 1e-6, text.clone()));
                }
                EventKind::TopologyChange { .. } => {}
            },
            Record::Skeleton(_)
            | Record::Topology(_)
            | Record::Calibration(_)
            | Record::Mapping(_)
            | Record::Engagement { .. } => {}
        }
    }
    summary.duration_seconds = if summary.samples > 0 { last.saturating_sub(first) as f64 * 1e-6 } else { 0.0 };
    summary.samples_per_second =
        (summary.duration_seconds > 0.0).then(|| (summary.samples - 1) as f64 / summary.duration_seconds);
    summary.restarts = clock.into_restarts().len() as u64;
    summary
}
