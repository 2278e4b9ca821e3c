//! A take as a log for the viewers of robotics.

use std::ops::ControlFlow;

use armature_rig::{Pose, SensorState, Skeleton};
use glam::{DQuat, DVec3, Vec3};

use super::log::Log;
use super::messages::{FrameTransform, Timestamp, description, frame_transforms, joint_states, raw_sample};
use super::readings::{ReadJoint, Row, readings};
use crate::file::Take;
use crate::time::Timeline;

/// Encoding of messages and of their descriptions.
const ENCODING: &str = "protobuf";
/// The frame of the room, with +Z up as robotics has it, and that of the model.
const WORLD: &str = "world";
const MODEL: &str = "model";

/// Why a take cannot be written as a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum McapError {
    /// Neither samples nor poses.
    #[error("the take has neither samples nor poses")]
    Nothing,
    /// Stopped by the caller.
    #[error("cancelled")]
    Cancelled,
}

/// A take as MCAP, its messages at the device's own times: `/raw`, the samples (`armature.RawSample`; the channel's
/// metadata name the joints); `/joints`, calibrated angles in radians (`foxglove.JointStates`); `/tf`, the recorded poses
/// (`foxglove.FrameTransforms`), bones relative to the bones above them, in a world with +Z up. Times count from the take's
/// start where it says when that was, else from zero.
pub fn mcap_of(
    take: &Take,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Vec<u8>, McapError> {
    let readings = readings(take);
    let timeline = Timeline::recorded(take);
    let poses: Vec<(f64, Pose)> = timeline
        .iter()
        .flat_map(|timeline| {
            (0..timeline.len())
                .filter_map(|index| timeline.get(index))
                .map(|(seconds, packed)| (seconds, take.unpack(packed)))
        })
        .collect();
    if readings.rows.is_empty() && poses.is_empty() {
        return Err(McapError::Nothing);
    }
    let names: Vec<String> = readings.joints.iter().map(ReadJoint::name).collect();
    let bones: Vec<&str> = readings.joints.iter().map(|joint| joint.bone.as_deref().unwrap_or_default()).collect();
    let mut log = Log::new(concat!("armature ", env!("CARGO_PKG_VERSION")));
    let mut channel = |topic: &str, message: &str, metadata: &[(&str, String)]| {
        log.channel(topic, message, ENCODING, &description(message), metadata)
    };
    let raw = channel("/raw", "armature.RawSample", &[("joints", names.join(",")), ("bones", bones.join(","))]);
    let joints = channel("/joints", "foxglove.JointStates", &[]);
    let frames = channel("/tf", "foxglove.FrameTransforms", &[]);
    let start = take.header().unix_micros.unwrap_or(0);
    let mut rows: Vec<&Row> = readings.rows.iter().collect();
    rows.sort_by_key(|row| row.micros);
    let mut next = (0_u32..).zip(&poses).peekable();
    let count = rows.len().max(1) as f64;
    let skeleton = take.skeleton();
    for (number, row) in (0_u32..).zip(&rows) {
        while let Some((index, pose)) = next.next_if(|(_, pose)| pose.0 < row.micros as f64 * 1e-6) {
            write_pose(&mut log, frames, index, start, skeleton, pose);
        }
        let (nanos, time) = time(start, row.micros);
        log.message(raw, number, nanos, &raw_sample(time, row, state).into_bytes());
        let cells = names.iter().zip(&row.readings);
        let angles = cells.filter_map(|(name, cell)| Some((name.as_str(), (*cell)?.angle?)));
        log.message(joints, number, nanos, &joint_states(time, angles).into_bytes());
        if number.is_multiple_of(1024) && progress("writing the log", f64::from(number) / count).is_break() {
            return Err(McapError::Cancelled);
        }
    }
    for (index, pose) in next {
        write_pose(&mut log, frames, index, start, skeleton, pose);
    }
    Ok(log.finish())
}

fn state(state: SensorState) -> u8 {
    match state {
        SensorState::Ok => 0,
        SensorState::NoData => 1,
        SensorState::MagnetWeak => 2,
        SensorState::Outlier => 3,
    }
}

/// A time of the take as nanoseconds and as messages have it. No time is before 1970.
fn time(start_micros: i64, micros: i64) -> (u64, Timestamp) {
    let nanos = start_micros.saturating_add(micros).max(0).unsigned_abs().saturating_mul(1000);
    (nanos, Timestamp { seconds: nanos / 1_000_000_000, nanos: (nanos % 1_000_000_000) as u32 })
}

fn write_pose(
    log: &mut Log,
    channel: u16,
    number: u32,
    start: i64,
    skeleton: Option<&Skeleton>,
    (seconds, pose): &(f64, Pose),
) {
    let Some(skeleton) = skeleton else { return };
    let (nanos, time) = time(start, libm::round(seconds * 1e6) as i64);
    let bones = skeleton.bones();
    let upright = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut transforms = vec![FrameTransform { parent: WORLD, child: MODEL, place: DVec3::ZERO, turn: upright }];
    // Frames do not scale: with scales, places are taken from where the bones begin.
    let scaled = pose.parent_from_bone.iter().any(|local| local.scale != Vec3::ONE);
    let mut frames = skeleton.rest_model_from_bone();
    pose.forward_kinematics(skeleton, &mut frames);
    let mut turns: Vec<DQuat> = Vec::with_capacity(bones.len());
    for (index, (local, bone)) in pose.parent_from_bone.iter().zip(bones).enumerate() {
        let turn = local.rotation.as_dquat().normalize();
        let above = bone.parent.map_or(DQuat::IDENTITY, |parent| turns[parent]);
        turns.push((above * turn).normalize());
        let head = |bone: usize| Vec3::from(frames[bone].translation).as_dvec3();
        let place = match bone.parent.filter(|_| scaled) {
            Some(parent) => above.inverse() * (head(index) - head(parent)),
            None => local.translation.as_dvec3(),
        };
        let parent = bone.parent.map_or(MODEL, |parent| &bones[parent].name);
        transforms.push(FrameTransform { parent, child: &bone.name, place, turn });
    }
    log.message(channel, number, nanos, &frame_transforms(time, &transforms).into_bytes());
}
