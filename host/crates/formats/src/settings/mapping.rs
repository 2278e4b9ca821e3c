//! Mapping from parts to bones as a TOML file that people can read and edit.
//!
//! ```toml
//! version = 1
//!
//! [[joint]]
//! part = "00112233445566778899aabb"
//! bone = "LeftForeArm"
//! mounting = [0.0, 0.7071068, 0.0, 0.7071068]
//! ```
//! `mounting` is a quaternion (x, y, z, w) and may be omitted if the part is mounted as intended.
//!
//! Where the puppet is zeroed in another pose than the character rests in, version 2 says how bones are turned to it, with
//! all bones below them: an axis through the bone's head times the angle in degrees, +X to the character's left, +Y up, +Z
//! where it looks. Without such entries the puppet is zeroed in the character's rest pose.
//!
//! ```toml
//! version = 2
//!
//! [[rest]]
//! bone = "LeftArm"
//! degrees = [0.0, 0.0, 45.0]
//! ```
//!
//! Version 3 adds joints that turn several bones, and joints that blend shapes of the character.
//!
//! ```toml
//! version = 3
//!
//! # One joint for a whole spine: each bone turns by its share about the joint's axis, the last one by the whole rotation.
//! # The shares sum to 1, and the bones lie one below another.
//! [[joint]]
//! part = "00112233445566778899aabb"
//! bone = "Spine"
//! shares = [["Spine", 0.4], ["Spine1", 0.3], ["Spine2", 0.3]]
//!
//! # One joint curls fingers: each bone turns by so many times the joint's rotation, about its own axes. A negative number
//! # turns it the other way.
//! [[joint]]
//! part = "ffeeddccbbaa998877665544"
//! bone = "LeftHandIndex1"
//! curls = [["LeftHandIndex1", 1.0], ["LeftHandIndex2", 1.1], ["LeftHandIndex3", 0.7]]
//!
//! # One axis of a joint (bend, twist, or end-twist at the outlet) blends a shape: at the first angle it has the first
//! # weight, at the second the second. The part needs no bone.
//! [[shape]]
//! shape = "jawOpen"
//! part = "0123456789abcdef01234567"
//! axis = "bend"
//! degrees = [0.0, 25.0]
//! weights = [0.0, 1.0]
//! ```
//! `axis` may be omitted for `bend`, `weights` for 0 and 1.

use std::fmt::Write as _;

use armature_rig::{DriveAxis, Mapping, MappingEntry, RestTurn, ShapeDrive, SharedJoint, Sharing};
use glam::Quat;
use serde::Deserialize;

use super::toml_text::{check_version, line_at, toml_error, utf8};
use crate::FormatError;

/// The newest version. An older one is written where it says everything.
const NEWEST: u32 = 3;
const REMEDY: &str = "Correct the line, or omit the mapping to have one proposed";
/// How far from unit length a quaternion typed by hand may be; it is normalised.
const UNIT_TOLERANCE: f32 = 1e-2;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileDto {
    version: u32,
    #[serde(default, rename = "joint")]
    joints: Vec<toml::Spanned<EntryDto>>,
    #[serde(default)]
    rest: Vec<toml::Spanned<RestDto>>,
    #[serde(default, rename = "shape")]
    shapes: Vec<toml::Spanned<ShapeDto>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ShapeDto {
    shape: String,
    part: String,
    axis: Option<String>,
    degrees: [f64; 2],
    weights: Option<[f64; 2]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RestDto {
    bone: String,
    degrees: [f32; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct EntryDto {
    part: String,
    bone: String,
    mounting: Option<[f32; 4]>,
    shares: Option<Vec<(String, f64)>>,
    curls: Option<Vec<(String, f64)>>,
}

/// Reads a mapping file. Whether the bones exist can only be checked with a skeleton:
/// [`PoseSolver::new`](armature_rig::PoseSolver::new) does that.
///
/// ```
/// use armature_formats::settings::{read_mapping, write_mapping};
///
/// let text = r#"
///     version = 1
///     [[joint]]
///     part = "00112233445566778899aabb"
///     bone = "LeftForeArm"
/// "#;
/// let mapping = read_mapping(text.as_bytes())?;
/// assert_eq!(mapping.entries[0].bone, "LeftForeArm");
/// assert_eq!(read_mapping(write_mapping(&mapping).as_bytes())?, mapping);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_mapping(bytes: &[u8]) -> Result<Mapping, FormatError> {
    let text = utf8(bytes, REMEDY)?;
    let file: FileDto = toml::from_str(text).map_err(|error| toml_error(text, &error, REMEDY))?;
    check_version("mapping", file.version, NEWEST)?;
    let mut entries = Vec::new();
    let mut shared = Vec::new();
    for joint in &file.joints {
        let line = line_at(text, joint.span().start);
        let entry = from_dto(joint.get_ref(), line)?;
        shared.extend(shares_of(joint.get_ref(), &entry, line)?);
        entries.push(entry);
    }
    let shapes = file.shapes.iter().map(|drive| shape_from_dto(drive.get_ref(), line_at(text, drive.span().start)));
    let shapes = shapes.collect::<Result<_, _>>()?;
    let mut rest: Vec<RestTurn> = Vec::new();
    for turn in &file.rest {
        let RestDto { bone, degrees } = turn.get_ref();
        let wrong = |what: &str| {
            let line = line_at(text, turn.span().start);
            FormatError::line("", line, format!("the rest pose of the bone {bone:?} is turned {what}"), REMEDY)
        };
        if !degrees.iter().all(|number| number.is_finite()) {
            return Err(wrong("by something that is not a number of degrees"));
        }
        if rest.iter().any(|known| known.bone == *bone) {
            return Err(wrong("twice"));
        }
        rest.push(RestTurn { bone: bone.clone(), degrees: (*degrees).into() });
    }
    Ok(Mapping { entries, rest, shared, shapes, ..Mapping::default() })
}

/// Writes a mapping file; [`read_mapping`] returns the same mapping.
pub fn write_mapping(mapping: &Mapping) -> String {
    let version = match mapping {
        Mapping { shared, shapes, .. } if !(shared.is_empty() && shapes.is_empty()) => NEWEST,
        Mapping { rest, .. } if !rest.is_empty() => 2,
        _ => 1,
    };
    let mut text = format!("# Which part of the puppet drives which bone.\nversion = {version}\n");
    for entry in &mapping.entries {
        let bone = toml::Value::String(entry.bone.clone());
        let _ = write!(text, "\n[[joint]]\npart = \"{}\"\nbone = {bone}\n", entry.part);
        if entry.mounting != Quat::IDENTITY {
            let [x, y, z, w] = entry.mounting.to_array();
            let _ = writeln!(text, "mounting = [{x:?}, {y:?}, {z:?}, {w:?}]");
        }
        for joint in mapping.shared.iter().filter(|joint| joint.part == entry.part) {
            let key = match joint.sharing {
                Sharing::Chain => "shares",
                Sharing::Curl => "curls",
            };
            let pair = |(bone, share): &(String, f64)| format!("[{}, {share:?}]", toml::Value::String(bone.clone()));
            let pairs: Vec<String> = joint.bones.iter().map(pair).collect();
            let _ = writeln!(text, "{key} = [{}]", pairs.join(", "));
        }
    }
    for ShapeDrive { shape, part, axis, degrees: [from, to], weights: [low, high] } in &mapping.shapes {
        let shape = toml::Value::String(shape.clone());
        let _ = write!(text, "\n[[shape]]\nshape = {shape}\npart = \"{part}\"\naxis = \"{axis}\"\n");
        let _ = write!(text, "degrees = [{from:?}, {to:?}]\nweights = [{low:?}, {high:?}]\n");
    }
    if !mapping.rest.is_empty() {
        text.push_str(
            "\n# How the character's rest pose becomes the one in which the puppet is zeroed: an axis times degrees, +X to\n\
             # the character's left, +Y up, +Z where it looks. Bones below turn along. Without these entries nothing is turned.\n",
        );
    }
    for turn in &mapping.rest {
        let bone = toml::Value::String(turn.bone.clone());
        let [x, y, z] = turn.degrees.to_array();
        let _ = write!(text, "\n[[rest]]\nbone = {bone}\ndegrees = [{x:?}, {y:?}, {z:?}]\n");
    }
    text
}

fn from_dto(entry: &EntryDto, line: usize) -> Result<MappingEntry, FormatError> {
    let wrong = |what: String| FormatError::line("", line, what, REMEDY);
    let part = entry.part.parse().map_err(|error: armature_rig::PartUidError| wrong(error.to_string()))?;
    let mounting = Quat::from_array(entry.mounting.unwrap_or(Quat::IDENTITY.to_array()));
    let length = mounting.length();
    if !length.is_finite() || (length - 1.0).abs() > UNIT_TOLERANCE {
        let what = format!("the mounting of part {part} has length {length}; a rotation is a quaternion of length 1");
        return Err(wrong(what));
    }
    let mounting = if mounting.is_normalized() { mounting } else { mounting.normalize() };
    Ok(MappingEntry { part, bone: entry.bone.clone(), mounting })
}

/// Whether the bones exist and lie in one line can only be checked with a skeleton.
fn shares_of(dto: &EntryDto, entry: &MappingEntry, line: usize) -> Result<Option<SharedJoint>, FormatError> {
    let (sharing, bones) = match (&dto.shares, &dto.curls) {
        (None, None) => return Ok(None),
        (Some(shares), None) => (Sharing::Chain, shares),
        (None, Some(curls)) => (Sharing::Curl, curls),
        (Some(_), Some(_)) => {
            let what = format!("part {} has both shares and curls", entry.part);
            return Err(FormatError::line("", line, what, "Leave one of them out"));
        }
    };
    if let Some((bone, share)) = bones.iter().find(|(_, share)| !share.is_finite()) {
        let what = format!("part {} turns the bone {bone:?} by {share}, which is no number", entry.part);
        return Err(FormatError::line("", line, what, REMEDY));
    }
    Ok(Some(SharedJoint { part: entry.part, sharing, bones: bones.clone() }))
}

fn shape_from_dto(dto: &ShapeDto, line: usize) -> Result<ShapeDrive, FormatError> {
    let wrong = |what: String| FormatError::line("", line, what, REMEDY);
    let part = dto.part.parse().map_err(|error: armature_rig::PartUidError| wrong(error.to_string()))?;
    let axis = dto.axis.as_deref().map_or(Ok(DriveAxis::default()), str::parse).map_err(wrong)?;
    let weights = dto.weights.unwrap_or([0.0, 1.0]);
    if !dto.degrees.iter().chain(&weights).all(|number| number.is_finite()) {
        return Err(wrong(format!("the shape {:?} has a degree or weight that is no number", dto.shape)));
    }
    Ok(ShapeDrive { shape: dto.shape.clone(), part, axis, degrees: dto.degrees, weights })
}

#[cfg(test)]
mod tests {
    use armature_rig::PartUid;
    use proptest::prelude::*;

    use super::*;

    const EXAMPLE: &str = r#"
version = 1

[[joint]]
part = "00112233445566778899aabb"
bone = "LeftForeArm"
mounting = [0.0, 0.7071068, 0.0, 0.7071068]

[[joint]]
part = "ffeeddccbbaa998877665544"
bone = "mixamorig:Hips"
"#;

    #[test]
    fn reads_what_the_documentation_shows() {
        let mapping = read_mapping(EXAMPLE.as_bytes()).unwrap();
        assert_eq!(mapping.entries.len(), 2);
        assert_eq!(mapping.entries[0].bone, "LeftForeArm");
        assert!(mapping.entries[0].mounting.angle_between(Quat::from_rotation_y(std::f32::consts::FRAC_PI_2)) < 1e-3);
        assert_eq!(mapping.entries[1].mounting, Quat::IDENTITY);
    }

    #[test]
    fn errors_name_the_line() {
        let line_of = |text: &str| match read_mapping(text.as_bytes()) {
            Err(FormatError { place: crate::Place::Line(line), .. }) => Some(line),
            _ => None,
        };
        assert_eq!(line_of(&EXAMPLE.replace("ffee", "ff")), Some(9));
        assert_eq!(line_of(&EXAMPLE.replace("[0.0, 0.7071068", "[nan, 0.7071068")), Some(4));
        assert_eq!(line_of(&EXAMPLE.replace("0.0, 0.7071068", "0.0, 0.1")), Some(4));
        assert_eq!(line_of(&EXAMPLE.replace("bone = \"LeftForeArm\"", "")), Some(4));
        assert_eq!(line_of("version = 1\n[[joint]\n"), Some(2));
        let rest = |degrees: &str| format!("version = 2\n[[rest]]\nbone = \"a\"\ndegrees = {degrees}\n");
        assert_eq!(line_of(&rest("[0.0, nan, 0.0]")), Some(2));
        assert!(line_of(&rest("[0.0, 1.0]")).is_some());
        assert!(line_of(&format!("{}[[rest]]\nbone = \"a\"\ndegrees = [0, 0, 1]\n", rest("[1, 2.5, 0]"))).is_some());
        let shares =
            |words: &str| format!("version = 3\n[[joint]]\npart = \"{}\"\nbone = \"a\"\n{words}\n", "ab".repeat(12));
        assert!(read_mapping(shares("shares = [[\"a\", 1]]").as_bytes()).is_ok());
        assert_eq!(line_of(&shares("shares = [[\"a\", nan]]")), Some(2));
        assert_eq!(line_of(&shares("shares = [[\"a\", 1]]\ncurls = [[\"a\", 1]]")), Some(2));
        assert!(line_of(&shares("shares = [\"a\", 1]")).is_some());
        let shape =
            |words: &str| format!("version = 3\n[[shape]]\nshape = \"jaw\"\npart = \"{}\"\n{words}\n", "ab".repeat(12));
        assert!(read_mapping(shape("degrees = [0, 20]").as_bytes()).is_ok());
        assert_eq!(line_of(&shape("degrees = [0, inf]")), Some(2));
        assert_eq!(line_of(&shape("degrees = [0, 20]\naxis = \"roll\"")), Some(2));
        assert!(read_mapping(b"version = 0").is_err());
        assert!(read_mapping(b"version = 7").unwrap_err().to_string().contains("version 7"));
    }

    proptest! {
        #[test]
        fn comes_back_as_it_went(entries in prop::collection::vec(
            (any::<[u8; 12]>(), "\\PC{0,12}", any::<bool>(), -3.0_f32..3.0), 0..5),
            turns in prop::collection::btree_map("\\PC{0,12}", prop::array::uniform3(-180.0_f32..180.0), 0..4),
            shares in prop::collection::vec((any::<bool>(), prop::collection::vec(("\\PC{0,12}", -4.0_f64..4.0), 0..4)), 0..5),
            drives in prop::collection::vec(("\\PC{0,12}", any::<[u8; 12]>(), 0..3_usize, -9.0_f64..9.0, -9.0_f64..9.0), 0..3)) {
            let turn = |(bone, degrees): (String, [f32; 3])| RestTurn { bone, degrees: degrees.into() };
            let rest = turns.into_iter().map(turn).collect();
            let entry = |(uid, bone, turned, angle)| MappingEntry {
                part: PartUid(uid),
                bone,
                mounting: if turned { Quat::from_rotation_z(angle) } else { Quat::IDENTITY },
            };
            let mut entries: Vec<MappingEntry> = entries.into_iter().map(entry).collect();
            entries.dedup_by_key(|entry| entry.part);
            let shared = entries.iter().zip(shares).map(|(entry, (curl, bones))| SharedJoint {
                part: entry.part,
                sharing: if curl { Sharing::Curl } else { Sharing::Chain },
                bones,
            });
            let shared = shared.collect();
            let shapes = drives.into_iter().map(|(shape, part, axis, from, high)| ShapeDrive {
                shape,
                part: PartUid(part),
                axis: DriveAxis::ALL[axis],
                degrees: [from, from + 20.0],
                weights: [0.0, high],
            });
            let mapping = Mapping { entries, rest, shared, shapes: shapes.collect(), ..Mapping::default() };
            prop_assert_eq!(read_mapping(write_mapping(&mapping).as_bytes()).unwrap(), mapping);
        }

        #[test]
        fn survives_any_text(text in "\\PC*", cut in 0..EXAMPLE.len()) {
            let _ = read_mapping(text.as_bytes());
            let _ = read_mapping(&EXAMPLE.as_bytes()[..cut]);
        }
    }
}
