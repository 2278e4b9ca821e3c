//! Calibration as a TOML file that people can read and edit.
//!
//! ```toml
//! version = 2
//! filter = "none"
//!
//! [[part]]
//! uid = "00112233445566778899aabb"
//! filter = "one-euro:2,1,1"
//! mounting = [0.0, 0.7071068, 0.0, 0.7071068]
//! heading = 0.25
//! sensors = [
//!     { axis = "twist", zero_counts = 8121 },
//!     { axis = "bend", zero_counts = 77, reversed = true, range = { first_counts = 15000, span_counts = 5200 } },
//!     { axis = "twist" },
//! ]
//! ```
//! Sensors are listed from the part's inlet outwards; one without `zero_counts` was never zeroed. A `range` begins at
//! the stop from which counts rise towards the other stop, crossing count zero if the way leads there. `mounting` is a
//! quaternion (x, y, z, w), `heading` is in radians. A `filter` is `none`,
//! `one-euro:MIN_CUTOFF_HZ,BETA,SPEED_CUTOFF_HZ` or `hold:MILLISECONDS`; the one at the top is for all parts without
//! their own. Everything except `uid` and `sensors` is optional. Version 1 had zeros, signs and axes only.

use std::fmt::Write as _;

use armature_rig::{
    Calibration, Filter, FilterError, JointAxis, PartSettings, PartUid, SensorCalibration, SensorRange,
};
use glam::Quat;
use serde::Deserialize;

use super::toml_text::{check_version, line_at, toml_error, utf8};
use crate::FormatError;

const VERSION: u32 = 2;
const MAX_SENSORS: usize = 3;
const REMEDY: &str = "Correct the line, or delete the file and zero the puppet again";
/// A quaternion typed by hand is a little off; one further off is not a rotation.
const LENGTH_TOLERANCE: f32 = 1e-2;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct FileDto {
    version: u32,
    filter: Option<toml::Spanned<String>>,
    #[serde(default, rename = "part")]
    parts: Vec<toml::Spanned<PartDto>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PartDto {
    uid: String,
    filter: Option<String>,
    mounting: Option<[f32; 4]>,
    heading: Option<f64>,
    sensors: Vec<SensorDto>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct SensorDto {
    axis: AxisDto,
    zero_counts: Option<u16>,
    #[serde(default)]
    reversed: bool,
    range: Option<RangeDto>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
struct RangeDto {
    first_counts: u16,
    span_counts: u32,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum AxisDto {
    Bend,
    Twist,
}

/// Reads a calibration file. Parts that are not plugged in now are kept like all others.
///
/// ```
/// use armature_formats::settings::{read_calibration, write_calibration};
///
/// let text = r#"
///     version = 2
///     [[part]]
///     uid = "00112233445566778899aabb"
///     sensors = [{ axis = "twist", zero_counts = 8121 }]
/// "#;
/// let calibration = read_calibration(text.as_bytes())?;
/// assert_eq!(calibration.parts().count(), 1);
/// assert_eq!(read_calibration(write_calibration(&calibration).as_bytes())?, calibration);
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_calibration(bytes: &[u8]) -> Result<Calibration, FormatError> {
    let text = utf8(bytes, REMEDY)?;
    let file: FileDto = toml::from_str(text).map_err(|e| toml_error(text, &e, REMEDY))?;
    check_version("calibration", file.version, VERSION)?;
    let mut calibration = Calibration::default();
    if let Some(filter) = &file.filter {
        let line = line_at(text, filter.span().start);
        calibration.filter = filter.get_ref().parse().map_err(|e: FilterError| wrong(line, e.to_string()))?;
    }
    for part in &file.parts {
        let line = line_at(text, part.span().start);
        let part = part.get_ref();
        let uid: PartUid = part.uid.parse().map_err(|e: armature_rig::PartUidError| wrong(line, e.to_string()))?;
        if calibration.part(uid).is_some() {
            return Err(wrong(line, format!("part {uid} is listed twice")));
        }
        if part.sensors.is_empty() || part.sensors.len() > MAX_SENSORS {
            return Err(wrong(line, format!("part {uid} has {} sensors; a part has 1 to 3", part.sensors.len())));
        }
        calibration.set_part(uid, part.sensors.iter().map(|&sensor| from_dto(sensor)).collect());
        calibration.set_part_settings(uid, settings_from_dto(part).map_err(|what| wrong(line, what))?);
    }
    Ok(calibration)
}

/// Writes a calibration file; [`read_calibration`] returns the same calibration.
pub fn write_calibration(calibration: &Calibration) -> String {
    let mut text = format!("# What the counts of each sensor mean, part by part.\nversion = {VERSION}\n");
    if calibration.filter != Filter::None {
        let _ = writeln!(text, "filter = \"{}\"", calibration.filter);
    }
    for (uid, sensors) in calibration.parts() {
        let _ = write!(text, "\n[[part]]\nuid = \"{uid}\"\n");
        write_settings(&mut text, calibration.part_settings(uid));
        text.push_str("sensors = [\n");
        for sensor in sensors {
            let axis = match sensor.axis {
                JointAxis::Bend => "bend",
                JointAxis::Twist => "twist",
            };
            let zero = sensor.zero_counts.map_or_else(String::new, |counts| format!(", zero_counts = {counts}"));
            let reversed = if sensor.reversed { ", reversed = true" } else { "" };
            let range = sensor.range.map_or_else(String::new, |SensorRange { first_counts, span_counts }| {
                format!(", range = {{ first_counts = {first_counts}, span_counts = {span_counts} }}")
            });
            let _ = writeln!(text, "    {{ axis = \"{axis}\"{zero}{reversed}{range} }},");
        }
        text.push_str("]\n");
    }
    text
}

fn write_settings(text: &mut String, settings: PartSettings) {
    if let Some(filter) = settings.filter {
        let _ = writeln!(text, "filter = \"{filter}\"");
    }
    if settings.mounting != Quat::IDENTITY {
        let [x, y, z, w] = settings.mounting.to_array();
        let _ = writeln!(text, "mounting = [{x:?}, {y:?}, {z:?}, {w:?}]");
    }
    if settings.heading != 0.0 {
        let _ = writeln!(text, "heading = {:?}", settings.heading);
    }
}

fn settings_from_dto(part: &PartDto) -> Result<PartSettings, String> {
    let mounting = Quat::from_array(part.mounting.unwrap_or(Quat::IDENTITY.to_array()));
    let length = mounting.length();
    if !(length - 1.0).abs().le(&LENGTH_TOLERANCE) {
        return Err(format!("the mounting has length {length}; a rotation is a quaternion of length 1"));
    }
    let heading = part.heading.unwrap_or(0.0);
    if !heading.is_finite() {
        return Err(format!("a heading of {heading} is not an angle; give radians"));
    }
    Ok(PartSettings {
        mounting: if mounting.is_normalized() { mounting } else { mounting.normalize() },
        heading,
        filter: part.filter.as_deref().map(str::parse).transpose().map_err(|e: FilterError| e.to_string())?,
    })
}

fn from_dto(sensor: SensorDto) -> SensorCalibration {
    let axis = match sensor.axis {
        AxisDto::Bend => JointAxis::Bend,
        AxisDto::Twist => JointAxis::Twist,
    };
    let range = sensor.range.map(|RangeDto { first_counts, span_counts }| SensorRange { first_counts, span_counts });
    SensorCalibration { zero_counts: sensor.zero_counts, reversed: sensor.reversed, axis, range }
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
        let bend = SensorCalibration::unzeroed(JointAxis::Bend);
        assert_eq!(sensors[1], SensorCalibration { zero_counts: Some(77), reversed: true, ..bend });
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
        assert!(read_calibration(b"version = 3").unwrap_err().to_string().contains("version 3"));
        let settings =
            EXAMPLE.replace("sensors =", "filter = \"hold:100\"\nmounting = [0, 0, 0, 1]\nheading = 0.5\nsensors =");
        assert!(read_calibration(settings.as_bytes()).is_ok());
        assert_eq!(line_of(&settings.replace("hold", "holt")), Some(4));
        assert_eq!(line_of(&settings.replace("0, 1]", "0, 2]")), Some(4));
        assert_eq!(line_of(&settings.replace("0, 1]", "0, nan]")), Some(4));
        assert_eq!(line_of(&settings.replace("0.5", "inf")), Some(4));
        assert_eq!(line_of("version = 2\nfilter = \"x\"\n"), Some(2));
        assert!(read_calibration(&[0xff, 0xfe]).is_err());
        assert!(read_calibration(b"").is_err());
    }

    proptest! {
        #[test]
        fn comes_back_as_it_went(parts in prop::collection::btree_map(any::<[u8; 12]>(),
            prop::collection::vec((any::<Option<u16>>(), any::<bool>(), any::<bool>(), any::<Option<(u16, u32)>>()), 1..=3), 0..5),
            filters in prop::collection::vec(0_u8..3, 5), heading in -3.0_f64..3.0, turned: bool) {
            let mut calibration = Calibration::default();
            let filter = |kind: u8| [Filter::None, "one-euro".parse().unwrap(), "hold:12.5".parse().unwrap()][usize::from(kind)];
            calibration.filter = filter(filters[0]);
            for (index, (uid, sensors)) in parts.into_iter().enumerate() {
                let sensors = sensors.into_iter().map(|(zero_counts, reversed, bend, range)| SensorCalibration {
                    zero_counts, reversed, axis: if bend { JointAxis::Bend } else { JointAxis::Twist },
                    range: range.map(|(first_counts, span_counts)| SensorRange { first_counts, span_counts }),
                });
                calibration.set_part(PartUid(uid), sensors.collect());
                let mounting = if turned { Quat::from_rotation_z(heading as f32) } else { Quat::IDENTITY };
                let own = (index % 2 == 0).then(|| filter(filters[index]));
                calibration.set_part_settings(PartUid(uid), PartSettings { mounting, heading, filter: own });
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
