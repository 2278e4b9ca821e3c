//! A take in the formats of other programs.

use std::ops::ControlFlow;

use armature_formats::{FormatError, GlbClip, GlbMesh, GlbScene, write_bvh, write_glb};
use armature_rig::Skeleton;

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
    /// The surface to export with is bound to another skeleton than the take's.
    #[error("the take was recorded with another skeleton ({difference}); export it with the character {character:?}")]
    OtherSkeleton {
        /// The take's character.
        character: String,
        /// The first difference.
        difference: String,
    },
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
            let (poses, summary) = solve_again(take, None, progress)?;
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

/// The character that a take is exported with.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// The skeleton the mesh is bound to; it has to be the take's.
    pub skeleton: &'a Skeleton,
    /// The mesh and how it follows the bones.
    pub mesh: GlbMesh<'a>,
}

/// A take as GLB: skeleton, animation `clip_name`, and the character's skinned mesh if a surface is given.
pub fn export_glb(
    take: &Take,
    surface: Option<&Surface<'_>>,
    clip_name: &str,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> Result<Exported<Vec<u8>>, ExportError> {
    let character = &take.header().character_name;
    if let (Some(surface), Some(skeleton)) = (surface, take.skeleton())
        && let Some(difference) = difference(skeleton, surface.skeleton)
    {
        return Err(ExportError::OtherSkeleton { character: character.clone(), difference });
    }
    let motion = take_motion(take, settings, progress)?;
    let clip = GlbClip::of_motion(clip_name, &motion.resampled.motion);
    let scene = GlbScene {
        name: if character.is_empty() { "character" } else { character },
        skeleton: &motion.resampled.motion.skeleton,
        mesh: surface.map(|surface| surface.mesh),
        clips: vec![clip],
    };
    Ok(Exported { file: write_glb(&scene)?, motion })
}

fn difference(take: &Skeleton, given: &Skeleton) -> Option<String> {
    if take.len() != given.len() {
        return Some(format!("it has {} bones, the one given {}", take.len(), given.len()));
    }
    let pair = take.bones().iter().zip(given.bones()).find(|(a, b)| a != b);
    pair.map(|(a, b)| {
        if a.name == b.name {
            format!("its bone {:?} rests differently", a.name)
        } else {
            format!("where it has the bone {:?}, the one given has {:?}", a.name, b.name)
        }
    })
}
