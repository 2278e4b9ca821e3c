//! The payloads of calibration and mapping.

use armature_rig::{Calibration, JointAxis, Mapping, MappingEntry, PartUid, SensorCalibration};

use crate::bytes::{Fields, Put};
use crate::payload::{MAX_PARTS, put_count, put_text};
use crate::{PayloadError, WriteError};

mod sensor_flag {
    pub(super) const ZEROED: u8 = 1;
    pub(super) const REVERSED: u8 = 2;
    pub(super) const TWIST: u8 = 4;
}

/// Sensors a part may have in a calibration record.
const MAX_SENSORS_OF_A_PART: usize = u8::MAX as usize;

pub(crate) fn put_calibration(out: &mut Vec<u8>, calibration: &Calibration) -> Result<(), WriteError> {
    put_count(out, "the calibration", calibration.parts().count(), usize::from(u16::MAX))?;
    for (uid, sensors) in calibration.parts() {
        out.extend_from_slice(&uid.0);
        let (count, limit) = (sensors.len(), MAX_SENSORS_OF_A_PART);
        let too_many = WriteError::TooMany { field: "the calibration of a part", count, limit };
        out.put_u8(u8::try_from(count).map_err(|_| too_many)?);
        for sensor in sensors {
            let set = |on: bool, flag: u8| if on { flag } else { 0 };
            out.put_u8(
                set(sensor.zero_counts.is_some(), sensor_flag::ZEROED)
                    | set(sensor.reversed, sensor_flag::REVERSED)
                    | set(sensor.axis == JointAxis::Twist, sensor_flag::TWIST),
            );
            out.put_u16(sensor.zero_counts.unwrap_or(0));
        }
    }
    Ok(())
}

pub(crate) fn read_calibration(fields: &mut Fields<'_>) -> Result<Calibration, PayloadError> {
    let mut calibration = Calibration::default();
    for _ in 0..fields.u16("part count")? {
        let uid = PartUid(fields.array("part number")?);
        let mut sensors = Vec::new();
        for _ in 0..fields.u8("sensor count")? {
            let flags = fields.u8("flags")?;
            let zero = fields.u16("zero")?;
            sensors.push(SensorCalibration {
                zero_counts: (flags & sensor_flag::ZEROED != 0).then_some(zero),
                reversed: flags & sensor_flag::REVERSED != 0,
                axis: if flags & sensor_flag::TWIST != 0 { JointAxis::Twist } else { JointAxis::Bend },
            });
        }
        calibration.set_part(uid, sensors);
    }
    Ok(calibration)
}

pub(crate) fn put_mapping(out: &mut Vec<u8>, mapping: &Mapping) -> Result<(), WriteError> {
    put_count(out, "the mapping", mapping.entries.len(), MAX_PARTS)?;
    for entry in &mapping.entries {
        out.extend_from_slice(&entry.part.0);
        put_text(out, "a bone's name", &entry.bone)?;
        out.put_quat(entry.mounting);
    }
    Ok(())
}

pub(crate) fn read_mapping(fields: &mut Fields<'_>) -> Result<Mapping, PayloadError> {
    let count = usize::from(fields.u16("entry count")?);
    if count > MAX_PARTS {
        return Err(PayloadError::TooManyParts { count, limit: MAX_PARTS });
    }
    let mut entries = Vec::new();
    for _ in 0..count {
        let part = PartUid(fields.array("part number")?);
        let bone = fields.text("bone name")?;
        entries.push(MappingEntry { part, bone, mounting: fields.quat("mounting")? });
    }
    Ok(Mapping { entries })
}
