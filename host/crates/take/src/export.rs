//! A take in the formats of other programs.

use std::ops::ControlFlow;

use armature_formats::{FormatError, write_bvh};

use crate::{
    PackedPose, ReplayError, ReplaySummary, ResampleError, ResampleSettings, Resampled, Take, Timeline, TimelineReport,
    resample, solve_again,
};

/// Which poses of a take to export.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseSource {
    /// Those that were recorded.
    #[default]
    Recorded,
    /// All samples solved again.
    SolvedAgain,
}

/// What to export of a take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportSettings {
    /// Which poses.
    pub poses: PoseSource,
    /// Rate and range.
    pub resample: ResampleSettings,
}

/// Why a take cannot be exported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// There are no poses to bring to a rate.
    #[error(transparent)]
    Resample(#[from] ResampleError),
    /// The samples cannot be solved again.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The format cannot hold it.
    #[error(transparent)]
    Format(#[from] FormatError),
}

/// A take's motion at a constant rate, and everything about it that was not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct TakeMotion {
    /// The motion, and which gaps in it are held.
    pub resampled: Resampled,
    /// Restarts, duplicates and late poses.
    pub timeline: TimelineReport,
    /// What solving again did, where it was asked for.
    pub replay: Option<ReplaySummary>,
}

/// A file and everything about it that was not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported<File> {
    /// The file.
    pub file: File,
    /// The motion in it.
    pub motion: TakeMotion,
}

/// The motion of a take at a constant rate.
///
/// `progress` is called with the part done, 0 to 1 (twice over when samples are solved again), and stops the
/// work with [`ControlFlow::Break`].
pub fn take_motion(
    take: &Take,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> Result<TakeMotion, ExportError> {
    let (solved, replay): (Vec<PackedPose>, _) = match settings.poses {
        PoseSource::Recorded => (Vec::new(), None),
        PoseSource::SolvedAgain => {
            let (poses, summary) = solve_again(take, progress)?;
            (poses, Some(summary))
        }
    };
    let timeline = match settings.poses {
        PoseSource::Recorded => Timeline::recorded(take),
        PoseSource::SolvedAgain => Timeline::solved(take, &solved),
    };
    let timeline = timeline.ok_or(ResampleError::NoPoses)?;
    let resampled = resample(&timeline, &settings.resample, progress)?;
    Ok(TakeMotion { resampled, timeline: timeline.report().clone(), replay })
}

/// A take as BVH.
pub fn export_bvh(
    take: &Take,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> Result<Exported<String>, ExportError> {
    let motion = take_motion(take, settings, progress)?;
    Ok(Exported { file: write_bvh(&motion.resampled.motion)?, motion })
}
