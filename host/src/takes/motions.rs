//! Motion files of other programs as takes.

use std::path::Path;

use armature_rig::Motion;
use armature_take::{FrameRate, Header, Take, motion_take};

use crate::failure::Failure;
use crate::files;
use crate::files::inputs::{self, Figure};
use crate::terminal::aside;

/// Rates that differ by less are the same: files round the seconds of a frame.
const SAME_RATE: f64 = 1e-4;
/// The denominator of a rate that is none of film and video.
const PARTS: f64 = 1000.0;

/// Whether a file is a motion of another program by its name.
pub fn is_motion(path: &Path) -> bool {
    matches!(files::extension_of(path).as_str(), "bvh" | "fbx" | "glb" | "gltf" | "vrm")
}

/// Reads a motion file. `clip`: which one, if there are several. Files round the seconds of a frame: where a rate of film
/// or video is meant, it has that exactly.
pub fn read(path: &Path, clip: Option<&str>) -> Result<Motion, Failure> {
    let mut motion = read_as_written(path, clip)?;
    if let Some(rate) = rate_of(motion.frame_seconds) {
        motion.frame_seconds = 1.0 / rate.frames_per_second();
    }
    Ok(motion)
}

fn read_as_written(path: &Path, clip: Option<&str>) -> Result<Motion, Failure> {
    let name = path.display();
    if files::extension_of(path) == "bvh" {
        let read = inputs::motion(path)?;
        read.warnings.iter().for_each(|warning| aside!("note: {name}: {warning}"));
        return match clip {
            None => Ok(read.motion),
            Some(_) => Err(Failure::usage(format!("{name} has one motion"), "leave out --clip")),
        };
    }
    let clips = match inputs::figure(path)? {
        Figure::Model(model) => model.motions,
        Figure::Bones(bones) => bones.motions,
    };
    let names: Vec<String> = clips.iter().map(|(name, _)| format!("{name:?}")).collect();
    let found = match clip {
        None => clips.into_iter().next(),
        Some(wanted) => clips.into_iter().find(|(own, _)| own == wanted),
    };
    match (found, clip) {
        (Some((_, motion)), Some(_)) => Ok(motion),
        (Some((_, motion)), None) => {
            if names.len() > 1 {
                aside!("note: {name} has several clips; this is {}, of {}", names[0], names.join(", "));
            }
            Ok(motion)
        }
        (None, Some(wanted)) => {
            Err(Failure::usage(format!("{name} has no clip {wanted:?}"), format!("it has {}", names.join(", "))))
        }
        (None, None) => Err(Failure::input(format!("{name} has no animation"), "choose a file with one")),
    }
}

/// A motion file as a take whose character is the file itself.
pub fn read_as_take(path: &Path) -> Result<Take, Failure> {
    let motion = read(path, None)?;
    let header = Header {
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        character_name: files::name_of(path),
        ..Header::default()
    };
    motion_take(&motion, &header).map_err(|e| Failure::input(format!("{}: {e}", path.display()), ""))
}

/// The rate of a motion: one of film and video where it is meant; `None` if it is not from 1 to 4000 frames a second.
pub fn rate_of(frame_seconds: f64) -> Option<FrameRate> {
    let near = 1.0 / frame_seconds;
    let whole = near.round();
    let known = [(whole, 1), ((near * 1.001).round() * PARTS, 1001)];
    let is_meant = |(frames, seconds): &&(f64, u32)| (frames / f64::from(*seconds) / near - 1.0).abs() < SAME_RATE;
    match known.iter().find(is_meant) {
        Some((frames, seconds)) => FrameRate::new(*frames as u32, *seconds),
        None => FrameRate::new((near * PARTS).round() as u32, PARTS as u32),
    }
}
