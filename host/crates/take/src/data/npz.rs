//! A take as arrays for `NumPy`.

use armature_formats::FormatError;
use armature_formats::tables::{NpyArray, NpyValues, write_npz};
use armature_rig::{Motion, SensorState};
use glam::Affine3A;

use super::readings::{Readings, readings};
use crate::file::Take;

/// A motion, and the samples of the take that it was made from, as an archive of arrays. Lengths: n frames, b bones, m
/// samples, j joints.
///
/// | array | |
/// |---|---|
/// | `bones`, `parents` | b names; b indices, −1 for roots |
/// | `rest_translation`, `rest_rotation`, `tail` | b × 3, b × 4 (x, y, z, w), b × 3: the rest pose, `parent_from_bone` |
/// | `frames_per_second`, `time` | one number; n seconds after the first frame |
/// | `translation`, `rotation` | n × b × 3, n × b × 4 (x, y, z, w): `parent_from_bone` |
/// | `head` | n × b × 3: where the bones begin in model space |
/// | `joints`, `joint_bones` | j names; j bones that they drive, or nothing |
/// | `sample_time`, `sample_sequence`, `sample_device_micros`, `sample_host_seconds` | m of each; NaN where the host's time is not known |
/// | `counts`, `states`, `angles` | m × j: raw, −1 while not plugged in; 0 ok, 1 no data, 2 magnet weak, 3 outlier, 255 not plugged in; radians by the calibration, unfiltered, NaN where there is none |
pub fn npz_of(motion: &Motion, take: Option<&Take>) -> Result<Vec<u8>, FormatError> {
    let mut arrays = motion_arrays(motion);
    if let Some(take) = take {
        arrays.extend(sample_arrays(&readings(take)));
    }
    write_npz(&arrays)
}

fn array(shape: &[usize], values: NpyValues) -> NpyArray {
    NpyArray { shape: shape.to_vec(), values }
}

fn motion_arrays(motion: &Motion) -> Vec<(&'static str, NpyArray)> {
    let skeleton = &motion.skeleton;
    let (n, b) = (motion.frames.len(), skeleton.len());
    let bones = skeleton.bones();
    let numbers = |shape: &[usize], values: Vec<f32>| array(shape, NpyValues::F32(values));
    let mut frames = vec![Affine3A::IDENTITY; b];
    let mut heads = Vec::with_capacity(3 * n * b);
    for pose in &motion.frames {
        pose.forward_kinematics(skeleton, &mut frames);
        heads.extend(frames.iter().flat_map(|frame| frame.translation.to_array()));
    }
    let all = || motion.frames.iter().flat_map(|pose| &pose.parent_from_bone);
    let parent = |bone: &armature_rig::Bone| bone.parent.map_or(-1, |parent| parent as i32);
    vec![
        ("bones", array(&[b], NpyValues::Text(bones.iter().map(|bone| bone.name.clone()).collect()))),
        ("parents", array(&[b], NpyValues::I32(bones.iter().map(parent).collect()))),
        (
            "rest_translation",
            numbers(&[b, 3], bones.iter().flat_map(|bone| bone.rest.translation.to_array()).collect()),
        ),
        ("rest_rotation", numbers(&[b, 4], bones.iter().flat_map(|bone| bone.rest.rotation.to_array()).collect())),
        ("tail", numbers(&[b, 3], bones.iter().flat_map(|bone| bone.tail.to_array()).collect())),
        ("frames_per_second", array(&[], NpyValues::F64(vec![1.0 / motion.frame_seconds]))),
        ("time", array(&[n], NpyValues::F64((0..n).map(|frame| frame as f64 * motion.frame_seconds).collect()))),
        ("translation", numbers(&[n, b, 3], all().flat_map(|t| t.translation.to_array()).collect())),
        ("rotation", numbers(&[n, b, 4], all().flat_map(|t| t.rotation.to_array()).collect())),
        ("head", numbers(&[n, b, 3], heads)),
    ]
}

fn sample_arrays(readings: &Readings) -> Vec<(&'static str, NpyArray)> {
    let (m, j) = (readings.rows.len(), readings.joints.len());
    let names = readings.joints.iter().map(super::readings::ReadJoint::name).collect();
    let bones = readings.joints.iter().map(|joint| joint.bone.clone().unwrap_or_default()).collect();
    let raw = || readings.rows.iter().map(|row| &row.sample.raw);
    let cells = || readings.rows.iter().flat_map(|row| &row.readings);
    let host = readings.rows.iter().map(|row| row.sample.host_receive_seconds.unwrap_or(f64::NAN)).collect();
    let state = |state: SensorState| match state {
        SensorState::Ok => 0,
        SensorState::NoData => 1,
        SensorState::MagnetWeak => 2,
        SensorState::Outlier => 3,
    };
    let counts = cells().map(|cell| cell.map_or(-1, |cell| cell.count.into())).collect();
    let states = cells().map(|cell| cell.map_or(255, |cell| state(cell.state))).collect();
    let angles = cells().map(|cell| cell.and_then(|cell| cell.angle).unwrap_or(f64::NAN)).collect();
    vec![
        ("joints", array(&[j], NpyValues::Text(names))),
        ("joint_bones", array(&[j], NpyValues::Text(bones))),
        ("sample_time", array(&[m], NpyValues::F64(readings.rows.iter().map(|row| row.micros as f64 / 1e6).collect()))),
        ("sample_sequence", array(&[m], NpyValues::U32(raw().map(|raw| raw.sequence).collect()))),
        ("sample_device_micros", array(&[m], NpyValues::U64(raw().map(|raw| raw.device_micros).collect()))),
        ("sample_host_seconds", array(&[m], NpyValues::F64(host))),
        ("counts", array(&[m, j], NpyValues::I32(counts))),
        ("states", array(&[m, j], NpyValues::U8(states))),
        ("angles", array(&[m, j], NpyValues::F64(angles))),
    ]
}
