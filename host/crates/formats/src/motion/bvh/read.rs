//! From BVH to motion.

use armature_rig::{Bone, Motion, Pose, Skeleton, Transform};
use glam::{DQuat, DVec3, Quat, Vec3};

use super::hierarchy::{Channel, Joint, Words, read_hierarchy};
use crate::FormatError;
use crate::skeleton::tails::set_tails;
use crate::text::names::UniqueNames;
use crate::text::{counted, decode, number, quoted};

/// Seconds between two frames where a file says 0.
const USUAL_FRAME_SECONDS: f64 = 1.0 / 30.0;

/// A motion, and what was unusual in its file.
#[derive(Clone, Debug, PartialEq)]
pub struct BvhMotion {
    /// The skeleton and its frames.
    pub motion: Motion,
    /// What was ignored or repaired on the way, in sentences for the user.
    pub warnings: Vec<String>,
}

/// Reads a motion. Bones are the file's joints in its order, with identity rest rotations and the OFFSETs as rest
/// translations; End Sites give the tails of leaves (without one, a leaf continues in its parent's direction). Lengths
/// stay in the file's unit. A frame count that is off by one and a frame time of 0 are repaired, with a warning. The
/// error does not name the file: see [`FormatError::in_file`].
///
/// ```
/// use armature_formats::motion::read_bvh;
///
/// let text = "HIERARCHY ROOT hips { OFFSET 0 1 0 CHANNELS 1 Xrotation }
///     MOTION
///     Frames: 2
///     Frame Time: 0.04
///     0
///     90
/// ";
/// let motion = read_bvh(text.as_bytes())?.motion;
/// assert_eq!((motion.skeleton.len(), motion.frames.len()), (1, 2));
/// let turn = motion.frames[1].parent_from_bone[0].rotation;
/// assert!((turn.to_scaled_axis().x - std::f32::consts::FRAC_PI_2).abs() < 1e-6);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_bvh(bytes: &[u8]) -> Result<BvhMotion, FormatError> {
    let text = decode(bytes);
    let mut words = Words::new(&text);
    let joints = read_hierarchy(&mut words)?;
    let announced = announced_frames(&mut words)?;
    let mut warnings = Vec::new();
    let mut frame_seconds = frame_time(&mut words)?;
    if frame_seconds == 0.0 {
        frame_seconds = USUAL_FRAME_SECONDS;
        warnings.push("The frame time is 0: 30 frames a second are assumed.".to_owned());
    }
    let skeleton = skeleton(&joints)?;
    let width: usize = joints.iter().map(|j| j.channels.len()).sum();
    if width == 0 && announced > 0 {
        return Err(words.error("no joint has a channel, so nothing can move", "Export the motion with its channels"));
    }
    let mut frames = Vec::new();
    let mut values = Vec::with_capacity(width);
    // Some programs count one too many or too few; a larger difference means a damaged file.
    let mut extra = None;
    while let Some(line) = words.next_line() {
        if frames.len() > announced {
            extra = Some(line);
            break;
        }
        values.clear();
        for word in line.split_whitespace() {
            if values.len() == width {
                values.push(0.0);
                break;
            }
            values.push(number("", words.line(), word)?);
        }
        if values.len() != width {
            let have = line.split_whitespace().count();
            let what = format!("frame {} has {have} numbers, but the channels above need {width}", frames.len() + 1);
            return Err(words.error(what, "A frame is one line; the file may be damaged, export it again"));
        }
        frames.push(pose(&joints, &values));
    }
    if let Some(line) = extra {
        let what = format!("after the announced {announced} frames and one more there is {}", quoted(line));
        return Err(words.error(what, "Correct the number after \"Frames:\", or remove the rest"));
    }
    if frames.len() + 1 < announced {
        let what = format!("{announced} frames are announced, but there are only {}", frames.len());
        let remedy = format!("The file is cut off: export it again, or write \"Frames: {}\"", frames.len());
        return Err(words.error(what, remedy));
    }
    if frames.len() != announced {
        let announced = counted(announced, ["frame is", "frames are"]);
        warnings.push(format!("{announced} announced, but there are {}: all of them are read.", frames.len()));
    }
    let line = words.line();
    let motion = Motion::new(skeleton, frame_seconds, frames).map_err(|error| {
        FormatError::line("", line, error.to_string(), "A number is too large for single precision; scale the motion")
    })?;
    Ok(BvhMotion { motion, warnings })
}

fn announced_frames<'t, L: Iterator<Item = (usize, &'t str)>>(words: &mut Words<'t, L>) -> Result<usize, FormatError> {
    let line = words.next_line().unwrap_or_default();
    let value = strip_label(line, "Frames").and_then(|value| value.parse().ok());
    value.ok_or_else(|| {
        words
            .error(format!("\"Frames: N\" should be here, but there is {}", quoted(line)), "Write the number of frames")
    })
}

fn frame_time<'t, L: Iterator<Item = (usize, &'t str)>>(words: &mut Words<'t, L>) -> Result<f64, FormatError> {
    let line = words.next_line().unwrap_or_default();
    let value = strip_label(line, "Frame Time").or_else(|| strip_label(line, "FrameTime"));
    // Some programs write the number in the user's locale.
    let seconds = value.and_then(|v| v.replace(',', ".").parse::<f64>().ok());
    seconds.filter(|s| s.is_finite() && *s >= 0.0).ok_or_else(|| {
        words.error(
            format!("\"Frame Time: SECONDS\" should be here, but there is {}", quoted(line)),
            "Write the seconds between two frames, a positive number like 0.0333333",
        )
    })
}

/// The value of a line `label: value`, however it is spaced; some files omit the colon.
fn strip_label<'t>(line: &'t str, label: &str) -> Option<&'t str> {
    let mut rest = line;
    for word in label.split(' ') {
        rest = rest.trim_start();
        if !rest.get(..word.len())?.eq_ignore_ascii_case(word) {
            return None;
        }
        rest = &rest[word.len()..];
    }
    let rest = rest.trim_start();
    Some(rest.strip_prefix(':').unwrap_or(rest).trim())
}

fn skeleton(joints: &[Joint]) -> Result<Skeleton, FormatError> {
    let mut names = UniqueNames::default();
    let mut bones: Vec<Bone> = joints
        .iter()
        .enumerate()
        .map(|(index, joint)| Bone {
            name: names.give(&joint.name, &format!("joint_{}", index + 1)),
            parent: joint.parent,
            rest: Transform { translation: DVec3::from(joint.offset).as_vec3(), ..Transform::IDENTITY },
            tail: Vec3::ZERO,
        })
        .collect();
    let mut known: Vec<Option<Vec3>> =
        joints.iter().map(|j| j.end_site.map(|end| DVec3::from(end).as_vec3())).collect();
    for parent in joints.iter().filter_map(|j| j.parent) {
        known[parent] = None;
    }
    set_tails(&mut bones, &known);
    Skeleton::new(bones).map_err(|error| {
        FormatError::whole("", error.to_string(), "An OFFSET is too large for single precision; scale the motion")
    })
}

fn pose(joints: &[Joint], values: &[f64]) -> Pose {
    let mut values = values.iter().copied();
    let parent_from_bone = joints
        .iter()
        .map(|joint| {
            let mut translation = joint.offset;
            let mut rotation = DQuat::IDENTITY;
            for (channel, value) in joint.channels.iter().zip(values.by_ref()) {
                match *channel {
                    Channel::Position(axis) => translation[axis] = value,
                    Channel::Rotation(axis) => rotation *= turn(axis, value),
                }
            }
            Transform {
                translation: DVec3::from(translation).as_vec3(),
                rotation: single_precision(rotation),
                scale: Vec3::ONE,
            }
        })
        .collect();
    Pose { parent_from_bone }
}

/// A rotation about one axis by an angle in degrees.
fn turn(axis: usize, degrees: f64) -> DQuat {
    let half = 0.5 * (degrees % 720.0).to_radians();
    let mut q = [0.0, 0.0, 0.0, libm::cos(half)];
    q[axis] = libm::sin(half);
    DQuat::from_array(q)
}

fn single_precision(rotation: DQuat) -> Quat {
    rotation.normalize().as_quat()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SMALL: &str = "HIERARCHY\r\nROOT Left Hip\r\n{\r\n\tOFFSET 0 1 0\r\n\
        \tCHANNELS 6 Yposition Xposition Zposition Xrotation Zrotation Yrotation\r\n\
        \tJOINT a\r\n\t{\r\n\t\tOFFSET\t0\t2\t0\r\n\t\tCHANNELS 1 Zrotation\r\n\t\tEnd Site\r\n\t\t{\r\n\
        \t\t\tOFFSET 0 0.5 0\r\n\t\t}\r\n\t}\r\n\tJOINT b {\r\n OFFSET 1 0 0 CHANNELS 2 Xrotation Xposition }\r\n}\r\n\
        ROOT a\r\n{ OFFSET 9 9 9 CHANNELS 0 }\r\nMOTION\r\nFrames:\t2\r\nFrame Time:\t.04\r\n\
        1 0 0 0 0 0 90 0 1\r\n\r\n2 1 3 30 45 60 -90 10 4\r\n";

    #[test]
    fn small_file_is_read() {
        let BvhMotion { motion, warnings } = read_bvh(SMALL.as_bytes()).unwrap();
        assert!(warnings.is_empty(), "{warnings:?}");
        let names: Vec<&str> = motion.skeleton.bones().iter().map(|b| b.name.as_str()).collect();
        assert_eq!(names, ["Left Hip", "a", "b", "a_2"]);
        assert_eq!(motion.frames.len(), 2);
        assert!((motion.frame_seconds - 0.04).abs() < 1e-12);
        assert_eq!(motion.skeleton.bones()[1].tail, Vec3::new(0.0, 0.5, 0.0));
        assert_eq!(motion.skeleton.bones()[2].tail, Vec3::new(0.5, 0.0, 0.0));
        let root = motion.frames[1].parent_from_bone[0];
        assert_eq!(root.translation, Vec3::new(1.0, 2.0, 3.0));
        // Rx(30) Rz(45) Ry(60) on the unit vectors, computed by hand.
        let expected = [0.353_553_4_f32, 0.739_198_9, -0.573_223_3];
        assert!((root.rotation * Vec3::X).distance(expected.into()) < 1e-6, "{}", root.rotation * Vec3::X);
        assert_eq!(motion.frames[1].parent_from_bone[2].translation, Vec3::new(4.0, 0.0, 0.0));
    }

    #[test]
    fn frame_time_in_odd_shapes() {
        for (line, expected) in [
            ("Frame Time: 0.04", 0.04),
            ("frame time .04", 0.04),
            ("FrameTime:4e-2", 0.04),
            ("Frame  Time : 0,04", 0.04),
        ] {
            let text = SMALL.replace("Frame Time:\t.04", line);
            let motion = read_bvh(text.as_bytes()).unwrap_or_else(|error| panic!("{line}: {error}")).motion;
            assert!((motion.frame_seconds - expected).abs() < 1e-12, "{line}");
        }
        for line in ["Frame Time: -0.1", "Frame Time: -1", "Frame Time: nan", "Frame Time:", "0.04", "Frame Time: 1/25"]
        {
            let error = read_bvh(SMALL.replace("Frame Time:\t.04", line).as_bytes()).unwrap_err();
            assert_eq!(error.place, crate::Place::Line(22), "{error}");
        }
    }

    #[test]
    fn small_mistakes_are_repaired_with_a_warning() {
        let read = |from: &str, to: &str| read_bvh(SMALL.replacen(from, to, 1).as_bytes()).unwrap();
        for (frames, warning) in [
            ("Frames: 3", "3 frames are announced, but there are 2: all of them are read."),
            ("Frames: 1", "1 frame is announced, but there are 2: all of them are read."),
        ] {
            let BvhMotion { motion, warnings } = read("Frames:\t2", frames);
            assert_eq!((motion.frames.len(), warnings), (2, vec![warning.to_owned()]));
        }
        let BvhMotion { motion, warnings } = read("Frame Time:\t.04", "Frame Time: 0");
        assert!((motion.frame_seconds - 1.0 / 30.0).abs() < 1e-12);
        assert_eq!(warnings, ["The frame time is 0: 30 frames a second are assumed."]);
    }

    #[test]
    fn faults_name_their_line() {
        let place = |from: &str, to: &str| {
            let text = SMALL.replacen(from, to, 1);
            assert_ne!(text, SMALL, "{from}");
            read_bvh(text.as_bytes()).unwrap_err()
        };
        let line = |error: &FormatError| match error.place {
            crate::Place::Line(line) => line,
            other => panic!("{other:?}"),
        };
        let error = place("Frames:\t2", "Frames: 4");
        assert!(error.remedy.contains("Frames: 2"), "{error}");
        assert_eq!(line(&place("Frames:\t2", "Frames: 0")), 25);
        assert_eq!(line(&place("1 0 0 0", "1 0 nan 0")), 23);
        assert_eq!(line(&place("1 0 0 0", "1 0 0")), 23);
        assert_eq!(line(&place("10 4", "10 4 5")), 25);
        assert_eq!(line(&place("CHANNELS 1 Zrotation", "CHANNELS 1 Zscale")), 9);
        assert_eq!(line(&place("CHANNELS 1 Zrotation", "CHANNELS 99999999999 Zrotation")), 9);
        assert_eq!(line(&place("HIERARCHY", "HIER")), 1);
        assert!(read_bvh(b"").is_err());
        assert!(read_bvh(SMALL.replace("10 4", "10 1e300").as_bytes()).is_err());
    }

    #[test]
    fn a_deep_hierarchy_does_not_overflow_the_stack() {
        let depth = 60_000;
        let mut text = String::from("HIERARCHY\nROOT r\n{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n");
        for _ in 0..depth {
            text.push_str("JOINT j { OFFSET 0 1 0\n");
        }
        text.push_str(&"}\n".repeat(depth + 1));
        text.push_str("MOTION\nFrames: 0\nFrame Time: 0.1\n");
        assert_eq!(read_bvh(text.as_bytes()).unwrap().motion.skeleton.len(), depth + 1);
    }
}
