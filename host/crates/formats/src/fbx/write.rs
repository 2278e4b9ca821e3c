//! From skinned meshes, skeleton and clips to FBX.

use super::write_clip::{rate_settings, ticks, write_clip};
use super::write_document::{Document, Node, enum_property, property, time_property};
use super::write_mesh::write_surface;
use super::write_skeleton::{write_bind_pose, write_skeleton};
use crate::FormatError;
use crate::gltf::scene::bad;
use crate::gltf::write_skin::rest_frames;
use crate::gltf::{GlbScene, GlbTimes};

/// Centimetres in a unit of ours.
const METRE: f64 = 100.0;
/// The rate of a scene without clips of even frames.
const USUAL_FRAME_SECONDS: f64 = 1.0 / 30.0;

/// What an FBX file says besides its scene.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FbxNotes {
    /// Names and texts that the armature carries; programs show them as properties of an artist's own.
    pub properties: Vec<(String, String)>,
    /// Whether 29.97 frames a second are numbered as drop frame.
    pub drops_numbers: bool,
}

/// An FBX file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FbxFile {
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// What the format has no place for, in sentences.
    pub left_out: Vec<String>,
}

/// Writes a scene as binary FBX 7.4: metres, +Y up, facing +Z. The bones are limbs with joint rotations of zero at rest
/// (the rest is their pre-rotation), below a node named after the character; meshes have a skin with one cluster for each
/// bone they follow, one blend shape channel for each morph target, and their materials with the images in the file.
/// Clips are animation stacks with a key for each pose, also of the blend shapes that change, in the format's own ticks, 46,186,158,000 a second; the scene has
/// the rate of the first.
///
/// ```
/// use armature_formats::fbx::{FbxNotes, read_fbx_skeleton, write_fbx};
/// use armature_formats::gltf::{GlbClip, GlbScene};
/// use armature_rig::{Bone, Motion, Skeleton, Transform};
///
/// let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
/// let skeleton = Skeleton::new(vec![bone]).unwrap();
/// let mut frames = vec![skeleton.rest_pose(); 2];
/// frames[1].parent_from_bone[0].translation.x = 0.5;
/// let motion = Motion::new(skeleton, 0.5, frames).unwrap();
/// let clips = vec![GlbClip::of_motion("wave", &motion)];
/// let scene = GlbScene { name: "robot", skeleton: &motion.skeleton, mesh: None, clips };
/// let file = write_fbx(&scene, &FbxNotes::default())?;
/// let again = read_fbx_skeleton("robot.fbx", &file.bytes)?;
/// assert_eq!(again.skeleton.bones()[0].name, "arm");
/// assert_eq!(again.motions[0].1.duration_seconds(), 0.5);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn write_fbx(scene: &GlbScene, notes: &FbxNotes) -> Result<FbxFile, FormatError> {
    file_of(scene, notes).map_err(|error| error.in_file("FBX"))
}

fn file_of(scene: &GlbScene, notes: &FbxNotes) -> Result<FbxFile, FormatError> {
    if scene.skeleton.is_empty() && scene.mesh.is_none() {
        return Err(bad("there is neither a mesh nor a skeleton to write", "Export a character"));
    }
    let mut document = Document::new();
    let mut left_out = Vec::new();
    let limbs = write_skeleton(&mut document, &format!("{}_skeleton", scene.name), scene.skeleton, &notes.properties);
    let surface = write_surface(&mut document, scene, &limbs, &mut left_out)?;
    let mut bound = surface.models;
    bound.extend(limbs.iter().copied().zip(rest_frames(scene.skeleton)));
    write_bind_pose(&mut document, scene.name, &bound);
    let mut takes = Vec::new();
    for clip in &scene.clips {
        takes.push(write_clip(&mut document, scene, clip, &limbs, &surface.channels)?);
    }
    let even = scene.clips.iter().find_map(|clip| match clip.times {
        GlbTimes::EverySeconds(seconds) => Some((seconds, clip.keys())),
        GlbTimes::At(_) => None,
    });
    let (frame_seconds, frames) = even.unwrap_or((USUAL_FRAME_SECONDS, 1));
    let mut settings = axes_and_unit();
    settings.extend(rate_settings(frame_seconds, notes.drops_numbers));
    settings.push(time_property("TimeSpanStart", 0));
    settings.push(time_property("TimeSpanStop", ticks(frames.saturating_sub(1) as f64 * frame_seconds)));
    let current = scene.clips.first().map_or("", |clip| clip.name);
    Ok(FbxFile { bytes: document.finish(settings, takes, current)?, left_out })
}

fn axes_and_unit() -> Vec<Node> {
    let int = |name, value: i32| property(name, ["int", "Integer", ""], vec![value.into()]);
    let unit = |name| property(name, ["double", "Number", ""], vec![METRE.into()]);
    vec![
        int("UpAxis", 1),
        int("UpAxisSign", 1),
        int("FrontAxis", 2),
        int("FrontAxisSign", 1),
        int("CoordAxis", 0),
        int("CoordAxisSign", 1),
        int("OriginalUpAxis", 1),
        int("OriginalUpAxisSign", 1),
        unit("UnitScaleFactor"),
        unit("OriginalUnitScaleFactor"),
        enum_property("TimeProtocol", 2),
    ]
}
