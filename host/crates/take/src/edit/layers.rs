//! Edits of poses: mute, hold, smooth, add.

use armature_rig::{Pose, Skeleton, Transform};

use super::performance::{Performance, blend_some, ease, inside, micros};
use crate::file::{PackedPose, Take, same_bits};
use crate::time::{LowPass, Timeline};

/// Gaps of the poses that smoothing does not see across, microseconds.
const HOLD_OVER_MICROS: f64 = 100e3;

/// Bones rest from one time to another.
pub(super) fn mute(p: &mut Performance, skeleton: &Skeleton, chosen: &[bool], (from, to): (i64, i64), fade: i64) {
    let Some((first, last)) = p.span() else { return };
    // What lasts from the start or to the end is not faded there.
    let from = if from <= first { i64::MIN / 4 } else { from };
    let to = if to >= last { i64::MAX / 4 } else { to };
    let rest = skeleton.rest_pose();
    for (time, pose) in &mut p.poses {
        let part = inside(*time, from, to, fade);
        if part > 0.0 {
            *pose = blend_some(pose, &rest, part, chosen);
        }
    }
}

/// The pose of one moment from one time to another, with a way there before and a way back after.
pub(super) fn hold(p: &mut Performance, chosen: &[bool], at: i64, (from, to): (i64, i64), fade: i64) {
    let Some(held) = p.at(at) else { return };
    for (time, pose) in &mut p.poses {
        let outside = (from - *time).max(*time - to).max(0);
        let part = if outside == 0 { 1.0 } else { ease(1.0 - outside as f64 / fade.max(1) as f64) };
        if part > 0.0 {
            *pose = blend_some(pose, &held, part, chosen);
        }
    }
}

/// A zero-phase low-pass over the poses, each at its own time; half is left of the cutoff, Hz.
pub(super) fn smooth(p: &mut Performance, skeleton: &Skeleton, chosen: &[bool], cutoff: f64) {
    let pack = |(index, (time, pose)): (usize, &(i64, Pose))| {
        Some((*time, PackedPose::pack(index as u32, time.unsigned_abs(), pose, skeleton)?))
    };
    let packed: Vec<(i64, PackedPose)> = p.poses.iter().enumerate().filter_map(pack).collect();
    let timeline = Timeline::of(skeleton, &packed);
    let mut low_pass = LowPass::new(&timeline, 2.0 * cutoff, HOLD_OVER_MICROS);
    for (time, pose) in &mut p.poses {
        let smooth = low_pass.pose(*time as f64, pose.clone());
        *pose = blend_some(pose, &smooth, 1.0, chosen);
    }
}

/// Adds what another take's recorded poses move away from their first one.
pub(super) fn add(p: &mut Performance, take: &Take, chosen: &[bool], at: i64, weight: f64) {
    let Some(timeline) = Timeline::recorded(take) else { return };
    let all = (0..).map_while(|index| timeline.get(index));
    let poses = all.map(|(seconds, pose)| (micros(seconds), take.unpack(pose))).collect();
    let other = Performance::of(poses);
    let Some((first, last)) = other.span() else { return };
    let Some(start) = other.at(first) else { return };
    for (time, pose) in &mut p.poses {
        let own = *time - at;
        let Some(now) = other.at(own).filter(|_| (first..=last).contains(&own)) else { continue };
        let bones = pose.parent_from_bone.iter_mut().zip(start.parent_from_bone.iter().zip(&now.parent_from_bone));
        for ((bone, (start, now)), _) in bones.zip(chosen).filter(|(_, chosen)| **chosen) {
            *bone = moved(bone, start, now, weight);
        }
    }
}

/// A transform that also moves as from `start` to `now`, by a share of it.
fn moved(own: &Transform, start: &Transform, now: &Transform, weight: f64) -> Transform {
    let turn = (start.rotation.as_dquat().normalize().conjugate() * now.rotation.as_dquat().normalize()).normalize();
    let turn = if turn.w < 0.0 { -turn } else { turn };
    let part = glam::DQuat::from_scaled_axis(turn.to_scaled_axis() * weight);
    let step = (now.translation - start.translation).as_dvec3() * weight;
    if same_bits(start, now) {
        return *own;
    }
    Transform {
        translation: (own.translation.as_dvec3() + step).as_vec3(),
        rotation: (own.rotation.as_dquat().normalize() * part).normalize().as_quat(),
        scale: own.scale,
    }
}
