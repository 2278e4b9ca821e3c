//! Solving a recorded take again, and comparing it with the recording.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use armature_rig::{
    Calibration, DynamicsError, Filter, Ground, GroundError, PartSettings, Pose, PoseCompletion, Skeleton, SolveError,
    StreamSolver, TargetError, Transform,
};

use crate::file::{PackedPose, Record, Sample, ShapeSetting, Take, same_bits};

/// How many samples back a recorded pose may refer to. Programs write a pose right after its sample, or a few samples
/// later if solving runs on another thread.
const SAMPLES_REMEMBERED: usize = 64;

/// Why a take cannot be replayed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// The take has no skeleton.
    #[error("the take holds no skeleton, so its samples cannot be turned into poses; record it with a character")]
    NoSkeleton,
    /// The take's poses were completed by inverse kinematics, and no solver was given that could repeat it.
    #[error(
        "bones without a joint were posed by inverse kinematics, which needs the character's shape; give the character the take was recorded with"
    )]
    NeedsCharacter,
    /// A take put together in memory tells the skeleton to stand or swing in a way that it cannot.
    #[error("record {record}: {why}; record the take again")]
    Settings {
        /// Index among the take's records.
        record: usize,
        /// What is wrong.
        why: SettingError,
    },
    /// A target cannot be followed by this character.
    #[error("record {record}: {why}; give the character the take was recorded with")]
    Target {
        /// Index among the take's records.
        record: usize,
        /// What is wrong.
        why: TargetError,
    },
    /// The callback asked to stop.
    #[error("the replay was cancelled")]
    Cancelled,
}

/// Why a skeleton cannot be posed as a record says.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SettingError {
    /// It cannot stand like this.
    #[error(transparent)]
    Ground(#[from] GroundError),
    /// It cannot swing like this.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
}

/// Poses bones without a joint while a take is solved again, if given.
pub type Completing<'a> = Option<&'a mut dyn PoseCompletion>;

/// One record of a take as it is replayed.
#[derive(Debug)]
pub enum Replayed<'a> {
    /// A sample and its pose, or why it has none.
    Sample {
        /// The sample.
        sample: &'a Sample,
        /// Its pose.
        pose: Result<&'a Pose, SolveError>,
    },
    /// Any other record.
    Other(&'a Record),
}

/// What a replay did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReplaySummary {
    /// Samples that have a pose.
    pub solved: u64,
    /// Samples that have none.
    pub unsolved: u64,
    /// The first of those: its index among the take's records, and why.
    pub first_unsolved: Option<(usize, SolveError)>,
}

/// Solves every sample of a take with the skeleton, topology, calibration and mapping in force at its place, and passes
/// on every record in file order: its index and its result.
///
/// Samples that cannot be solved are passed on as such and counted. The callback can stop the replay with
/// [`ControlFlow::Break`].
///
/// A take that was recorded with inverse kinematics needs the same `completion` again, pinned as the header says; it
/// starts from scratch. Any other take ignores it.
pub fn replay(
    take: &Take,
    completion: Completing<'_>,
    each: &mut dyn FnMut(usize, Replayed<'_>) -> ControlFlow<()>,
) -> Result<ReplaySummary, ReplayError> {
    let mut completed = Completed::new(take, completion).ok_or(ReplayError::NeedsCharacter)?;
    completed.begin(take);
    let mut solver = StreamSolver::new(take.skeleton().ok_or(ReplayError::NoSkeleton)?.clone());
    let mut summary = ReplaySummary::default();
    for (index, record) in take.records().iter().enumerate() {
        settle(&mut solver, record).map_err(|why| ReplayError::Settings { record: index, why })?;
        completed.hear(record).map_err(|why| ReplayError::Target { record: index, why })?;
        let replayed = match record {
            Record::Sample(sample) => {
                let pose = solver.solve_completed(&sample.raw, completed.now());
                match &pose {
                    Ok(_) => summary.solved += 1,
                    Err(error) => {
                        summary.unsolved += 1;
                        summary.first_unsolved.get_or_insert_with(|| (index, error.clone()));
                    }
                }
                Replayed::Sample { sample, pose }
            }
            other => Replayed::Other(other),
        };
        if each(index, replayed).is_break() {
            return Err(ReplayError::Cancelled);
        }
    }
    Ok(summary)
}

/// What poses bones without a joint in a take, from the record on that says so.
#[derive(Debug)]
pub(crate) struct Completed<'a, 'b> {
    completion: Option<&'a mut (dyn PoseCompletion + 'b)>,
    is_on: bool,
}

impl<'a, 'b> Completed<'a, 'b> {
    /// Before its beginning; `None` if the take needs a completion and none is given.
    pub(crate) fn new(take: &Take, completion: Option<&'a mut (dyn PoseCompletion + 'b)>) -> Option<Self> {
        let completion = match (take.inverse_kinematics(), completion) {
            (None, _) => None,
            (Some(_), completion) => Some(completion?),
        };
        Some(Self { completion, is_on: false })
    }

    /// At the take's beginning.
    pub(crate) fn begin(&mut self, take: &Take) {
        if let Some(completion) = &mut self.completion {
            completion.restart();
        }
        self.is_on = take.header().inverse_kinematics.is_some();
    }

    /// What a record changes for the samples behind it.
    pub(crate) fn hear(&mut self, record: &Record) -> Result<(), TargetError> {
        let Some(completion) = &mut self.completion else { return Ok(()) };
        match record {
            Record::InverseKinematics(_) => {
                completion.restart();
                self.is_on = true;
                Ok(())
            }
            Record::Target(change) => completion.change_target(change),
            _ => Ok(()),
        }
    }

    /// For the next sample.
    pub(crate) fn now(&mut self) -> Option<&mut (dyn PoseCompletion + 'b)> {
        if self.is_on { self.completion.as_deref_mut() } else { None }
    }
}

/// What a record changes for the samples behind it. An error: its ground or its dynamics do not fit the skeleton.
pub(crate) fn settle(solver: &mut StreamSolver, record: &Record) -> Result<(), SettingError> {
    match record {
        Record::Topology(topology) => solver.set_topology(topology.epoch, topology.tree.clone()),
        Record::Calibration(calibration) => solver.set_calibration(calibration.clone()),
        Record::Mapping(mapping) => solver.set_mapping(mapping.clone()),
        Record::Engagement { micros, all } => solver.engage(*micros, *all),
        Record::ReadingsReturn { micros } => solver.return_over(*micros),
        Record::Ground(ground) => solver.set_ground(ground.clone())?,
        Record::Dynamics(dynamics) => solver.set_dynamics(dynamics.clone())?,
        Record::Shape(ShapeSetting { name, weight, .. }) => {
            // Takes hold finite weights only.
            let _ = solver.set_shape(name, *weight);
        }
        Record::Skeleton(_)
        | Record::Sample(_)
        | Record::Pose(_)
        | Record::Event(_)
        | Record::Target(_)
        | Record::InverseKinematics(_) => {}
    }
    Ok(())
}

/// A calibration with this filter on every joint; with `None` as it is.
pub(crate) fn filtered(calibration: &Calibration, filter: Option<Filter>) -> Calibration {
    let mut calibration = calibration.clone();
    if let Some(filter) = filter {
        calibration.filter = filter;
        let own: Vec<_> = calibration.set_parts().collect();
        for (part, settings) in own {
            calibration.set_part_settings(part, PartSettings { filter: None, ..settings });
        }
    }
    calibration
}

/// The first recorded pose that the replay does not reproduce.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Index of the pose among the take's records.
    pub record: usize,
    /// Its sample's sequence number.
    pub sequence: u32,
    /// Its sample's device time, microseconds.
    pub device_micros: u64,
    /// Zero-based bone.
    pub bone: usize,
    /// The bone's name.
    pub bone_name: String,
    /// As recorded.
    pub recorded: Transform,
    /// As solved now.
    pub solved: Transform,
}

/// The result of comparing a take with its replay.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verification {
    /// What the replay did.
    pub replay: ReplaySummary,
    /// Recorded poses with the same bits.
    pub identical: u64,
    /// Recorded poses with different bits.
    pub different: u64,
    /// Recorded poses whose sample is not among the ones before it, or cannot be solved.
    pub without_sample: u64,
    /// The first one with different bits.
    pub first_difference: Option<Difference>,
}

impl Verification {
    /// Whether every recorded pose was solved again with the same bits, and there was at least one.
    pub fn is_exact(&self) -> bool {
        self.identical > 0 && self.different == 0 && self.without_sample == 0
    }
}

/// Replays a take and compares every recorded pose with the one solved again, bit for bit.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1, and can stop the work with
/// [`ControlFlow::Break`].
pub fn verify(
    take: &Take,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Verification, ReplayError> {
    verify_completed(take, None, progress)
}

/// [`verify`] for a take that may have been recorded with inverse kinematics; see [`replay`].
pub fn verify_completed(
    take: &Take,
    completion: Completing<'_>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Verification, ReplayError> {
    let skeleton = take.skeleton().ok_or(ReplayError::NoSkeleton)?;
    let mut verification = Verification::default();
    let mut recent = Recent::default();
    let mut recorded = Pose::default();
    let replay = replay(take, completion, &mut |index, replayed| {
        match replayed {
            Replayed::Sample { sample, pose: Ok(pose) } => recent.remember(sample, pose),
            Replayed::Other(Record::Pose(packed)) => {
                packed.unpack(skeleton, &mut recorded);
                verification.compare(index, packed, &recorded, recent.find(packed), skeleton);
            }
            Replayed::Sample { .. } | Replayed::Other(_) => {}
        }
        report(progress, index, take.records().len())
    })?;
    Ok(Verification { replay, ..verification })
}

/// Solves every sample of a take again and packs the poses: for a take recorded without poses, or after correcting a
/// mapping.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1, and can stop the work with
/// [`ControlFlow::Break`].
pub fn solve_again(
    take: &Take,
    completion: Completing<'_>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<(Vec<PackedPose>, ReplaySummary), ReplayError> {
    let skeleton = take.skeleton().ok_or(ReplayError::NoSkeleton)?;
    let mut poses = Vec::new();
    let summary = replay(take, completion, &mut |index, replayed| {
        if let Replayed::Sample { sample, pose: Ok(pose) } = replayed {
            poses.extend(PackedPose::pack(sample.raw.sequence, sample.raw.device_micros, pose, skeleton));
        }
        report(progress, index, take.records().len())
    })?;
    Ok((poses, summary))
}

/// The take as if its roots had followed the feet like this from its start on, or not at all with `None`; whatever it says
/// itself of the ground is left out. Its poses stay as they are until its samples are solved again.
pub fn with_ground(take: &Take, ground: Option<&Ground>) -> Take {
    let mut records = Vec::with_capacity(take.records().len() + 1);
    for record in take.records().iter().filter(|record| !matches!(record, Record::Ground(_))) {
        records.push(record.clone());
        if let (Record::Skeleton(_), Some(ground)) = (record, ground) {
            records.push(Record::Ground(Some(ground.clone())));
        }
    }
    take.with_records(records)
}

/// The take with its samples solved again, the roots following the feet like this from its start on, or not at all with
/// `None` ([`with_ground`]). Poses without a sample are left out.
///
/// `completion` as for [`replay`]; `progress` is called with the current stage and the fraction done, 0 to 1, and can stop
/// the work with [`ControlFlow::Break`].
pub fn solve_on_ground(
    take: &Take,
    ground: Option<&Ground>,
    completion: Completing<'_>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Take, ReplayError> {
    let take = with_ground(take, ground);
    let records = take.records().iter().filter(|record| !matches!(record, Record::Pose(_)));
    let take = take.with_records(records.cloned().collect());
    let (poses, _) = solve_again(&take, completion, progress)?;
    let mut poses = poses.into_iter().peekable();
    let mut records = Vec::with_capacity(take.records().len() + poses.len());
    for record in take.records() {
        records.push(record.clone());
        let Record::Sample(sample) = record else { continue };
        let key = (sample.raw.sequence, sample.raw.device_micros);
        records.extend(poses.next_if(|pose| (pose.sequence, pose.device_micros) == key).map(Record::Pose));
    }
    Ok(take.with_records(records))
}

fn report(
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
    index: usize,
    count: usize,
) -> ControlFlow<()> {
    if index.is_multiple_of(1024) || index + 1 == count {
        progress("solving again", (index + 1) as f64 / count as f64)
    } else {
        ControlFlow::Continue(())
    }
}

/// The latest solved samples and their poses, newest first; the storage of the oldest is reused.
#[derive(Debug, Default)]
struct Recent {
    solved: VecDeque<(u32, u64, Pose)>,
}

impl Recent {
    fn remember(&mut self, sample: &Sample, pose: &Pose) {
        let mut kept = match self.solved.len() {
            SAMPLES_REMEMBERED.. => self.solved.pop_back().map(|(_, _, pose)| pose).unwrap_or_default(),
            _ => Pose::default(),
        };
        kept.parent_from_bone.clone_from(&pose.parent_from_bone);
        self.solved.push_front((sample.raw.sequence, sample.raw.device_micros, kept));
    }

    fn find(&self, packed: &PackedPose) -> Option<&Pose> {
        let key = (packed.sequence, packed.device_micros);
        self.solved.iter().find(|(sequence, micros, _)| (*sequence, *micros) == key).map(|(_, _, pose)| pose)
    }
}

impl Verification {
    fn compare(
        &mut self,
        record: usize,
        packed: &PackedPose,
        recorded: &Pose,
        solved: Option<&Pose>,
        skeleton: &Skeleton,
    ) {
        let Some(solved) = solved else {
            self.without_sample += 1;
            return;
        };
        let mut pairs = recorded.parent_from_bone.iter().zip(&solved.parent_from_bone);
        let Some(bone) = pairs.position(|(a, b)| !same_bits(a, b)) else {
            self.identical += 1;
            return;
        };
        self.different += 1;
        self.first_difference.get_or_insert_with(|| Difference {
            record,
            sequence: packed.sequence,
            device_micros: packed.device_micros,
            bone,
            bone_name: skeleton.bones()[bone].name.clone(),
            recorded: recorded.parent_from_bone[bone],
            solved: solved.parent_from_bone[bone],
        });
    }
}
