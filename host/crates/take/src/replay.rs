//! Solving a recorded take again, and comparing with what was recorded.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use armature_rig::{Pose, PoseCompletion, Skeleton, SolveError, StreamSolver, Transform};

use crate::packed_pose::same_bits;
use crate::{PackedPose, Record, Sample, Take};

/// How many samples back a recorded pose may refer to. Programs write a pose right behind its sample, or a few
/// samples later when solving runs on another thread.
const SAMPLES_REMEMBERED: usize = 64;

/// Why a take cannot be replayed.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// The take has no skeleton.
    #[error("the take holds no skeleton, so its samples cannot be turned into poses; record with a character")]
    NoSkeleton,
    /// The take's poses were completed by inverse kinematics, and nobody is there who could do that again.
    #[error(
        "bones without a joint were turned by inverse kinematics, which needs the character's shape; give the character the take was recorded with"
    )]
    NeedsCharacter,
    /// The callback asked to stop.
    #[error("the replay was cancelled")]
    Cancelled,
}

/// What turns bones without a joint while a take is solved again, where there is something.
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

/// Solves every sample of a take with the skeleton, topology, calibration and mapping that hold at its place,
/// and hands over every record in file order: its index, and what became of it.
///
/// Samples that cannot be solved are handed over as such and counted. The callback stops the replay with
/// [`ControlFlow::Break`].
///
/// A take that was recorded with inverse kinematics needs the same `completion` again, pinned as the header says; it
/// starts afresh. For any other take it is left aside.
pub fn replay(
    take: &Take,
    completion: Completing<'_>,
    each: &mut dyn FnMut(usize, Replayed<'_>) -> ControlFlow<()>,
) -> Result<ReplaySummary, ReplayError> {
    let mut completion = match (&take.header().inverse_kinematics, completion) {
        (None, _) => None,
        (Some(_), None) => return Err(ReplayError::NeedsCharacter),
        (Some(_), Some(completion)) => Some(completion),
    };
    if let Some(completion) = &mut completion {
        completion.restart();
    }
    let mut completed = Pose::default();
    let mut solver = StreamSolver::new(take.skeleton().ok_or(ReplayError::NoSkeleton)?.clone());
    let mut summary = ReplaySummary::default();
    for (index, record) in take.records().iter().enumerate() {
        match record {
            Record::Topology(topology) => solver.set_topology(topology.epoch, topology.tree.clone()),
            Record::Calibration(calibration) => solver.set_calibration(calibration.clone()),
            Record::Mapping(mapping) => solver.set_mapping(mapping.clone()),
            Record::Engagement { micros, all } => solver.engage(*micros, *all),
            Record::Skeleton(_) | Record::Sample(_) | Record::Pose(_) | Record::Event(_) => {}
        }
        let replayed = match record {
            Record::Sample(sample) => {
                let solved =
                    solver.solve(&sample.raw).map(|pose| completed.parent_from_bone.clone_from(&pose.parent_from_bone));
                if let (Ok(()), Some(completion), Some(state)) = (&solved, &mut completion, solver.solver()) {
                    completion.complete(state.bone_status(), &mut completed);
                }
                let pose = solved.map(|()| &completed);
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

/// What comparing a take with its replay found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verification {
    /// What the replay did.
    pub replay: ReplaySummary,
    /// Recorded poses with the same bits.
    pub identical: u64,
    /// Recorded poses with other bits.
    pub different: u64,
    /// Recorded poses whose sample is not among the ones before it, or cannot be solved.
    pub without_sample: u64,
    /// The first one with other bits.
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
/// `progress` is called with the part done, 0 to 1, and stops the work with [`ControlFlow::Break`].
pub fn verify(take: &Take, progress: &mut dyn FnMut(f32) -> ControlFlow<()>) -> Result<Verification, ReplayError> {
    verify_completed(take, None, progress)
}

/// [`verify`] for a take that may have been recorded with inverse kinematics; see [`replay`].
pub fn verify_completed(
    take: &Take,
    completion: Completing<'_>,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
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

/// Solves every sample of a take again and packs the poses: for a take recorded without poses, or to use a
/// mapping that was put right.
///
/// `progress` is called with the part done, 0 to 1, and stops the work with [`ControlFlow::Break`].
pub fn solve_again(
    take: &Take,
    completion: Completing<'_>,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
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

fn report(progress: &mut dyn FnMut(f32) -> ControlFlow<()>, index: usize, count: usize) -> ControlFlow<()> {
    if index.is_multiple_of(1024) || index + 1 == count {
        progress((index + 1) as f32 / count as f32)
    } else {
        ControlFlow::Continue(())
    }
}

/// The latest solved samples and their poses, newest first; the storage of the oldest is used again.
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
