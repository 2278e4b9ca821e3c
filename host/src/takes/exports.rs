//! Takes as files for other programs.

use std::fmt;
use std::ops::ControlFlow;

use armature_character::Character;
use armature_formats::fbx::FbxNotes;
use armature_formats::motion::{KeyInterpolation, annotate_clips};
use armature_take::{
    Edited, ExportError, ExportSettings, FrameRate, KeyReport, Surface, Take, TakeMotion, Timecode, bvh_of,
    edited_motion, fbx_of, glb_of, take_motion,
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
}

impl Target {
    /// The format that a file's extension stands for.
    pub fn of_extension(extension: &str) -> Option<Self> {
        match extension {
            "bvh" => Some(Self::Bvh),
            "glb" => Some(Self::Glb),
            "fbx" => Some(Self::Fbx),
            _ => None,
        }
    }

    /// Whether the character's mesh is part of it.
    pub fn holds_mesh(self) -> bool {
        self != Self::Bvh
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
}

impl Options {
    /// All frames at this rate.
    pub fn at(rate: FrameRate) -> Self {
        let mut settings = ExportSettings::default();
        settings.resample.frames_per_second = rate.frames_per_second();
        Self { settings, rate, start: None, shapes: Vec::new() }
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
    /// What in the motion was not measured, in sentences.
    pub notes: Vec<String>,
}

impl fmt::Display for Exported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let frames = counted(self.frames, "frame", "frames");
        let bones = counted(self.bones, "bone", "bones");
        write!(f, "{frames} at {} a second, {bones}, {} bytes", self.rate, self.bytes.len())?;
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
            "drop_frame": self.rate.drops_numbers(), "bones": self.bones, "bytes": self.bytes.len(),
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

/// Exports a take, or what its edits make of it. A GLB or FBX needs the character; a bare skeleton gives a file without
/// a mesh.
pub fn export(
    take: &Take,
    edited: Option<&Edited>,
    character: Option<&LoadedCharacter>,
    target: Target,
    options: &Options,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Exported, Failure> {
    let settings = &options.settings;
    let motion = match edited {
        Some(edited) => edited_motion(edited, &settings.resample, progress),
        None => take_motion(take, settings, progress),
    };
    let motion = motion.map_err(|e| failure(&e))?;
    let reshaped = character.map(|character| reshaped(character, &options.shapes)).transpose()?.flatten();
    let surface = reshaped.as_ref().or_else(|| character?.character()).map(surface_of);
    let name = &take.header().character_name;
    let mut left_out = Vec::new();
    let (bytes, taken, keys, missing) = match target {
        Target::Bvh => {
            let exported = bvh_of(motion).map_err(|e| failure(&e))?;
            (exported.file.into_bytes(), exported.motion, None, exported.missing_shapes)
        }
        Target::Glb => {
            let exported = glb_of(motion, name, surface.as_ref(), "take", settings.keys.as_ref(), progress)
                .map_err(|e| failure(&e))?;
            let file = match options.start {
                Some(start) => annotate_clips(&exported.file, &Value::Object(timecode_of(start)))?,
                None => exported.file,
            };
            (file, exported.motion, exported.keys, exported.missing_shapes)
        }
        Target::Fbx => {
            let text = |(key, value): (String, Value)| (key, value.as_str().map_or(value.to_string(), str::to_owned));
            let properties = options.start.into_iter().flat_map(timecode_of).map(text).collect();
            let notes = FbxNotes { properties, drops_numbers: options.rate.drops_numbers() };
            let exported = fbx_of(motion, name, surface.as_ref(), "take", &notes).map_err(|e| failure(&e))?;
            left_out = exported.file.left_out;
            (exported.file.bytes, exported.motion, None, exported.missing_shapes)
        }
    };
    let motion = &taken.resampled.motion;
    let frames = motion.frames.len();
    let last = |start: Timecode| start.after(frames.saturating_sub(1) as u64);
    let mut notes = notes(&taken);
    notes.extend(left_out);
    if !missing.is_empty() {
        let names = missing.join(", ");
        notes.push(match target {
            Target::Bvh => format!("BVH has no place for the weights of blend shapes, which the take sets: {names}"),
            _ => format!("the take sets shapes that the character does not have: {names}"),
        });
    }
    notes.extend(edited.iter().flat_map(|edited| edited.notes.clone()));
    if options.start.is_some() && target == Target::Bvh {
        notes.push("BVH has no place for timecode; it is only in what is printed here and in the receipt".into());
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
        notes,
    })
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
