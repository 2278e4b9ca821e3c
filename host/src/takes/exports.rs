//! Takes as files for other programs.

use std::fmt;
use std::ops::ControlFlow;

use armature_character::{Character, SkinKind};
use armature_formats::fbx::FbxNotes;
use armature_formats::motion::{BvhSettings, KeyInterpolation, annotate_clips};
use armature_take::{
    Dress, Edited, ExportError, ExportSettings, FrameRate, KeyReport, McapError, Surface, Take, TakeMotion, Timecode,
    bvh_of, check_surface, csv_of, csv_of_motion, edited_motion, fbx_of, glb_of, mcap_of, motion_take, npz_of,
    take_motion, usd_of, vrma_of,
};
use serde_json::{Map, Value, json};

use crate::characters::LoadedCharacter;
use crate::characters::shapes::{ShapeWeight, reshaped};
use crate::failure::Failure;
use crate::terminal::counted;

/// The format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Skeleton and motion as text.
    Bvh,
    /// Skinned mesh, skeleton and animation.
    Glb,
    /// The same for programs that read no glTF.
    Fbx,
    /// The same for film pipelines, as text without images.
    Usda,
    /// The same as a package with its images.
    Usdz,
    /// A human's motion for any VRM avatar.
    Vrma,
    /// Samples, angles and poses as a table of text.
    Csv,
    /// The same as arrays for `NumPy`.
    Npz,
    /// The same as a log for the viewers of robotics.
    Mcap,
}

impl Target {
    /// All formats, by their extensions.
    pub const ALL: [(&'static str, Self); 9] = [
        ("bvh", Self::Bvh),
        ("glb", Self::Glb),
        ("fbx", Self::Fbx),
        ("usda", Self::Usda),
        ("usdz", Self::Usdz),
        ("vrma", Self::Vrma),
        ("csv", Self::Csv),
        ("npz", Self::Npz),
        ("mcap", Self::Mcap),
    ];

    /// The format that a file's extension stands for.
    pub fn of_extension(extension: &str) -> Option<Self> {
        Self::ALL.iter().find(|(own, _)| *own == extension).map(|(_, target)| *target)
    }

    /// Whether the character's mesh is part of it.
    pub fn holds_mesh(self) -> bool {
        matches!(self, Self::Glb | Self::Fbx | Self::Usda | Self::Usdz)
    }

    /// Whether it has a place for the timecode of its first frame.
    fn holds_timecode(self) -> bool {
        self.holds_mesh() || self == Self::Vrma
    }

    /// Whether it holds the samples of a take, at their own times.
    pub fn holds_samples(self) -> bool {
        matches!(self, Self::Csv | Self::Npz | Self::Mcap)
    }

    /// What people call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bvh => "BVH",
            Self::Glb => "GLB",
            Self::Fbx => "FBX",
            Self::Usda | Self::Usdz => "USD",
            Self::Vrma => "VRMA",
            Self::Csv => "CSV",
            Self::Npz => "NPZ",
            Self::Mcap => "MCAP",
        }
    }
}

/// What to export, and under which name for the first frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Poses, rate, range and keys.
    pub settings: ExportSettings,
    /// The rate, as a fraction.
    pub rate: FrameRate,
    /// Timecode of the first frame, if it has one.
    pub start: Option<Timecode>,
    /// Shapes of the character.
    pub shapes: Vec<ShapeWeight>,
    /// Names of bones, rest pose and first frame.
    pub dress: Dress,
    /// Order of rotations and unit of a BVH.
    pub bvh: BvhSettings,
}

impl Options {
    /// All frames at this rate.
    pub fn at(rate: FrameRate) -> Self {
        let mut settings = ExportSettings::default();
        settings.resample.frames_per_second = rate.frames_per_second();
        Self { settings, rate, start: None, shapes: Vec::new(), dress: Dress::default(), bvh: BvhSettings::default() }
    }
}

/// A file's bytes and what is in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// Frames of the motion.
    pub frames: usize,
    /// Frames a second.
    pub rate: FrameRate,
    /// Timecodes of the first and the last frame, if they have one.
    pub timecodes: Option<[Timecode; 2]>,
    /// What reducing the keys saved and changed, if it was asked for.
    pub keys: Option<KeyReport>,
    /// Bones.
    pub bones: usize,
    /// Samples at the device's own times, if it holds any.
    pub samples: Option<usize>,
    /// What in the motion was not measured, in sentences.
    pub notes: Vec<String>,
}

impl fmt::Display for Exported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let bones = counted(self.bones, "bone", "bones");
        if let Some(samples) = self.samples {
            write!(f, "{} at the device's times, ", counted(samples, "sample", "samples"))?;
        }
        if self.frames > 0 || self.samples.is_none() {
            write!(f, "{} at {} a second, ", counted(self.frames, "frame", "frames"), self.rate)?;
        }
        write!(f, "{bones}, {} bytes", self.bytes.len())?;
        if let Some([first, last]) = self.timecodes {
            write!(f, ", timecode {first} to {last}")?;
        }
        if let Some(keys) = &self.keys {
            let share = 100.0 * keys.keys as f64 / keys.keys_before.max(1) as f64;
            write!(f, "; {} of {} keys ({share:.1} %)", keys.keys, keys.keys_before)?;
            write!(f, ", rotations off by {:.3}° at most", keys.rotation.to_degrees())?;
            if let Some((off, foot)) = &keys.feet {
                write!(f, ", feet by {off:.2e} ({foot})")?;
            }
        }
        Ok(())
    }
}

impl Exported {
    /// The same for scripts.
    pub fn to_json(&self) -> Value {
        let (numerator, denominator) = self.rate.fraction();
        json!({
            "frames": self.frames, "frames_per_second": [numerator, denominator],
            "drop_frame": self.rate.drops_numbers(), "bones": self.bones, "samples": self.samples, "bytes": self.bytes.len(),
            "timecode": self.timecodes.map(|codes| codes.map(|code| code.to_string())),
            "keys": self.keys.as_ref().map(|keys| json!({
                "keys": keys.keys, "keys_before": keys.keys_before, "fewest_linear": keys.fewest_linear,
                "rotation_off_degrees": keys.rotation.to_degrees(), "translation_off": keys.translation,
                "feet_off": keys.feet.as_ref().map(|(off, bone)| json!({"distance": off, "bone": bone})),
            })),
            "notes": self.notes,
        })
    }
}

/// Exports a take, or what its edits make of it. A GLB, FBX or USD needs the character; a bare skeleton gives a file
/// without a mesh. CSV and MCAP of a take that was not edited are its samples, whatever the options say of frames.
pub fn export(
    take: &Take,
    edited: Option<&Edited>,
    character: Option<&LoadedCharacter>,
    target: Target,
    options: &Options,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Exported, Failure> {
    let settings = &options.settings;
    let has_samples = edited.is_none() && take.samples().next().is_some();
    if has_samples && matches!(target, Target::Csv | Target::Mcap) {
        return samples_alone(take, target, options, progress);
    }
    let motion = match edited {
        Some(edited) => edited_motion(edited, &settings.resample, progress),
        None => take_motion(take, settings, progress),
    };
    let mut motion = motion.map_err(|e| failure(&e))?;
    let name = &take.header().character_name;
    let reshaped = character.map(|character| reshaped(character, &options.shapes)).transpose()?.flatten();
    let own = reshaped.as_ref().or_else(|| character?.character()).map(surface_of);
    if options.dress != Dress::default() {
        check_surface(&motion, name, own.as_ref()).map_err(|e| failure(&e))?;
    }
    let dressed = options.dress.apply(&mut motion.resampled.motion, own.as_ref().map(|surface| &surface.mesh));
    let dressed =
        dressed.map_err(|why| Failure::input(why, "leave out --rest, or name the bones as other programs do"))?;
    let surface = own.map(|own| {
        let is_other = own.skeleton != &dressed.skeleton && options.dress == Dress::default();
        let skeleton = if is_other { own.skeleton } else { &dressed.skeleton };
        Surface { skeleton, mesh: dressed.mesh(own.mesh), ..own }
    });
    let work = Work { take, target, options, has_samples };
    let Written { bytes, taken, keys, missing, left_out } = write(&work, motion, surface.as_ref(), progress)?;
    let motion = &taken.resampled.motion;
    let frames = motion.frames.len();
    let last = |start: Timecode| start.after(frames.saturating_sub(1) as u64);
    let mut notes = notes(&taken);
    notes.extend(left_out);
    if !missing.is_empty() {
        let names = missing.join(", ");
        notes.push(if target.holds_mesh() {
            format!("the take sets shapes that the character does not have: {names}")
        } else {
            format!("{} has no place for the weights of blend shapes, which the take sets: {names}", target.name())
        });
    }
    let drawn = character.filter(|_| target.holds_mesh()).and_then(LoadedCharacter::character);
    notes.extend(drawn.and_then(plain_skin));
    notes.extend(edited.iter().flat_map(|edited| edited.notes.clone()));
    if options.start.is_some() && !target.holds_timecode() {
        let format = target.name();
        notes
            .push(format!("{format} has no place for timecode; it is only in what is printed here and in the receipt"));
    }
    if let Some(keys) = keys.as_ref().filter(|_| is_spline(settings)) {
        notes.push(
            "the bound holds where the splines' tangents are read; Blender's import puts its own in their place".into(),
        );
        notes.extend(keys.why_not_half());
    }
    Ok(Exported {
        bytes,
        frames,
        rate: options.rate,
        timecodes: options.start.map(|start| [start, last(start)]),
        keys,
        bones: motion.skeleton.len(),
        samples: (target.holds_samples() && has_samples).then(|| take.samples().count()),
        notes,
    })
}

/// What is exported, and how.
#[derive(Clone, Copy)]
struct Work<'a> {
    take: &'a Take,
    target: Target,
    options: &'a Options,
    /// Whether the take's samples go along.
    has_samples: bool,
}

/// A file, what is in it, and what is not.
struct Written {
    bytes: Vec<u8>,
    taken: TakeMotion,
    keys: Option<KeyReport>,
    /// Shapes that the take sets and the file does not have.
    missing: Vec<String>,
    left_out: Vec<String>,
}

/// The file of a motion.
fn write(
    work: &Work<'_>,
    motion: TakeMotion,
    surface: Option<&Surface<'_>>,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Written, Failure> {
    let Work { take, target, options, has_samples } = *work;
    let name = &take.header().character_name;
    let mut left_out = Vec::new();
    let (bytes, taken, keys, missing) = match target {
        Target::Bvh => {
            let exported = bvh_of(motion, &options.bvh).map_err(|e| failure(&e))?;
            (exported.file.into_bytes(), exported.motion, None, exported.missing_shapes)
        }
        Target::Glb => {
            let exported = glb_of(motion, name, surface, "take", options.settings.keys.as_ref(), progress)
                .map_err(|e| failure(&e))?;
            let file = match options.start {
                Some(start) => annotate_clips(&exported.file, &Value::Object(timecode_of(start)))?,
                None => exported.file,
            };
            (file, exported.motion, exported.keys, exported.missing_shapes)
        }
        Target::Fbx => {
            let notes = FbxNotes { properties: timecode_texts(options), drops_numbers: options.rate.drops_numbers() };
            let exported = fbx_of(motion, name, surface, "take", &notes).map_err(|e| failure(&e))?;
            left_out = exported.file.left_out;
            (exported.file.bytes, exported.motion, None, exported.missing_shapes)
        }
        Target::Usda | Target::Usdz => {
            let (images, texts) = (target == Target::Usdz, timecode_texts(options));
            let exported = usd_of(motion, name, surface, "take", images, &texts).map_err(|e| failure(&e))?;
            left_out = exported.file.left_out;
            (exported.file.bytes, exported.motion, None, exported.missing_shapes)
        }
        Target::Vrma => {
            let exported = vrma_of(motion, name, "take").map_err(|e| failure(&e))?;
            left_out = exported.file.left_out;
            let file = match options.start {
                Some(start) => annotate_clips(&exported.file.bytes, &Value::Object(timecode_of(start)))?,
                None => exported.file.bytes,
            };
            (file, exported.motion, None, exported.missing_shapes)
        }
        Target::Csv => (csv_of_motion(&motion.resampled.motion).into_bytes(), motion, None, Vec::new()),
        Target::Npz => {
            let bytes = npz_of(&motion.resampled.motion, has_samples.then_some(take))?;
            (bytes, motion, None, Vec::new())
        }
        Target::Mcap => {
            let frames = motion_take(&motion.resampled.motion, take.header())
                .map_err(|e| Failure::input(e.to_string(), "export a shorter take"))?;
            (mcap_of(&frames, progress).map_err(of_mcap)?, motion, None, Vec::new())
        }
    };
    Ok(Written { bytes, taken, keys, missing, left_out })
}

/// The samples of a take at their own times, with the poses that were recorded.
fn samples_alone(
    take: &Take,
    target: Target,
    options: &Options,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Exported, Failure> {
    let bytes = match target {
        Target::Mcap => mcap_of(take, progress).map_err(of_mcap)?,
        _ => csv_of(take).into_bytes(),
    };
    let mut notes = Vec::new();
    if options.start.is_some() {
        let format = target.name();
        notes.push(format!("{format} has no place for timecode; its times are the device's"));
    }
    Ok(Exported {
        bytes,
        frames: 0,
        rate: options.rate,
        timecodes: None,
        keys: None,
        bones: take.skeleton().map_or(0, armature_rig::Skeleton::len),
        samples: Some(take.samples().count()),
        notes,
    })
}

fn of_mcap(error: McapError) -> Failure {
    Failure::input(error.to_string(), "`armature inspect` says what the take holds")
}

/// The timecode of the first frame as names and texts.
fn timecode_texts(options: &Options) -> Vec<(String, String)> {
    let text = |(key, value): (String, Value)| (key, value.as_str().map_or(value.to_string(), str::to_owned));
    options.start.into_iter().flat_map(timecode_of).map(text).collect()
}

/// What is lost of a character's skin in a file, whose reader blends linearly.
fn plain_skin(character: &Character) -> Option<String> {
    let lost = match character.skin {
        SkinKind::Linear => return None,
        SkinKind::DualQuaternion => "joints that collapse there do not here",
        SkinKind::StretchTwist | SkinKind::StretchTwistDualQuaternion => {
            "twists that are spread along limbs here are next to the joints there"
        }
    };
    Some(format!(
        "the skin of {} is {}; programs that open the file blend it linearly: {lost}",
        character.name, character.skin
    ))
}

fn is_spline(settings: &ExportSettings) -> bool {
    settings.keys.is_some_and(|keys| keys.interpolation == KeyInterpolation::Cubic)
}

/// The character's mesh and how it follows the bones.
fn surface_of(c: &Character) -> Surface<'_> {
    Surface { skeleton: &c.skeleton, mesh: c.glb_mesh(), expressions: c.expressions() }
}

/// What a file says of its first frame.
fn timecode_of(start: Timecode) -> Map<String, Value> {
    let (numerator, denominator) = start.rate().fraction();
    let said = [
        ("start_timecode", json!(start.to_string())),
        ("start_frame", json!(start.frame())),
        ("frames_per_second", json!([numerator, denominator])),
        ("drop_frame", json!(start.rate().drops_numbers())),
    ];
    said.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

fn failure(error: &ExportError) -> Failure {
    match error {
        ExportError::Format(error) => error.clone().into(),
        ExportError::OtherSkeleton { .. } => {
            Failure::usage(error.to_string(), "name the character it was recorded with by --character")
        }
        error => Failure::input(error.to_string(), "`armature inspect` says what the take holds"),
    }
}

fn notes(taken: &TakeMotion) -> Vec<String> {
    let mut notes = Vec::new();
    for gap in &taken.resampled.held_gaps {
        notes.push(format!(
            "no samples between {:.3} s and {:.3} s: the pose before is held there",
            gap.start_seconds, gap.end_seconds
        ));
    }
    if !taken.timeline.restarts.is_empty() {
        let times = counted(taken.timeline.restarts.len(), "time", "times");
        notes.push(format!("the device restarted {times} in this take"));
    }
    if !taken.timeline.clock_faults.is_empty() {
        notes.push(taken.timeline.clock_faults.to_string());
    }
    notes
}
