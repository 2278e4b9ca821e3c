//! Calibration as a TOML file that a person can read and edit.
//!
//! ```toml
//! version = 1
//!
//! [[part]]
//! uid = "00112233445566778899aabb"
//! sensors = [
//!     { axis = "twist", zero_counts = 8121 },
//!     { axis = "bend", zero_counts = 77, reversed = true },
//!     { axis = "twist" },
//! ]
//! ```
//! Sensors are listed from the part's inlet outwards; one without `zero_counts` was never zeroed.

use std::fmt::Write as _;

use armature_rig::{Calibration, JointAxis, PartUid, SensorCalibration};
use serde::Deserialize;

use crate::FormatError;

const VERSION: u32 = 1;
const MAX_SENSORS: usize = 3;
const REMEDY: &str = "Correct the line, or delete the file and zero the puppet again";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileDto {
    version: u32,
    #[serde(default, rename = "part")]
    parts: Vec<toml::Spanned<PartDto>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartDto {
    uid: String,
    sensors: Vec<SensorDto>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorDto {
    axis: AxisDto,
    zero_counts: Option<u16>,
    #[serde(default)]
    reversed: bool,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum AxisDto {
    Bend,
    Twist,
}

/// Reads a calibration file. Parts that are not plugged in now are kept like all others.
pub fn read_calibration(bytes: &[u8]) -> Result<Calibration, FormatError> {
    let text = crate::mapping_file::utf8(bytes, REMEDY)?;
    let file: FileDto = toml::from_str(text).map_err(|e| crate::mapping_file::toml_error(text, &e, REMEDY))?;
    crate::mapping_file::check_version("calibration", file.version, VERSION)?;
    let mut calibration = Calibration::default();
    for part in &file.parts {
        let line = crate::mapping_file::line_at(text, part.span().start);
        let part = part.get_ref();
        let uid: PartUid = part.uid.parse().map_err(|e: armature_rig::PartUidError| wrong(line, e.to_string()))?;
        if calibration.part(uid).is_some() {
            return Err(wrong(line, format!("part {uid} is here a second time")));
        }
        if part.sensors.is_empty() || part.sensors.len() > MAX_SENSORS {
            return Err(wrong(line, format!("part {uid} has {} sensors; a part has 1 to 3", part.sensors.len())));
        }
        calibration.set_part(uid, part.sensors.iter().map(|&sensor| from_dto(sensor)).collect());
    }
    Ok(calibration)
}

/// Writes a calibration file; [`read_calibration`] gives the same calibration back.
pub fn write_calibration(calibration: &Calibration) -> String {
    let mut text = format!("# Which raw count of which sensor is the rest pose.\nversion = {VERSION}\n");
    for (uid, sensors) in calibration.parts() {
        let _ = write!(text, "\n[[part]]\nuid = \"{uid}\"\nsensors = [\n");
        for sensor in sensors {
            let axis = match sensor.axis {
                JointAxis::Bend => "bend",
                JointAxis::Twist => "twist",
            };
            let zero = sensor.zero_counts.map_or_else(String::new, |counts| format!(", zero_counts = {counts}"));
            let reversed = if sensor.reversed { ", reversed = true" } else { "" };
            let _ = writeln!(text, "    {{ axis = \"{axis}\"{zero}{reversed} }},");
        }
        text.push_str("]\n");
    }
    text
}

fn from_dto(sensor: SensorDto) -> SensorCalibration {
    let axis = match sensor.axis {
        AxisDto::Bend => JointAxis::Bend,
        AxisDto::Twist => JointAxis::Twist,
    };
    SensorCalibration { zero_counts: sensor.zero_counts, reversed: sensor.reversed, axis }
}

fn wrong(line: usize, what: String) -> FormatError {
    FormatError::line("", line, what, REMEDY)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const EXAMPLE: &str = r#"
version = 1

[[part]]
uid = "00112233445566778899aabb"
sensors = [
    { axis = "twist", zero_counts = 8121 },
    { axis = "bend", zero_counts = 77, reversed = true },
    { axis = "twist" },
]
"#;

    #[test]
    fn reads_what_the_documentation_shows() {
        let calibration = read_calibration(EXAMPLE.as_bytes()).unwrap();
        let (uid, sensors) = calibration.parts().next().unwrap();
        assert_eq!(uid.to_string(), "00112233445566778899aabb");
        assert_eq!(sensors[1], SensorCalibration { zero_counts: Some(77), reversed: true, axis: JointAxis::Bend });
        assert_eq!(sensors[2], SensorCalibration::unzeroed(JointAxis::Twist));
    }

    #[test]
    fn errors_name_the_line() {
        let line_of = |text: &str| match read_calibration(text.as_bytes()) {
            Err(FormatError { place: crate::Place::Line(line), .. }) => Some(line),
            _ => None,
        };
        assert_eq!(line_of("version = 1\n[[part]]\nuid = \"12\"\nsensors = []\n"), Some(2));
        assert_eq!(line_of("version = 1\nspeed = 3\n"), Some(2));
        assert_eq!(line_of(&EXAMPLE.replace("8121", "70000")), Some(7));
        assert_eq!(line_of(&EXAMPLE.replace("\"bend\"", "\"roll\"")), Some(8));
        let twice = EXAMPLE.to_owned() + EXAMPLE.split_once("version = 1").unwrap().1;
        assert_eq!(line_of(&twice), Some(13));
        assert!(read_calibration(b"version = 2").unwrap_err().to_string().contains("version 2"));
        assert!(read_calibration(&[0xff, 0xfe]).is_err());
        assert!(read_calibration(b"").is_err());
    }

    proptest! {
        #[test]
        fn comes_back_as_it_went(parts in prop::collection::btree_map(any::<[u8; 12]>(),
            prop::collection::vec((any::<Option<u16>>(), any::<bool>(), any::<bool>()), 1..=3), 0..5)) {
            let mut calibration = Calibration::default();
            for (uid, sensors) in parts {
                let sensors = sensors.into_iter().map(|(zero_counts, reversed, bend)| SensorCalibration {
                    zero_counts, reversed, axis: if bend { JointAxis::Bend } else { JointAxis::Twist },
                });
                calibration.set_part(PartUid(uid), sensors.collect());
            }
            let text = write_calibration(&calibration);
            prop_assert_eq!(read_calibration(text.as_bytes()).unwrap(), calibration);
        }

        #[test]
        fn survives_any_text(text in "\\PC*", cut in 0..EXAMPLE.len()) {
            let _ = read_calibration(text.as_bytes());
            let _ = read_calibration(&EXAMPLE.as_bytes()[..cut]);
        }
    }
}
