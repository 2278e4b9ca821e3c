//! Clips as animation stacks, and the rate of their frames.

use super::euler::nearest_angles;
use super::write_document::{
    Document, Id, Node, Value, enum_property, number_property, properties, property, time_property,
};
use super::write_mesh::ShapeChannel;
use super::write_skeleton::rest_rotation;
use crate::FormatError;
use crate::gltf::scene::bad;
use crate::gltf::write_clip::{check_poses, check_weights, clip_seconds};
use crate::gltf::{GlbClip, GlbScene};

/// The format's unit of time, in parts of a second: whole at every common rate.
pub(super) const TICKS: f64 = 46_186_158_000.0;
/// The format's numbers of rates, as fractions. The second number of a pair counts drop frames.
const RATES: [(i32, f64, f64); 14] = [
    (11, 24.0, 1.0),
    (13, 24_000.0, 1_001.0),
    (10, 25.0, 1.0),
    (6, 30.0, 1.0),
    (9, 30_000.0, 1_001.0),
    (5, 48.0, 1.0),
    (4, 50.0, 1.0),
    (3, 60.0, 1.0),
    (17, 60_000.0, 1_001.0),
    (16, 72.0, 1.0),
    (15, 96.0, 1.0),
    (2, 100.0, 1.0),
    (1, 120.0, 1.0),
    (18, 120_000.0, 1_001.0),
];
/// 29.97 frames a second with numbers left out.
const DROP_FRAME: i32 = 8;
/// A rate that the format has no number for.
const OTHER_RATE: i32 = 14;
/// Straight lines between keys.
const LINEAR: i32 = 4;
const KEY_VERSION: i32 = 4009;

/// The scene's rate: that of the frames, in seconds from one to the next.
pub(super) fn rate_settings(frame_seconds: f64, drops_numbers: bool) -> Vec<Node> {
    let same = |&&(_, frames, seconds): &&(i32, f64, f64)| (frame_seconds * frames / seconds - 1.0).abs() < 1e-9;
    let found = RATES.iter().find(same).map_or(OTHER_RATE, |(mode, ..)| *mode);
    let mode = if found == 9 && drops_numbers { DROP_FRAME } else { found };
    let custom = if mode == OTHER_RATE { 1.0 / frame_seconds } else { -1.0 };
    vec![enum_property("TimeMode", mode), property("CustomFrameRate", ["double", "Number", ""], vec![custom.into()])]
}

/// The ticks at a time in seconds.
pub(super) fn ticks(seconds: f64) -> i64 {
    libm::round(seconds * TICKS) as i64
}

/// Adds a clip and returns its entry in the list of takes; bones that stay at rest throughout get no curves.
#[expect(clippy::float_cmp, reason = "a shape that was never touched is at rest bit for bit")]
pub(super) fn write_clip(
    document: &mut Document,
    scene: &GlbScene,
    clip: &GlbClip,
    limbs: &[Id],
    channels: &[ShapeChannel],
) -> Result<Node, FormatError> {
    let skeleton = scene.skeleton;
    let seconds = clip_seconds(clip)?;
    check_poses(skeleton, clip)?;
    check_weights(scene.mesh.as_ref(), clip)?;
    let late = seconds.last().is_some_and(|last| *last * TICKS > (1_i64 << 62) as f64);
    if late {
        return Err(bad(format!("the clip {:?} is too long", clip.name), "Export a part of it"));
    }
    let mut times: Vec<i64> = seconds.into_iter().map(ticks).collect();
    for k in 1..times.len() {
        times[k] = times[k].max(times[k - 1] + 1);
    }
    let (first, last) = (times.first().copied().unwrap_or(0), times.last().copied().unwrap_or(0));
    let span = |names: [&str; 2]| [time_property(names[0], first), time_property(names[1], last)];
    let bounds = [span(["LocalStart", "LocalStop"]), span(["ReferenceStart", "ReferenceStop"])].concat();
    let stack = document.add("AnimationStack", [clip.name, "AnimStack"], "", vec![properties(bounds)]);
    let layer = document.add("AnimationLayer", ["BaseLayer", "AnimLayer"], "", vec![properties(Vec::new())]);
    document.connect(layer, stack);
    let curves = Curves { layer, times };
    for (index, bone) in skeleton.bones().iter().enumerate() {
        let limb = limbs[index];
        let track = || clip.poses.iter().map(move |pose| pose.parent_from_bone[index]);
        if track().any(|t| t.translation != bone.rest.translation) {
            let values: Vec<[f64; 3]> = track().map(|t| t.translation.as_dvec3().to_array()).collect();
            curves.write(document, limb, ["T", "Lcl Translation"], &values);
        }
        // A stack needs a curve, even if nothing moves.
        if !clip.poses.is_empty() && (index == 0 || track().any(|t| t.rotation != bone.rest.rotation)) {
            let at_rest = rest_rotation(bone).inverse();
            let mut angles = [0.0; 3];
            let values = track().map(|t| {
                angles = nearest_angles(at_rest * t.rotation.as_dquat().normalize(), angles);
                angles
            });
            let values: Vec<[f64; 3]> = values.collect();
            curves.write(document, limb, ["R", "Lcl Rotation"], &values);
        }
        if track().any(|t| t.scale != bone.rest.scale) {
            let values: Vec<[f64; 3]> = track().map(|t| t.scale.as_dvec3().to_array()).collect();
            curves.write(document, limb, ["S", "Lcl Scaling"], &values);
        }
    }
    for ShapeChannel { id, target } in channels {
        let rest = scene.mesh.map_or(0.0, |surface| surface.morph_targets[*target].default_weight);
        if clip.weights.iter().any(|row| row[*target] != rest) {
            let percents: Vec<f32> = clip.weights.iter().map(|row| 100.0 * row[*target]).collect();
            curves.write_percent(document, *id, percents);
        }
    }
    let time = |name| Node::new(name, vec![first.into(), last.into()]);
    let take = vec![Node::of("FileName", "take.tak"), time("LocalTime"), time("ReferenceTime")];
    Ok(Node::with("Take", vec![clip.name.into()], take))
}

/// What all curves of a clip share.
struct Curves {
    layer: Id,
    times: Vec<i64>,
}

impl Curves {
    fn write(&self, document: &mut Document, limb: Id, [short, property]: [&str; 2], values: &[[f64; 3]]) {
        let axes = ["d|X", "d|Y", "d|Z"];
        let start = values.first().copied().unwrap_or_default();
        let defaults = axes.iter().zip(start).map(|(axis, value)| number_property(axis, value)).collect();
        let node = document.add("AnimationCurveNode", [short, "AnimCurveNode"], "", vec![properties(defaults)]);
        document.connect(node, self.layer);
        document.connect_property(node, limb, property);
        for (k, axis) in axes.iter().enumerate() {
            let track: Vec<f32> = values.iter().map(|value| value[k] as f32).collect();
            self.write_curve(document, node, axis, start[k], track);
        }
    }

    /// The curve of a blend shape, percent.
    fn write_percent(&self, document: &mut Document, channel: Id, percents: Vec<f32>) {
        let start = f64::from(percents.first().copied().unwrap_or_default());
        let defaults = vec![number_property("d|DeformPercent", start)];
        let name = ["DeformPercent", "AnimCurveNode"];
        let node = document.add("AnimationCurveNode", name, "", vec![properties(defaults)]);
        document.connect(node, self.layer);
        document.connect_property(node, channel, "DeformPercent");
        self.write_curve(document, node, "d|DeformPercent", start, percents);
    }

    fn write_curve(&self, document: &mut Document, node: Id, property: &str, start: f64, values: Vec<f32>) {
        let children = vec![
            Node::of("Default", start),
            Node::of("KeyVer", KEY_VERSION),
            Node::of("KeyTime", Value::Longs(self.times.clone())),
            Node::of("KeyValueFloat", Value::Floats(values)),
            Node::of("KeyAttrFlags", Value::Ints(vec![LINEAR])),
            Node::of("KeyAttrDataFloat", Value::Floats(vec![0.0; 4])),
            Node::of("KeyAttrRefCount", Value::Ints(vec![self.times.len() as i32])),
        ];
        let curve = document.add("AnimationCurve", ["", "AnimCurve"], "", children);
        document.connect_property(curve, node, property);
    }
}
