//! The JSON link: one object for each pose, for any skeleton.
//!
//! ```json
//! {"human": {"Version": 1, "Time": 12.345, "Bone": [
//!   {"Name": "hips", "Parent": -1, "Location": [0, 0.95, 0], "Rotation": [0, 0, 0, 1], "Scale": [1, 1, 1],
//!    "Turn": [0, 0, 0, 1], "Shift": [0, 0, 0], "Humanoid": "hips"}], "Parameter": [{"Name": "blink", "Value": 0.5}]}}
//! ```
//!
//! `Location`, `Rotation` (x, y, z, w) and `Scale` are in the parent's space (a root's in model space). `Turn` and `Shift`
//! compare with the rest pose, in model space: what a receiver needs whose rig has other axes and lengths. `Parameter`: the
//! weights of blend shapes that are set by hand or by joints, 0 for not at all and 1 for wholly. Additional
//! keys may come with later versions; `Version` rises when one changes its meaning.

use glam::{Quat, Vec3};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};

use super::skeleton::{StreamedPose, StreamedSkeleton};

/// The version of this format.
pub(super) const VERSION: u32 = 1;

struct Message<'a> {
    skeleton: &'a StreamedSkeleton,
    pose: &'a StreamedPose,
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Subject<'a> {
    version: u32,
    time: f64,
    bone: Vec<Bone<'a>>,
    parameter: Vec<Parameter<'a>>,
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Bone<'a> {
    name: &'a str,
    parent: i64,
    location: [f32; 3],
    rotation: [f32; 4],
    scale: [f32; 3],
    turn: [f32; 4],
    shift: [f32; 3],
    #[serde(skip_serializing_if = "Option::is_none")]
    humanoid: Option<String>,
}

#[derive(Serialize)]
#[serde(rename_all = "PascalCase")]
struct Parameter<'a> {
    name: &'a str,
    value: f32,
}

impl Serialize for Message<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { skeleton, pose } = self;
        let bone = |index: usize| {
            let bone = &skeleton.bones[index];
            let (scale, rotation, location) = skeleton.parent_from_bone(index, pose).to_scale_rotation_translation();
            Bone {
                name: &bone.name,
                parent: bone.parent.map_or(-1, |parent| parent as i64),
                location: rounded(location),
                rotation: rounded_turn(rotation),
                scale: rounded(scale),
                turn: rounded_turn(skeleton.turn(index, pose)),
                shift: rounded(skeleton.shift(index, pose)),
                humanoid: bone.humanoid.map(|humanoid| humanoid.to_string()),
            }
        };
        let subject = Subject {
            version: VERSION,
            time: pose.seconds,
            bone: (0..skeleton.bones.len()).map(bone).collect(),
            parameter: pose.shapes.iter().map(|(name, value)| Parameter { name, value: round(value) }).collect(),
        };
        let mut map = serializer.serialize_map(Some(1))?;
        map.serialize_entry(&skeleton.subject, &subject)?;
        map.end()
    }
}

/// A pose as text.
pub(super) fn message(skeleton: &StreamedSkeleton, pose: &StreamedPose) -> String {
    // Maps with text as keys and numbers that are finite or null: nothing that could fail.
    serde_json::to_string(&Message { skeleton, pose }).unwrap_or_default()
}

/// Six digits after the point: less than a thousandth of a millimetre, and half as many bytes.
fn rounded(vector: Vec3) -> [f32; 3] {
    vector.to_array().map(round)
}

fn rounded_turn(rotation: Quat) -> [f32; 4] {
    let rotation = if rotation.is_finite() { rotation } else { Quat::IDENTITY };
    rotation.to_array().map(round)
}

fn round(number: f32) -> f32 {
    // Adding zero turns a negative zero into a positive one.
    ((f64::from(number) * 1e6).round() / 1e6) as f32 + 0.0
}
