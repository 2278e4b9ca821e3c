//! A take in the formats of other programs.

use std::ops::ControlFlow;

use armature_formats::FormatError;
use armature_formats::fbx::{FbxFile, FbxNotes, write_fbx};
use armature_formats::gltf::{GlbClip, GlbMesh, GlbScene, write_glb};
use armature_formats::model::{Expression, set_shapes, targets_of_shape};
use armature_formats::motion::{BvhSettings, VrmaFile, add_clip, write_bvh_as, write_vrma};
use armature_formats::usd::{UsdFile, write_usda, write_usdz};
use armature_rig::{Motion, Skeleton};

use crate::edit::Edited;
use crate::file::{Header, PackedPose, Take, TakeError, TakeWriter, WriteError};
use crate::keys::{KeyError, KeyReport, KeySettings, reduce_keys};
use crate::replay::{ReplayError, ReplaySummary, solve_again};
use crate::shapes::ShapeTrack;
use crate::time::{ResampleError, ResampleSettings, Resampled, Timeline, TimelineReport, resample};

/// The share of an export's progress for solving samples again; resampling takes the rest.
const SOLVING: f64 = 0.9;

/// Which poses of a take to export.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PoseSource {
    /// Those that were recorded.
    #[default]
    Recorded,
    /// All samples solved again.
    SolvedAgain,
}

/// How to export a take.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportSettings {
    /// Which poses.
    pub poses: PoseSource,
    /// Rate and range.
    pub resample: ResampleSettings,
    /// How to reduce the keys of a GLB; `None`: every frame is a key.
    pub keys: Option<KeySettings>,
}

/// Why a take cannot be exported.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ExportError {
    /// There are no poses to resample.
    #[error(transparent)]
    Resample(#[from] ResampleError),
    /// The samples cannot be solved again.
    #[error(transparent)]
    Replay(#[from] ReplayError),
    /// The mesh is bound to a different skeleton than the take's.
    #[error(
        "the take was recorded with a different skeleton ({difference}); export it with the character {character:?}"
    )]
    OtherSkeleton {
        /// The take's character.
        character: String,
        /// The first difference.
        difference: String,
    },
    /// The format cannot hold it.
    #[error(transparent)]
    Format(#[from] FormatError),
    /// The keys cannot be reduced.
    #[error(transparent)]
    Keys(#[from] KeyError),
}

/// A take's motion at a constant rate, and everything in it that was not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct TakeMotion {
    /// The motion, and which gaps in it are held.
    pub resampled: Resampled,
    /// Restarts, duplicates and late poses.
    pub timeline: TimelineReport,
    /// The result of solving again, if requested.
    pub replay: Option<ReplaySummary>,
    /// The weights of blend shapes, if the take sets any.
    pub shapes: Option<ShapeTrack>,
}

/// A file and everything in it that was not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported<File> {
    /// The file.
    pub file: File,
    /// The motion in it.
    pub motion: TakeMotion,
    /// What reducing the keys saved and changed, if it was asked for.
    pub keys: Option<KeyReport>,
    /// Shapes that the take sets and that the file does not have, since it has no mesh or the mesh lacks them.
    pub missing_shapes: Vec<String>,
}

/// The motion of a take at a constant rate.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1, and can stop the work with
/// [`ControlFlow::Break`].
pub fn take_motion(
    take: &Take,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<TakeMotion, ExportError> {
    let (solved, replay, before): (Vec<PackedPose>, _, _) = match settings.poses {
        PoseSource::Recorded => (Vec::new(), None, 0.0),
        PoseSource::SolvedAgain => {
            let (poses, summary) = solve_again(take, None, &mut |stage, done| progress(stage, SOLVING * done))?;
            (poses, Some(summary), SOLVING)
        }
    };
    let timeline = match settings.poses {
        PoseSource::Recorded => Timeline::recorded(take),
        PoseSource::SolvedAgain => Timeline::solved(take, &solved),
    };
    let timeline = timeline.ok_or(ResampleError::NoPoses)?;
    let resampled =
        resample(&timeline, &settings.resample, &mut |stage, done| progress(stage, before + (1.0 - before) * done))?;
    Ok(TakeMotion { resampled, timeline: timeline.report().clone(), replay, shapes: ShapeTrack::of(take) })
}

/// The motion of an edited take at a constant rate.
///
/// `progress` as in [`take_motion`].
pub fn edited_motion(
    edited: &Edited,
    settings: &ResampleSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<TakeMotion, ExportError> {
    let resampled = edited.at_rate(settings, progress)?;
    let (timeline, shapes) = (edited.timeline().report().clone(), edited.shapes.clone());
    Ok(TakeMotion { resampled, timeline, replay: None, shapes })
}

/// A take as BVH, which has a value for every frame whatever the settings say of keys.
pub fn export_bvh(
    take: &Take,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Exported<String>, ExportError> {
    bvh_of(take_motion(take, settings, progress)?, &BvhSettings::default())
}

/// A motion as BVH.
pub fn bvh_of(motion: TakeMotion, settings: &BvhSettings) -> Result<Exported<String>, ExportError> {
    let missing_shapes = names_of_shapes(&motion);
    Ok(Exported { file: write_bvh_as(&motion.resampled.motion, settings)?, motion, keys: None, missing_shapes })
}

/// The shapes that a take sets, none of which a format without a mesh has a place for.
fn names_of_shapes(motion: &TakeMotion) -> Vec<String> {
    motion.shapes.iter().flat_map(|track| track.names().to_vec()).collect()
}

/// The character that a take is exported with.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// The skeleton the mesh is bound to; it must be the take's.
    pub skeleton: &'a Skeleton,
    /// The mesh and how it follows the bones.
    pub mesh: GlbMesh<'a>,
    /// Morph targets that are set together.
    pub expressions: &'a [Expression],
}

/// For each frame of a motion the weight of each morph target, and the names that the surface does not have. No rows if
/// the take sets no shape of the surface.
fn weight_rows(motion: &TakeMotion, surface: Option<&Surface<'_>>) -> (Vec<Vec<f32>>, Vec<String>) {
    let Some(track) = &motion.shapes else { return (Vec::new(), Vec::new()) };
    let morphs = surface.map_or(&[][..], |surface| surface.mesh.morph_targets);
    let expressions = surface.map_or(&[][..], |surface| surface.expressions);
    let of = |name: &String| targets_of_shape(expressions, morphs, name);
    let targets: Vec<Vec<(usize, f32)>> = track.names().iter().map(of).collect();
    let missing = track.names().iter().zip(&targets).filter(|(_, targets)| targets.is_empty());
    let missing: Vec<String> = missing.map(|(name, _)| name.clone()).collect();
    if missing.len() == track.names().len() {
        return (Vec::new(), missing);
    }
    let rest: Vec<f32> = morphs.iter().map(|target| target.default_weight).collect();
    let mut touched = vec![false; rest.len()];
    let Resampled { motion, start_seconds, .. } = &motion.resampled;
    let rows = (0..motion.frames.len()).map(|frame| {
        let mut row = rest.clone();
        let set: Vec<(&str, f32)> = track.at(start_seconds + frame as f64 * motion.frame_seconds).collect();
        let place = |name: &str| track.names().iter().position(|known| known == name);
        let set = set.into_iter().filter_map(|(name, weight)| Some((targets[place(name)?].as_slice(), weight)));
        set_shapes(set, &mut row, &mut touched);
        row
    });
    (rows.collect(), missing)
}

/// A take as GLB: skeleton, animation `clip_name`, and the character's skinned mesh if a surface is given.
pub fn export_glb(
    take: &Take,
    surface: Option<&Surface<'_>>,
    clip_name: &str,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Exported<Vec<u8>>, ExportError> {
    let character = &take.header().character_name;
    let motion = take_motion(take, settings, progress)?;
    glb_of(motion, character, surface, clip_name, settings.keys.as_ref(), progress)
}

/// A motion as GLB: skeleton, animation `clip_name`, and a skinned mesh if a surface is given. `character`: its name, or
/// the file it came from.
pub fn glb_of(
    motion: TakeMotion,
    character: &str,
    surface: Option<&Surface<'_>>,
    clip_name: &str,
    keys: Option<&KeySettings>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Exported<Vec<u8>>, ExportError> {
    check_surface(&motion, character, surface)?;
    let scene = |clips| scene_of(&motion, character, surface, clips);
    let (rows, missing_shapes) = weight_rows(&motion, surface);
    let clip = GlbClip { weights: &rows, ..GlbClip::of_motion(clip_name, &motion.resampled.motion) };
    let (file, keys) = match keys {
        None => (write_glb(&scene(vec![clip]))?, None),
        Some(keys) => {
            let reduced = reduce_keys(&motion.resampled.motion, keys, progress)?;
            // Weights of shapes keep a key for every frame.
            let shapes = if rows.is_empty() { Vec::new() } else { vec![GlbClip { poses: &[], ..clip }] };
            (add_clip(&write_glb(&scene(shapes))?, clip_name, &reduced.tracks)?, Some(reduced.report))
        }
    };
    Ok(Exported { file, motion, keys, missing_shapes })
}

/// A motion as FBX, with a key for every frame, whatever the settings say of keys; otherwise as [`glb_of`].
pub fn fbx_of(
    motion: TakeMotion,
    character: &str,
    surface: Option<&Surface<'_>>,
    clip_name: &str,
    notes: &FbxNotes,
) -> Result<Exported<FbxFile>, ExportError> {
    check_surface(&motion, character, surface)?;
    let (rows, missing_shapes) = weight_rows(&motion, surface);
    let clips = vec![GlbClip { weights: &rows, ..GlbClip::of_motion(clip_name, &motion.resampled.motion) }];
    let file = write_fbx(&scene_of(&motion, character, surface, clips), notes)?;
    Ok(Exported { file, motion, keys: None, missing_shapes })
}

/// A motion as USD, with a key for every frame: as text, or with `images` as a package with the images of its materials.
/// `properties`: names and texts for the layer's custom data; otherwise as [`glb_of`].
pub fn usd_of(
    motion: TakeMotion,
    character: &str,
    surface: Option<&Surface<'_>>,
    clip_name: &str,
    images: bool,
    properties: &[(String, String)],
) -> Result<Exported<UsdFile>, ExportError> {
    check_surface(&motion, character, surface)?;
    let (rows, missing_shapes) = weight_rows(&motion, surface);
    let clips = vec![GlbClip { weights: &rows, ..GlbClip::of_motion(clip_name, &motion.resampled.motion) }];
    let scene = scene_of(&motion, character, surface, clips);
    let file = if images { write_usdz(&scene, properties)? } else { write_usda(&scene, properties)? };
    Ok(Exported { file, motion, keys: None, missing_shapes })
}

/// A human's motion as VRM animation.
pub fn vrma_of(motion: TakeMotion, character: &str, clip_name: &str) -> Result<Exported<VrmaFile>, ExportError> {
    let file = write_vrma(character_in_exports(character), clip_name, &motion.resampled.motion)?;
    let missing_shapes = names_of_shapes(&motion);
    Ok(Exported { file, motion, keys: None, missing_shapes })
}

/// A motion as a take: a pose for each frame, at its time to the microsecond. It has no samples, so it is exported, edited
/// and played, but not solved again.
///
/// ```
/// use armature_rig::{Bone, Motion, Skeleton, Transform};
/// use armature_take::{Header, motion_take};
///
/// let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
/// let skeleton = Skeleton::new(vec![bone])?;
/// let frames = vec![skeleton.rest_pose(); 3];
/// let motion = Motion::new(skeleton, 0.04, frames)?;
/// let take = motion_take(&motion, &Header { character_name: "arm".into(), ..Header::default() })?;
/// assert_eq!(take.poses().map(|pose| pose.device_micros).collect::<Vec<_>>(), [0, 40_000, 80_000]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn motion_take(motion: &Motion, header: &Header) -> Result<Take, MotionTakeError> {
    let mut writer = TakeWriter::new(Vec::new(), header)?;
    writer.skeleton(&motion.skeleton)?;
    for (sequence, pose) in (0_u32..).zip(&motion.frames) {
        // Rounded up, so that the last frame is within the time that the last pose says.
        let micros = libm::ceil(f64::from(sequence) * motion.frame_seconds * 1e6 - 1e-3) as u64;
        writer.pose(sequence, micros, pose)?;
    }
    Ok(Take::read(&writer.finish()?)?.0)
}

/// Why a motion is no take.
#[derive(Debug, thiserror::Error)]
pub enum MotionTakeError {
    /// A record cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// It cannot be read again.
    #[error(transparent)]
    Read(#[from] TakeError),
}

/// Refuses a surface that is bound to another skeleton than the motion's.
pub fn check_surface(motion: &TakeMotion, character: &str, surface: Option<&Surface<'_>>) -> Result<(), ExportError> {
    match surface.and_then(|surface| difference(&motion.resampled.motion.skeleton, surface.skeleton)) {
        Some(difference) => Err(ExportError::OtherSkeleton { character: character.to_owned(), difference }),
        None => Ok(()),
    }
}

fn scene_of<'a>(
    motion: &'a TakeMotion,
    character: &'a str,
    surface: Option<&Surface<'a>>,
    clips: Vec<GlbClip<'a>>,
) -> GlbScene<'a> {
    GlbScene {
        name: character_in_exports(character),
        skeleton: &motion.resampled.motion.skeleton,
        mesh: surface.map(|surface| surface.mesh),
        clips,
    }
}

/// A character's name without the folders and the extension of the file it came from.
fn character_in_exports(source: &str) -> &str {
    let name = source.rsplit(['/', '\\']).next().unwrap_or(source);
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem);
    if stem.is_empty() { "character" } else { stem }
}

fn difference(take: &Skeleton, given: &Skeleton) -> Option<String> {
    if take.len() != given.len() {
        return Some(format!("it has {} bones, the given one {}", take.len(), given.len()));
    }
    let pair = take.bones().iter().zip(given.bones()).find(|(a, b)| a != b);
    pair.map(|(a, b)| {
        if a.name == b.name {
            format!("its bone {:?} rests differently", a.name)
        } else {
            format!("where it has the bone {:?}, the given one has {:?}", a.name, b.name)
        }
    })
}
