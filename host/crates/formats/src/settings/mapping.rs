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

use std::fmt::Write as _;

use armature_rig::{Mapping, MappingEntry};
use glam::Quat;
use serde::Deserialize;

use super::toml_text::{check_version, line_at, toml_error, utf8};
use crate::FormatError;

const VERSION: u32 = 1;
const REMEDY: &str = "Correct the line, or omit the mapping to have one proposed";
/// How far from unit length a quaternion typed by hand may be; it is normalised.
const UNIT_TOLERANCE: f32 = 1e-2;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileDto {
    version: u32,
    #[serde(default, rename = "joint")]
    joints: Vec<toml::Spanned<EntryDto>>,
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
    check_version("mapping", file.version, VERSION)?;
    let entries = file.joints.iter().map(|entry| from_dto(entry.get_ref(), line_at(text, entry.span().start)));
    Ok(Mapping { entries: entries.collect::<Result<_, _>>()?, ..Mapping::default() })
}

/// Writes a mapping file; [`read_mapping`] returns the same mapping.
pub fn write_mapping(mapping: &Mapping) -> String {
    let mut text = format!("# Which part of the puppet drives which bone.\nversion = {VERSION}\n");
    for entry in &mapping.entries {
        let bone = toml::Value::String(entry.bone.clone());
        let _ = write!(text, "\n[[joint]]\npart = \"{}\"\nbone = {bone}\n", entry.part);
        if entry.mounting != Quat::IDENTITY {
            let [x, y, z, w] = entry.mounting.to_array();
            let _ = writeln!(text, "mounting = [{x:?}, {y:?}, {z:?}, {w:?}]");
        }
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
        assert!(read_mapping(b"version = 7").unwrap_err().to_string().contains("version 7"));
    }

    proptest! {
        #[test]
        fn comes_back_as_it_went(entries in prop::collection::vec(
            (any::<[u8; 12]>(), "\\PC{0,12}", any::<bool>(), -3.0_f32..3.0), 0..5)) {
            let entry = |(uid, bone, turned, angle)| MappingEntry {
                part: PartUid(uid),
                bone,
                mounting: if turned { Quat::from_rotation_z(angle) } else { Quat::IDENTITY },
            };
            let mapping = Mapping { entries: entries.into_iter().map(entry).collect(), ..Mapping::default() };
            prop_assert_eq!(read_mapping(write_mapping(&mapping).as_bytes()).unwrap(), mapping);
        }

        #[test]
        fn survives_any_text(text in "\\PC*", cut in 0..EXAMPLE.len()) {
            let _ = read_mapping(text.as_bytes());
            let _ = read_mapping(&EXAMPLE.as_bytes()[..cut]);
        }
    }
}
