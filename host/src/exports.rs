//! Takes as files for other programs.

use std::fmt;
use std::ops::ControlFlow;

use armature_formats::GlbMesh;
use armature_take::{ExportError, ExportSettings, Surface, Take, TakeMotion, export_bvh, export_glb};

use crate::engine::actor::Actor;
use crate::failure::Failure;

/// The format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// Skeleton and motion as text.
    Bvh,
    /// Skinned mesh, skeleton and animation.
    Glb,
}

/// A file's bytes and what is in it.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file.
    pub bytes: Vec<u8>,
    /// Frames of the motion.
    pub frames: usize,
    /// Frames a second.
    pub fps: f64,
    /// Bones.
    pub bones: usize,
    /// What in the motion was not measured, in sentences.
    pub notes: Vec<String>,
}

impl fmt::Display for Exported {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} frames at {} a second, {} bones, {} bytes", self.frames, self.fps, self.bones, self.bytes.len())
    }
}

/// Exports a take. A GLB needs the character; a bare skeleton gives a GLB without a mesh.
pub fn export(
    take: &Take,
    actor: Option<&Actor>,
    target: Target,
    settings: &ExportSettings,
    progress: &mut dyn FnMut(f32) -> ControlFlow<()>,
) -> Result<Exported, Failure> {
    let (bytes, taken) = match target {
        Target::Bvh => {
            let exported = export_bvh(take, settings, progress).map_err(|e| failure(&e))?;
            (exported.file.into_bytes(), exported.motion)
        }
        Target::Glb => {
            let surface = actor.and_then(|a| a.character.as_ref()).map(|c| Surface {
                skeleton: &c.skeleton,
                mesh: GlbMesh {
                    mesh: &c.mesh,
                    split: None,
                    normals: Some(&c.normals),
                    texture_coordinates: c.texture_coordinates.as_deref(),
                    influences: Some(&c.influences),
                    base_color: Some(c.base_color),
                    texture: c.texture.as_ref(),
                },
            });
            let exported = export_glb(take, surface.as_ref(), "take", settings, progress).map_err(|e| failure(&e))?;
            (exported.file, exported.motion)
        }
    };
    let motion = &taken.resampled.motion;
    Ok(Exported {
        bytes,
        frames: motion.frames.len(),
        fps: settings.resample.frames_per_second,
        bones: motion.skeleton.len(),
        notes: notes(&taken),
    })
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
        notes.push(format!("the device started anew {} times in this take", taken.timeline.restarts.len()));
    }
    notes
}
