//! Fewer keys, with a bound on what that changes.
//!
//! Every frame of the motion stays within the bound of what a program reads from the keys: rotations by an angle,
//! translations and the feet by a length. [`KeyInterpolation::Linear`] has the fewest keys that any choice of frames
//! allows; [`KeyInterpolation::Cubic`] has few.

mod cubic;
mod curve;
mod feet;
mod linear;
mod path;

use std::ops::ControlFlow;

use armature_formats::motion::{KeyInterpolation, KeyTrack, KeyedPart};
use armature_rig::{Motion, Pose, Skeleton, Transform};
use glam::{DVec4, Quat, Vec3};

use self::cubic::{Spline, few_cubic_keys};
use self::curve::{Curve, Rotations, Vectors};
use self::linear::fewest_linear_keys;

/// Where no distance is given, translations may differ by this share of the skeleton's size.
const TRANSLATION_SHARE: f64 = 1e-3;
/// Scales may differ by this.
const SCALE_BOUND: f64 = 1e-3;
/// What is kept of the bounds for the rounding of a file's single precision.
const ROUNDING: f64 = 2e-6;
/// How often the bounds of the bones above a foot are halved before all their frames become keys.
const HALVINGS: u32 = 10;

/// How to reduce keys.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeySettings {
    /// What is between keys.
    pub interpolation: KeyInterpolation,
    /// By how much a bone's rotation may differ at any frame, radians.
    pub rotation: f64,
    /// By how much a foot's place may differ at any frame, in the skeleton's unit; feet are the ends of chains that are
    /// on the ground in the rest pose. `None`: not limited.
    pub feet: Option<f64>,
}

impl Default for KeySettings {
    fn default() -> Self {
        Self { interpolation: KeyInterpolation::Linear, rotation: 0.5_f64.to_radians(), feet: None }
    }
}

/// Why keys cannot be reduced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum KeyError {
    /// A bound is no positive number.
    #[error("{value} is not a bound for {what}; give a positive number")]
    BadBound {
        /// Of what.
        what: &'static str,
        /// The value given.
        value: f64,
    },
    /// Single precision alone moves a foot further.
    #[error(
        "the feet cannot be kept within {bound}: single precision moves {bone:?} by {moved:.3e}; give a larger bound"
    )]
    FeetTooStrict {
        /// The bound given.
        bound: f64,
        /// The foot.
        bone: String,
        /// By how much it moves with a key at every frame.
        moved: f64,
    },
    /// The callback asked to stop.
    #[error("the reduction of keys was cancelled")]
    Cancelled,
}

/// Keys for a motion, and what they change.
#[derive(Clone, Debug, PartialEq)]
pub struct ReducedKeys {
    /// The keys of everything that moves.
    pub tracks: Vec<KeyTrack>,
    /// What was saved and changed.
    pub report: KeyReport,
}

/// What was saved and changed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeyReport {
    /// Keys of all tracks.
    pub keys: usize,
    /// Keys of the same tracks with one at every frame.
    pub keys_before: usize,
    /// Fewest keys with straight lines between them and the same bounds; the same as `keys` where those were asked for.
    pub fewest_linear: usize,
    /// Largest difference of a rotation at any frame, radians.
    pub rotation: f64,
    /// Largest difference of a translation.
    pub translation: f64,
    /// Largest difference of a foot's place, and its bone; `None` where feet are not limited.
    pub feet: Option<(f64, String)>,
    /// Share of the splines that reach over two frames or less.
    pub short_splines: f64,
}

impl KeyReport {
    /// Why cubic splines need more than half of the keys that lines need; `None` if they do not.
    pub fn why_not_half(&self) -> Option<String> {
        (2 * self.keys > self.fewest_linear).then(|| {
            format!(
                "splines save less than half of the keys that lines need ({} of {}): {:.0} % of them reach over two \
                 frames or less, because the motion changes faster there than a cubic can follow within the bound",
                self.keys,
                self.fewest_linear,
                100.0 * self.short_splines
            )
        })
    }
}

/// Reduces the keys of a motion. Bones at rest throughout have no track, and what never changes has one key.
///
/// `progress` is called with the current stage and the fraction done, 0 to 1, and can stop the work with
/// [`ControlFlow::Break`].
pub fn reduce_keys(
    motion: &Motion,
    settings: &KeySettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<ReducedKeys, KeyError> {
    let bounds = [("rotations", Some(settings.rotation)), ("feet", settings.feet)];
    for (what, value) in bounds.into_iter().filter_map(|(what, value)| Some((what, value?))) {
        if !(value.is_finite() && value > 0.0) {
            return Err(KeyError::BadBound { what, value });
        }
    }
    let times = key_times(motion);
    let translation = settings.feet.unwrap_or_else(|| TRANSLATION_SHARE * feet::size(&motion.skeleton));
    let full = [translation, settings.rotation, SCALE_BOUND];
    let mut bones: Vec<ReducedBone> = Vec::with_capacity(motion.skeleton.len());
    for bone in 0..motion.skeleton.len() {
        let reduced = ReducedBone::new(motion, &times, bone, full, settings.interpolation);
        bones.push(reduced);
        if progress("reducing keys", (bone + 1) as f64 / motion.skeleton.len() as f64).is_break() {
            return Err(KeyError::Cancelled);
        }
    }
    let feet = match settings.feet {
        Some(bound) => {
            let again = |bone: usize, share: f64| {
                let bounds = if share > 0.0 { full.map(|bound| bound * share) } else { [0.0; 3] };
                ReducedBone::new(motion, &times, bone, bounds, settings.interpolation)
            };
            feet::keep_feet(motion, bound, &mut bones, &again, progress)?
        }
        None => None,
    };
    let fewest_linear = match settings.interpolation {
        KeyInterpolation::Linear => None,
        KeyInterpolation::Cubic => Some(linear_count(motion, &times, &bones)),
    };
    Ok(finish(bones, motion.frames.len(), feet, fewest_linear))
}

/// The time of each frame as a file holds it.
fn key_times(motion: &Motion) -> Vec<f64> {
    (0..motion.frames.len()).map(|frame| f64::from((frame as f64 * motion.frame_seconds) as f32)).collect()
}

/// The tracks of one bone, and its transforms as a program reads them from the keys.
#[derive(Debug)]
struct ReducedBone {
    tracks: Vec<ReducedTrack>,
    /// One for each frame.
    read: Vec<Transform>,
    /// The bounds that it was reduced with: translation, rotation, scale.
    bounds: [f64; 3],
}

#[derive(Debug)]
struct ReducedTrack {
    track: KeyTrack,
    /// Largest distance from a frame.
    off: f64,
    short_splines: usize,
}

impl ReducedBone {
    fn new(motion: &Motion, times: &[f64], bone: usize, bounds: [f64; 3], kind: KeyInterpolation) -> Self {
        let rest = motion.skeleton.bones()[bone].rest;
        let mut read: Vec<Transform> = motion.frames.iter().map(|pose| pose.parent_from_bone[bone]).collect();
        let own = read.clone();
        let mut tracks = Vec::new();
        let vector = |part: KeyedPart, of: fn(&Transform) -> Vec3, bound: f64| {
            let moves = own.iter().any(|t| of(t) != of(&rest));
            moves.then(|| reduce(&Vectors::new(times, own.iter().map(of)), bone, part, bound, kind))
        };
        if let Some((track, values)) = vector(KeyedPart::Translation, |t| t.translation, bounds[0]) {
            tracks.push(track);
            read.iter_mut().zip(values).for_each(|(read, v)| read.translation = v.truncate().as_vec3());
        }
        // A clip needs a track, even if nothing moves.
        if bone == 0 || own.iter().any(|t| t.rotation != rest.rotation) {
            let curve = Rotations::new(times, own.iter().map(|t| t.rotation));
            let (track, values) = reduce(&curve, bone, KeyedPart::Rotation, bounds[1], kind);
            tracks.push(track);
            read.iter_mut().zip(values).for_each(|(read, v)| read.rotation = Quat::from_vec4(v.normalize().as_vec4()));
        }
        if let Some((track, values)) = vector(KeyedPart::Scale, |t| t.scale, bounds[2]) {
            tracks.push(track);
            read.iter_mut().zip(values).for_each(|(read, v)| read.scale = v.truncate().as_vec3());
        }
        Self { tracks, read, bounds }
    }
}

/// One track reaches to the last frame even if nothing moves, so that the clip keeps its length.
fn carries_the_end(bone: usize, part: KeyedPart) -> bool {
    bone == 0 && part == KeyedPart::Rotation
}

/// The keys of one curve, and its values at every frame as read from them.
fn reduce(
    curve: &impl Curve,
    bone: usize,
    part: KeyedPart,
    bound: f64,
    kind: KeyInterpolation,
) -> (ReducedTrack, Vec<DVec4>) {
    let last = curve.len().saturating_sub(1);
    let slack = bound - ROUNDING.min(0.5 * bound);
    let (keys, splines) = if bound <= 0.0 {
        ((0..=last).collect(), Vec::new())
    } else if !carries_the_end(bone, part) && (0..=last).all(|frame| curve.distance(curve.value(0), frame) <= slack) {
        (vec![0], Vec::new())
    } else {
        match kind {
            KeyInterpolation::Linear => (fewest_linear_keys(curve, slack), Vec::new()),
            KeyInterpolation::Cubic => few_cubic_keys(curve, slack),
        }
    };
    let read = values(curve, &keys, &splines);
    let off = read.iter().enumerate().map(|(frame, value)| curve.distance(*value, frame)).fold(0.0, f64::max);
    let single = |value: DVec4| value.as_vec4().to_array();
    let mut out = Vec::new();
    let interpolation = if splines.is_empty() { KeyInterpolation::Linear } else { kind };
    for (index, &key) in keys.iter().enumerate() {
        let value = single(curve.value(key));
        match interpolation {
            KeyInterpolation::Linear => out.push(value),
            KeyInterpolation::Cubic => {
                let before = index.checked_sub(1).map_or(DVec4::ZERO, |before| splines[before].tangents[1]);
                let after = splines.get(index).map_or(DVec4::ZERO, |spline| spline.tangents[0]);
                out.extend([single(before), value, single(after)]);
            }
        }
    }
    let times = keys.iter().map(|&key| curve.times()[key] as f32).collect();
    let short_splines = keys.windows(2).filter(|pair| !splines.is_empty() && pair[1] - pair[0] <= 2).count();
    (ReducedTrack { track: KeyTrack { bone, part, interpolation, times, values: out }, off, short_splines }, read)
}

fn values(curve: &impl Curve, keys: &[usize], splines: &[Spline]) -> Vec<DVec4> {
    let at = |frame: usize| {
        let after = keys.partition_point(|&key| key <= frame);
        match (after.checked_sub(1).map(|before| keys[before]), keys.get(after)) {
            (Some(from), Some(&to)) if from < frame => match splines.get(after - 1) {
                Some(spline) => spline.at(curve, from, to, frame),
                None => curve.between(from, to, curve.part(from, to, frame)),
            },
            (Some(from), _) => curve.value(from),
            (None, _) => curve.value(keys[0]),
        }
    };
    (0..curve.len()).map(at).collect()
}

/// Keys of lines with the bounds that the bones were reduced with in the end.
fn linear_count(motion: &Motion, times: &[f64], bones: &[ReducedBone]) -> usize {
    let count = |(bone, reduced): (usize, &ReducedBone)| {
        let linear = ReducedBone::new(motion, times, bone, reduced.bounds, KeyInterpolation::Linear);
        linear.tracks.iter().map(|track| track.track.times.len()).sum::<usize>()
    };
    bones.iter().enumerate().map(count).sum()
}

fn finish(
    bones: Vec<ReducedBone>,
    frames: usize,
    feet: Option<(f64, String)>,
    fewest_linear: Option<usize>,
) -> ReducedKeys {
    let all = || bones.iter().flat_map(|bone| &bone.tracks);
    let keys: usize = all().map(|track| track.track.times.len()).sum();
    let largest = |part: KeyedPart| all().filter(|t| t.track.part == part).map(|t| t.off).fold(0.0, f64::max);
    let splines: usize = all()
        .filter(|track| track.track.interpolation == KeyInterpolation::Cubic)
        .map(|track| track.track.times.len() - 1)
        .sum();
    let short: usize = all().map(|track| track.short_splines).sum();
    let report = KeyReport {
        keys,
        keys_before: all().count() * frames,
        fewest_linear: fewest_linear.unwrap_or(keys),
        rotation: largest(KeyedPart::Rotation),
        translation: largest(KeyedPart::Translation),
        feet,
        short_splines: if splines > 0 { short as f64 / splines as f64 } else { 0.0 },
    };
    ReducedKeys { tracks: bones.into_iter().flat_map(|bone| bone.tracks).map(|track| track.track).collect(), report }
}

/// The pose of a frame as read from the keys.
fn read_pose(bones: &[ReducedBone], frame: usize, skeleton: &Skeleton) -> Pose {
    let transforms = bones.iter().zip(skeleton.bones());
    Pose { parent_from_bone: transforms.map(|(bone, own)| bone.read.get(frame).copied().unwrap_or(own.rest)).collect() }
}
