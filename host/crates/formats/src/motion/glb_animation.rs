//! Animations with keys of their own for each bone, and notes on animations, in a GLB that is there already.
//!
//! Everything else in the file stays as it is, byte for byte where numbers are concerned.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde_json::value::{RawValue, to_raw_value};
use serde_json::{Value, json};

use crate::FormatError;

/// What is between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum KeyInterpolation {
    /// A straight line; for rotations the shorter great arc.
    #[default]
    Linear,
    /// A cubic Hermite spline.
    Cubic,
}

/// Which part of a bone's transform a track moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KeyedPart {
    /// `parent_from_bone` translation.
    Translation,
    /// `parent_from_bone` rotation.
    Rotation,
    /// `parent_from_bone` scale.
    Scale,
}

/// Keys of one part of one bone.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyTrack {
    /// Zero-based bone of the file's first skin.
    pub bone: usize,
    /// What moves.
    pub part: KeyedPart,
    /// What is between keys.
    pub interpolation: KeyInterpolation,
    /// Seconds of each key, increasing.
    pub times: Vec<f32>,
    /// A value for each key: quaternion (x, y, z, w), or three numbers and a zero. With cubic splines three for each
    /// key: in-tangent, value, out-tangent, tangents a second.
    pub values: Vec<[f32; 4]>,
}

const REMEDY: &str = "Export it again";

fn bad(what: impl Into<String>) -> FormatError {
    FormatError::whole("GLB", what, REMEDY)
}

/// A GLB with one more animation, of these tracks, on the bones of its first skin. An animation of that name that is there
/// already gets them in addition to what it moves.
///
/// ```
/// use armature_formats::gltf::{GlbScene, write_glb};
/// use armature_formats::motion::{KeyInterpolation, KeyTrack, KeyedPart, add_clip};
/// use armature_rig::{Bone, Skeleton, Transform};
///
/// let bone = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: [0.0, 1.0, 0.0].into() };
/// let skeleton = Skeleton::new(vec![bone]).unwrap();
/// let still = write_glb(&GlbScene { name: "robot", skeleton: &skeleton, mesh: None, clips: vec![] })?;
/// let (s, c) = 0.5_f32.sin_cos();
/// let values = vec![[0.0, 0.0, 0.0, 1.0], [s, 0.0, 0.0, c]];
/// let track = KeyTrack {
///     bone: 0,
///     part: KeyedPart::Rotation,
///     interpolation: KeyInterpolation::Linear,
///     times: vec![0.0, 1.0],
///     values,
/// };
/// let moving = add_clip(&still, "wave", &[track])?;
/// assert!(moving.len() > still.len());
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn add_clip(glb: &[u8], name: &str, tracks: &[KeyTrack]) -> Result<Vec<u8>, FormatError> {
    if tracks.is_empty() {
        return Err(bad(format!("the clip {name:?} moves nothing")));
    }
    let mut file = File::read(glb)?;
    let skins: Vec<Skin> = file.list("skins")?;
    let joints = &skins.first().ok_or_else(|| bad("the file has no bones"))?.joints;
    let mut inputs: BTreeMap<Vec<u32>, usize> = BTreeMap::new();
    let mut animations: Vec<Box<RawValue>> = file.list("animations")?;
    let parsed = animations.iter().map(|text| parse::<Value>(text)).collect::<Result<Vec<_>, _>>()?;
    let known = parsed.iter().position(|animation| animation["name"] == name);
    let list = |key: &str| known.and_then(|at| parsed[at][key].as_array().cloned()).unwrap_or_default();
    let (mut samplers, mut channels) = (list("samplers"), list("channels"));
    for track in tracks {
        check(name, track)?;
        let node = joints.get(track.bone).ok_or_else(|| bad(format!("the file has no bone {}", track.bone)))?;
        let bits: Vec<u32> = track.times.iter().map(|time| time.to_bits()).collect();
        let input = if let Some(&input) = inputs.get(&bits) {
            input
        } else {
            let times: Vec<[f32; 1]> = track.times.iter().map(|&time| [time]).collect();
            let input = file.floats(&times, "SCALAR")?;
            inputs.insert(bits, input);
            input
        };
        let three = || track.values.iter().map(|&[x, y, z, _]| [x, y, z]).collect::<Vec<_>>();
        let (path, output) = match track.part {
            KeyedPart::Translation => ("translation", file.floats(&three(), "VEC3")?),
            KeyedPart::Rotation => ("rotation", file.floats(&track.values, "VEC4")?),
            KeyedPart::Scale => ("scale", file.floats(&three(), "VEC3")?),
        };
        let interpolation = match track.interpolation {
            KeyInterpolation::Linear => "LINEAR",
            KeyInterpolation::Cubic => "CUBICSPLINE",
        };
        channels.push(json!({"sampler": samplers.len(), "target": {"node": node, "path": path}}));
        samplers.push(json!({"input": input, "output": output, "interpolation": interpolation}));
    }
    let animation = raw(&json!({"name": name, "samplers": samplers, "channels": channels}))?;
    match known {
        Some(at) => animations[at] = animation,
        None => animations.push(animation),
    }
    file.set("animations", &animations)?;
    file.write()
}

/// A GLB whose animations all have these `extras`, the place that glTF has for what it does not define.
pub fn annotate_clips(glb: &[u8], extras: &Value) -> Result<Vec<u8>, FormatError> {
    let mut file = File::read(glb)?;
    let mut animations: Vec<Entries> = file.list("animations")?;
    for animation in &mut animations {
        animation.insert("extras".into(), raw(extras)?);
    }
    file.set("animations", &animations)?;
    file.write()
}

fn check(name: &str, track: &KeyTrack) -> Result<(), FormatError> {
    let each = if track.interpolation == KeyInterpolation::Cubic { 3 } else { 1 };
    let rising = track.times.windows(2).all(|pair| pair[0] < pair[1]);
    let finite = track.times.iter().all(|time| time.is_finite() && *time >= 0.0)
        && track.values.iter().flatten().all(|number| number.is_finite());
    if track.times.is_empty() || track.values.len() != each * track.times.len() || !rising || !finite {
        return Err(bad(format!("the clip {name:?} has keys that do not fit or do not rise, for bone {}", track.bone)));
    }
    Ok(())
}

type Entries = BTreeMap<String, Box<RawValue>>;

#[derive(serde::Deserialize)]
struct Skin {
    joints: Vec<usize>,
}

fn raw(value: &impl serde::Serialize) -> Result<Box<RawValue>, FormatError> {
    to_raw_value(value).map_err(|error| bad(error.to_string()))
}

fn parse<T: DeserializeOwned>(text: &RawValue) -> Result<T, FormatError> {
    serde_json::from_str(text.get()).map_err(|error| bad(format!("its description cannot be read: {error}")))
}

/// A GLB whose description is kept as text, entry by entry.
pub(super) struct File {
    entries: Entries,
    binary: Vec<u8>,
}

impl File {
    pub(super) fn read(glb: &[u8]) -> Result<Self, FormatError> {
        let glb = gltf::binary::Glb::from_slice(glb).map_err(|error| bad(error.to_string()))?;
        let entries = serde_json::from_slice(&glb.json).map_err(|error| bad(error.to_string()))?;
        Ok(Self { entries, binary: glb.bin.map(Cow::into_owned).unwrap_or_default() })
    }

    fn list<T: DeserializeOwned>(&self, key: &str) -> Result<Vec<T>, FormatError> {
        self.entries.get(key).map_or(Ok(Vec::new()), |text| parse(text))
    }

    pub(super) fn set(&mut self, key: &str, value: &impl serde::Serialize) -> Result<(), FormatError> {
        self.entries.insert(key.to_owned(), raw(value)?);
        Ok(())
    }

    /// Adds to a list and returns the new entry's index.
    fn append(&mut self, key: &str, value: &Value) -> Result<usize, FormatError> {
        let mut list: Vec<Box<RawValue>> = self.list(key)?;
        list.push(raw(value)?);
        self.set(key, &list)?;
        Ok(list.len() - 1)
    }

    /// Appends numbers with their bounds, and returns their accessor.
    fn floats<const N: usize>(&mut self, values: &[[f32; N]], shape: &str) -> Result<usize, FormatError> {
        self.binary.resize(self.binary.len().next_multiple_of(4), 0);
        let start = self.binary.len();
        self.binary.extend(values.iter().flatten().flat_map(|number| number.to_le_bytes()));
        let length = self.binary.len() - start;
        let view = self.append("bufferViews", &json!({"buffer": 0, "byteOffset": start, "byteLength": length}))?;
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f64> {
            let all = |k: usize| values.iter().map(|value| value[k]).reduce(pick).unwrap_or(0.0);
            (0..N).map(|k| f64::from(all(k))).collect()
        };
        let accessor = json!({
            "bufferView": view, "componentType": 5126, "count": values.len(), "type": shape,
            "min": bound(f32::min), "max": bound(f32::max),
        });
        self.append("accessors", &accessor)
    }

    pub(super) fn write(mut self) -> Result<Vec<u8>, FormatError> {
        let mut buffers: Vec<Entries> = self.list("buffers")?;
        if !self.binary.is_empty() {
            if buffers.is_empty() {
                buffers.push(Entries::new());
            }
            buffers[0].insert("byteLength".into(), raw(&self.binary.len())?);
            self.set("buffers", &buffers)?;
        }
        let json = serde_json::to_vec(&self.entries).map_err(|error| bad(error.to_string()))?;
        let length = u32::try_from(json.len() + self.binary.len() + 64)
            .map_err(|_| FormatError::whole("GLB", "the file would be longer than 4 GB", "Export a shorter take"))?;
        let glb = gltf::binary::Glb {
            header: gltf::binary::Header { magic: *b"glTF", version: 2, length },
            json: Cow::Owned(json),
            bin: (!self.binary.is_empty()).then_some(Cow::Owned(self.binary)),
        };
        glb.to_vec().map_err(|error| bad(error.to_string()))
    }
}
