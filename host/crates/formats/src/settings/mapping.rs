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

use std::fmt::Write as _;

use armature_rig::{Mapping, MappingEntry, RestTurn};
use glam::Quat;
use serde::Deserialize;

use super::toml_text::{check_version, line_at, toml_error, utf8};
use crate::FormatError;

/// The first version, which is still written where it says everything; the newest.
const VERSIONS: [u32; 2] = [1, 2];
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
    check_version("mapping", file.version, VERSIONS[1])?;
    let entries = file.joints.iter().map(|entry| from_dto(entry.get_ref(), line_at(text, entry.span().start)));
    let entries = entries.collect::<Result<_, _>>()?;
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
    Ok(Mapping { entries, rest, ..Mapping::default() })
}

/// Writes a mapping file; [`read_mapping`] returns the same mapping.
pub fn write_mapping(mapping: &Mapping) -> String {
    let version = VERSIONS[usize::from(!mapping.rest.is_empty())];
    let mut text = format!("# Which part of the puppet drives which bone.\nversion = {version}\n");
    for entry in &mapping.entries {
        let bone = toml::Value::String(entry.bone.clone());
        let _ = write!(text, "\n[[joint]]\npart = \"{}\"\nbone = {bone}\n", entry.part);
        if entry.mounting != Quat::IDENTITY {
            let [x, y, z, w] = entry.mounting.to_array();
            let _ = writeln!(text, "mounting = [{x:?}, {y:?}, {z:?}, {w:?}]");
        }
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
        assert!(read_mapping(b"version = 0").is_err());
        assert!(read_mapping(b"version = 7").unwrap_err().to_string().contains("version 7"));
    }

    proptest! {
        #[test]
        fn comes_back_as_it_went(entries in prop::collection::vec(
            (any::<[u8; 12]>(), "\\PC{0,12}", any::<bool>(), -3.0_f32..3.0), 0..5),
            turns in prop::collection::btree_map("\\PC{0,12}", prop::array::uniform3(-180.0_f32..180.0), 0..4)) {
            let turn = |(bone, degrees): (String, [f32; 3])| RestTurn { bone, degrees: degrees.into() };
            let rest = turns.into_iter().map(turn).collect();
            let entry = |(uid, bone, turned, angle)| MappingEntry {
                part: PartUid(uid),
                bone,
                mounting: if turned { Quat::from_rotation_z(angle) } else { Quat::IDENTITY },
            };
            let mapping = Mapping { entries: entries.into_iter().map(entry).collect(), rest, ..Mapping::default() };
            prop_assert_eq!(read_mapping(write_mapping(&mapping).as_bytes()).unwrap(), mapping);
        }

        #[test]
        fn survives_any_text(text in "\\PC*", cut in 0..EXAMPLE.len()) {
            let _ = read_mapping(text.as_bytes());
            let _ = read_mapping(&EXAMPLE.as_bytes()[..cut]);
        }
    }
}
