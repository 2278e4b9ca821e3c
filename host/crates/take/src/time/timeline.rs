//! The poses of a take in time order.

use std::collections::VecDeque;

use armature_rig::Skeleton;

use super::device_clock::{ClockFaults, ClockRestart, DeviceClock};
use crate::file::{PackedPose, Record, Sample, Take};

/// How many samples back to look for a recorded pose's sample; see the same number in the replay.
const SAMPLES_REMEMBERED: usize = 64;

/// The poses of a take, each at its sample's true device time, earliest first.
///
/// Time zero is the take's first sample. Where the device restarted, its clock is continued by the host's receive times
/// ([`ClockRestart`]). Of several poses for the same time, the first one counts.
#[derive(Debug)]
pub struct Timeline<'t> {
    skeleton: &'t Skeleton,
    moments: Vec<Moment<'t>>,
    report: TimelineReport,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Moment<'t> {
    pub(super) micros: i64,
    pub(super) pose: &'t PackedPose,
}

/// What had to be corrected to get one timeline.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimelineReport {
    /// Restarts of the device in the middle of the take.
    pub restarts: Vec<ClockRestart>,
    /// Samples whose time was rebuilt.
    pub clock_faults: ClockFaults,
    /// Poses that came after a later one in the file.
    pub out_of_order: u64,
    /// Poses skipped because an earlier one has the same time.
    pub duplicates: u64,
}

impl<'t> Timeline<'t> {
    /// The poses that were recorded; `None` for a take without a skeleton.
    pub fn recorded(take: &'t Take) -> Option<Self> {
        let mut recent: VecDeque<(u32, u64, i64)> = VecDeque::with_capacity(SAMPLES_REMEMBERED);
        Self::build(take, |clock, step| match step {
            Step::Sample(sample, micros) => {
                recent.truncate(SAMPLES_REMEMBERED - 1);
                recent.push_front((sample.raw.sequence, sample.raw.device_micros, micros));
                None
            }
            Step::Pose(pose) => {
                let key = (pose.sequence, pose.device_micros);
                let found = recent.iter().find(|(sequence, device, _)| (*sequence, *device) == key);
                let micros = found.map_or_else(|| clock.place(pose.device_micros), |(_, _, micros)| *micros);
                Some(Moment { micros, pose })
            }
        })
    }

    /// Poses as [`crate::solve_again`] returned them for this take; `None` for a take without a skeleton.
    pub fn solved(take: &'t Take, poses: &'t [PackedPose]) -> Option<Self> {
        let mut next = poses.iter().peekable();
        Self::build(take, |_, step| match step {
            Step::Sample(sample, micros) => {
                let key = (sample.raw.sequence, sample.raw.device_micros);
                let pose = next.next_if(|pose| (pose.sequence, pose.device_micros) == key)?;
                Some(Moment { micros, pose })
            }
            Step::Pose(_) => None,
        })
    }

    /// Poses at these times, microseconds, which must increase.
    pub(crate) fn of(skeleton: &'t Skeleton, poses: &'t [(i64, PackedPose)]) -> Self {
        let moments = poses.iter().map(|(micros, pose)| Moment { micros: *micros, pose }).collect();
        Self { skeleton, moments, report: TimelineReport::default() }
    }

    fn build(take: &'t Take, mut moment: impl FnMut(&mut DeviceClock, Step<'t>) -> Option<Moment<'t>>) -> Option<Self> {
        let skeleton = take.skeleton()?;
        let mut clock = DeviceClock::new(take);
        let mut moments = Vec::new();
        for record in take.records() {
            match record {
                Record::Sample(sample) => {
                    let micros = clock.next_sample();
                    moments.extend(moment(&mut clock, Step::Sample(sample, micros)));
                }
                Record::Pose(pose) => moments.extend(moment(&mut clock, Step::Pose(pose))),
                _ => {}
            }
        }
        let mut latest = i64::MIN;
        let mut out_of_order = 0;
        for moment in &moments {
            out_of_order += u64::from(moment.micros < latest);
            latest = latest.max(moment.micros);
        }
        let before = moments.len();
        moments.sort_by_key(|moment| moment.micros);
        moments.dedup_by_key(|moment| moment.micros);
        let duplicates = (before - moments.len()) as u64;
        let (restarts, clock_faults) = clock.finish();
        let report = TimelineReport { restarts, clock_faults, out_of_order, duplicates };
        Some(Self { skeleton, moments, report })
    }

    /// The skeleton the poses move.
    pub fn skeleton(&self) -> &'t Skeleton {
        self.skeleton
    }

    /// Number of poses.
    pub fn len(&self) -> usize {
        self.moments.len()
    }

    /// Whether there is no pose.
    pub fn is_empty(&self) -> bool {
        self.moments.is_empty()
    }

    /// Times of the first and the last pose, seconds since the take's first sample.
    pub fn span_seconds(&self) -> Option<(f64, f64)> {
        Some((self.moments.first()?.seconds(), self.moments.last()?.seconds()))
    }

    /// What had to be corrected.
    pub fn report(&self) -> &TimelineReport {
        &self.report
    }

    pub(super) fn moments(&self) -> &[Moment<'t>] {
        &self.moments
    }

    /// Index of the pose in force at this time: the latest one not after it; 0 before the first.
    pub fn at(&self, seconds: f64) -> usize {
        self.moments.partition_point(|moment| moment.seconds() <= seconds).saturating_sub(1)
    }

    /// Time (seconds since the take's first sample) and pose with this index.
    pub fn get(&self, index: usize) -> Option<(f64, &'t PackedPose)> {
        self.moments.get(index).map(|moment| (moment.seconds(), moment.pose))
    }
}

impl Moment<'_> {
    pub(super) fn seconds(&self) -> f64 {
        self.micros as f64 * 1e-6
    }
}

enum Step<'t> {
    Sample(&'t Sample, i64),
    Pose(&'t PackedPose),
}
