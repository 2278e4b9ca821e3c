//! Clips as animations of a skeleton.

use armature_rig::{Skeleton, Transform};
use glam::Vec3;

use super::layer::{Layer, list, text, tuple, tuples};
use super::stage::Joints;
use super::write_mesh::Shape;
use crate::FormatError;
use crate::gltf::write_clip::{check_poses, check_weights, clip_seconds, continuous};
use crate::gltf::{GlbClip, GlbMesh, GlbTimes};

/// Rates within this relative difference are the same.
const SAME_RATE: f64 = 1e-9;
/// Scales may differ by this much in half precision without a word.
const UNSEEN: f32 = 1e-6;

/// A clip, its name in the file, and the time codes in a second.
pub(super) struct Timed<'a> {
    pub(super) clip: &'a GlbClip<'a>,
    pub(super) surface: Option<&'a GlbMesh<'a>>,
    pub(super) name: &'a str,
    pub(super) rate: f64,
}

/// Frames in a second: a whole number, or one over 1.001 as in video, where the seconds of a frame mean that.
pub(super) fn frames_per_second(frame_seconds: f64) -> f64 {
    let near = 1.0 / frame_seconds;
    let whole = libm::round(near);
    let video = libm::round(near * 1.001) * 1000.0 / 1001.0;
    [whole, video].into_iter().find(|rate| (rate / near - 1.0).abs() < SAME_RATE).unwrap_or(near)
}

/// The time code of each pose: whole numbers if the clip has the file's rate.
pub(super) fn time_codes(clip: &GlbClip, rate: f64) -> Result<Vec<f64>, FormatError> {
    let seconds = clip_seconds(clip)?;
    let on_frames = matches!(clip.times, GlbTimes::EverySeconds(step) if (step * rate - 1.0).abs() < SAME_RATE);
    Ok((0_u32..).zip(seconds).map(|(frame, s)| if on_frames { f64::from(frame) } else { s * rate }).collect())
}

/// Writes a clip, with the blend shapes at its weights or else at their default ones; returns what the format does not hold of it.
pub(super) fn write_clip(
    layer: &mut Layer,
    skeleton: &Skeleton,
    joints: &Joints,
    timed: &Timed,
    shapes: &[Shape],
) -> Result<Option<String>, FormatError> {
    let clip = timed.clip;
    check_poses(skeleton, clip)?;
    check_weights(timed.surface, clip)?;
    let codes = time_codes(clip, timed.rate)?;
    layer.open("def SkelAnimation", timed.name, &[], clip.name);
    if !clip.poses.is_empty() {
        layer.line(format_args!("uniform token[] joints = {}", list(joints.paths.iter().map(|path| text(path)))));
    }
    let weights: Vec<Vec<f32>> = if clip.weights.is_empty() {
        vec![shapes.iter().map(|shape| shape.weight).collect()]
    } else {
        clip.weights.iter().map(|row| shapes.iter().map(|shape| row[shape.target]).collect()).collect()
    };
    write_weights(layer, shapes, &codes, &weights);
    let track = |part: fn(&Transform) -> Vec3| -> Vec<Vec<[f32; 3]>> {
        clip.poses.iter().map(|pose| pose.parent_from_bone.iter().map(|t| part(t).to_array()).collect()).collect()
    };
    write_samples(layer, "float3[] translations", &codes, &track(|t| t.translation), |frame| {
        tuples(frame.iter().copied())
    });
    // By bone first, so that signs follow on each other; then by frame.
    let of_bones: Vec<Vec<[f32; 4]>> = (0..skeleton.len())
        .map(|bone| continuous(clip.poses.iter().map(|pose| pose.parent_from_bone[bone].rotation)))
        .collect();
    let turns: Vec<Vec<[f32; 4]>> =
        (0..clip.poses.len()).map(|frame| of_bones.iter().map(|turns| turns[frame]).collect()).collect();
    let real_first = |[x, y, z, w]: [f32; 4]| tuple([w, x, y, z]);
    write_samples(layer, "quatf[] rotations", &codes, &turns, |frame| list(frame.iter().copied().map(real_first)));
    let scales = track(|t| t.scale);
    write_samples(layer, "half3[] scales", &codes, &scales, |frame| tuples(frame.iter().copied()));
    layer.close();
    let off = |scale: f32| (half(scale) - scale).abs() / scale.abs();
    let worst = scales.iter().flatten().flatten().map(|&scale| off(scale)).fold(0.0, f32::max);
    let told = format!(
        "USD keeps scales of bones in half precision: those of {} are off by {:.3} %",
        timed.name,
        100.0 * worst
    );
    Ok((worst > UNSEEN).then_some(told))
}

/// An animation of blend shapes alone, at their default weights.
pub(super) fn write_shapes_alone(layer: &mut Layer, name: &str, shapes: &[Shape]) {
    layer.open("def SkelAnimation", name, &[], "");
    let weights = vec![shapes.iter().map(|shape| shape.weight).collect()];
    write_weights(layer, shapes, &[], &weights);
    layer.close();
}

fn write_weights(layer: &mut Layer, shapes: &[Shape], codes: &[f64], weights: &[Vec<f32>]) {
    if !shapes.is_empty() {
        let names = shapes.iter().map(|shape| text(&shape.name));
        layer.line(format_args!("uniform token[] blendShapes = {}", list(names)));
        write_samples(layer, "float[] blendShapeWeights", codes, weights, |row| list(row));
    }
}

/// One value if all frames have the same.
fn write_samples<T: PartialEq>(
    layer: &mut Layer,
    property: &str,
    codes: &[f64],
    frames: &[Vec<T>],
    written: impl Fn(&[T]) -> String,
) {
    let Some(first) = frames.first() else { return };
    if frames.iter().all(|frame| frame == first) {
        layer.line(format_args!("{property} = {}", written(first)));
        return;
    }
    layer.open_samples(property);
    for (code, frame) in codes.iter().zip(frames) {
        layer.line(format_args!("{code}: {},", written(frame)));
    }
    layer.close();
}

/// The nearest number of half precision, for numbers in its normal range.
fn half(value: f32) -> f32 {
    let step = libm::exp2f(libm::floorf(libm::log2f(value.abs())) - 10.0);
    libm::rintf(value / step) * step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_video_are_exact() {
        for (seconds, rate) in [
            (1.0 / 24.0, 24.0),
            (1001.0 / 24_000.0, 24_000.0 / 1001.0),
            (1001.0 / 30_000.0, 30_000.0 / 1001.0),
            (0.033_366_7, 1.0 / 0.033_366_7),
            (1.0 / 12.5, 12.5),
        ] {
            assert!(frames_per_second(seconds) == rate, "{seconds}");
        }
    }

    #[test]
    fn half_precision() {
        assert!(half(1.0) == 1.0 && half(0.75) == 0.75);
        assert!((half(1.1) - 1.099_609_4).abs() < 1e-7, "{}", half(1.1));
    }
}
