//! A take as a table of text: a row for each sample, or for each frame.

use std::collections::HashMap;
use std::fmt::Write as _;

use armature_rig::{Motion, Pose, Skeleton};

use super::readings::readings;
use crate::file::Take;

/// A take as CSV: a row for each sample, at the device's own times. Columns: `time` (seconds after the first sample),
/// `sequence` and `device_micros` as the device sent them; for each joint `count:JOINT` and `angle:JOINT` (radians, by
/// the calibration, unfiltered); for each bone its recorded rotation `BONE.qx` to `BONE.qw` (`parent_from_bone`), and for
/// roots their place `BONE.x` to `BONE.z`. What was not measured is empty.
pub fn csv_of(take: &Take) -> String {
    let readings = readings(take);
    let poses: HashMap<(u32, u64), usize> =
        take.poses().enumerate().map(|(index, pose)| ((pose.sequence, pose.device_micros), index)).collect();
    let packed: Vec<_> = take.poses().collect();
    let skeleton = take.skeleton().filter(|_| !packed.is_empty());
    let mut out = String::from("time,sequence,device_micros");
    for joint in &readings.joints {
        let name = joint.name();
        let _ = write!(out, ",count:{name},angle:{name}");
    }
    if let Some(skeleton) = skeleton {
        write_head(&mut out, skeleton);
    }
    out.push('\n');
    for row in &readings.rows {
        let raw = &row.sample.raw;
        let _ = write!(out, "{},{},{}", row.micros as f64 / 1e6, raw.sequence, raw.device_micros);
        for reading in &row.readings {
            match reading {
                Some(reading) => {
                    let _ = write!(out, ",{},", reading.count);
                    let _ = reading.angle.map_or(Ok(()), |angle| write!(out, "{angle}"));
                }
                None => out.push_str(",,"),
            }
        }
        if let Some(skeleton) = skeleton {
            let found = poses.get(&(raw.sequence, raw.device_micros));
            write_pose(&mut out, skeleton, found.map(|&index| take.unpack(packed[index])).as_ref());
        }
        out.push('\n');
    }
    out
}

/// A motion as CSV: a row for each frame, with `time` and the columns of bones as in [`csv_of`].
pub fn csv_of_motion(motion: &Motion) -> String {
    let mut out = String::from("time");
    write_head(&mut out, &motion.skeleton);
    out.push('\n');
    for (frame, pose) in motion.frames.iter().enumerate() {
        let _ = write!(out, "{}", frame as f64 * motion.frame_seconds);
        write_pose(&mut out, &motion.skeleton, Some(pose));
        out.push('\n');
    }
    out
}

fn write_head(out: &mut String, skeleton: &Skeleton) {
    for bone in skeleton.bones() {
        let places: &[&str] = if bone.parent.is_none() { &["x", "y", "z"] } else { &[] };
        for column in places.iter().chain(&["qx", "qy", "qz", "qw"]) {
            out.push(',');
            out.push_str(&quoted(&format!("{}.{column}", bone.name)));
        }
    }
}

fn write_pose(out: &mut String, skeleton: &Skeleton, pose: Option<&Pose>) {
    for (index, bone) in skeleton.bones().iter().enumerate() {
        let own = pose.map(|pose| pose.parent_from_bone[index]);
        if bone.parent.is_none() {
            write_numbers(out, own.map(|own| own.translation.to_array()));
        }
        write_numbers(out, own.map(|own| own.rotation.to_array()));
    }
}

fn write_numbers<const K: usize>(out: &mut String, numbers: Option<[f32; K]>) {
    for k in 0..K {
        out.push(',');
        if let Some(numbers) = numbers {
            let _ = write!(out, "{}", numbers[k]);
        }
    }
}

/// A field in quotes where it needs them (RFC 4180).
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}
