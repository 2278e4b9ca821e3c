//! The payloads of calibration, joint settings, mapping, ground and shapes.

use armature_rig::{
    Calibration, DriveAxis, Filter, Footing, Ground, GroundMode, GroundPoint, JointAxis, Mapping, MappingEntry,
    OneEuro, PartSettings, PartUid, RestTurn, SensorCalibration, SensorRange, ShapeDrive, SharedJoint, Sharing,
    Skeleton,
};
use glam::Quat;

use super::bytes::{Fields, Put};
use super::error::{PayloadError, WriteError};
use super::format::MAX_PARTS;
use super::payload::{put_count, put_text};
use super::record::ShapeSetting;

mod sensor_flag {
    pub(super) const ZEROED: u8 = 1;
    pub(super) const REVERSED: u8 = 2;
    pub(super) const TWIST: u8 = 4;
}

/// Sensors a part may have in a calibration record.
const MAX_SENSORS_OF_A_PART: usize = u8::MAX as usize;

pub(super) fn put_calibration(out: &mut Vec<u8>, calibration: &Calibration) -> Result<(), WriteError> {
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

pub(super) fn read_calibration(fields: &mut Fields<'_>) -> Result<Calibration, PayloadError> {
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
                range: None,
            });
        }
        calibration.set_part(uid, sensors);
    }
    Ok(calibration)
}

/// Whether a calibration contains more than its own record can hold.
pub(super) fn has_joint_settings(calibration: &Calibration) -> bool {
    let ranged = |(_, sensors): (PartUid, &[SensorCalibration])| sensors.iter().any(|sensor| sensor.range.is_some());
    calibration.filter != Filter::None || calibration.set_parts().next().is_some() || calibration.parts().any(ranged)
}

mod settings_flag {
    pub(super) const MOUNTING: u8 = 1;
    pub(super) const HEADING: u8 = 2;
    pub(super) const FILTER: u8 = 4;
}

pub(super) fn put_joint_settings(out: &mut Vec<u8>, calibration: &Calibration) -> Result<(), WriteError> {
    put_filter(out, calibration.filter);
    put_count(out, "the joint settings", calibration.set_parts().count(), usize::from(u16::MAX))?;
    for (uid, settings) in calibration.set_parts() {
        out.extend_from_slice(&uid.0);
        let set = |on: bool, flag: u8| if on { flag } else { 0 };
        let PartSettings { mounting, heading, filter } = settings;
        out.put_u8(
            set(mounting != Quat::IDENTITY, settings_flag::MOUNTING)
                | set(heading != 0.0, settings_flag::HEADING)
                | set(filter.is_some(), settings_flag::FILTER),
        );
        out.put_quat(mounting);
        out.put_f64(heading);
        put_filter(out, filter.unwrap_or_default());
    }
    let ranges: Vec<_> = calibration
        .parts()
        .flat_map(|(uid, sensors)| sensors.iter().enumerate().map(move |(index, sensor)| (uid, index, sensor.range)))
        .filter_map(|(uid, index, range)| Some((uid, index, range?)))
        .collect();
    put_count(out, "the ranges", ranges.len(), usize::from(u16::MAX))?;
    for (uid, index, range) in ranges {
        out.extend_from_slice(&uid.0);
        // The calibration's own record, which comes before this one, has no space for more.
        out.put_u8(index as u8);
        out.put_u16(range.first_counts);
        out.put_u32(range.span_counts);
    }
    Ok(())
}

/// Adds the contents of the joint settings record to the calibration before it.
pub(super) fn read_joint_settings(fields: &mut Fields<'_>, calibration: &mut Calibration) -> Result<(), PayloadError> {
    calibration.filter = read_filter(fields)?;
    for _ in 0..fields.u16("part count")? {
        let uid = PartUid(fields.array("part number")?);
        let flags = fields.u8("flags")?;
        let mounting = fields.quat("mounting")?;
        let heading = fields.f64("heading")?;
        let filter = read_filter(fields)?;
        let settings = PartSettings {
            mounting: if flags & settings_flag::MOUNTING != 0 { mounting } else { Quat::IDENTITY },
            heading: if flags & settings_flag::HEADING != 0 { heading } else { 0.0 },
            filter: (flags & settings_flag::FILTER != 0).then_some(filter),
        };
        calibration.set_part_settings(uid, settings);
    }
    for _ in 0..fields.u16("range count")? {
        let uid = PartUid(fields.array("part number")?);
        let sensor = usize::from(fields.u8("sensor")?);
        let (first_counts, span_counts) = (fields.u16("first count")?, fields.u32("span")?);
        let found = calibration.sensor_mut(uid, sensor).ok_or(PayloadError::NoSuchSensor)?;
        found.range = Some(SensorRange { first_counts, span_counts });
    }
    Ok(())
}

fn put_filter(out: &mut Vec<u8>, filter: Filter) {
    let (kind, numbers) = match filter {
        Filter::None => (0, [0.0; 3]),
        Filter::OneEuro(OneEuro { min_cutoff, beta, speed_cutoff }) => (1, [min_cutoff, beta, speed_cutoff]),
        Filter::Hold { patience_seconds } => (2, [patience_seconds, 0.0, 0.0]),
    };
    out.put_u8(kind);
    numbers.into_iter().for_each(|number| out.put_f64(number));
}

fn read_filter(fields: &mut Fields<'_>) -> Result<Filter, PayloadError> {
    let kind = fields.u8("filter")?;
    let [a, b, c] = [fields.f64("filter")?, fields.f64("filter")?, fields.f64("filter")?];
    let filter = match kind {
        0 => Filter::None,
        1 => Filter::OneEuro(OneEuro { min_cutoff: a, beta: b, speed_cutoff: c }),
        2 => Filter::Hold { patience_seconds: a },
        _ => return Err(PayloadError::UnknownCode { field: "filter", value: kind.into() }),
    };
    filter
        .problem()
        .map_or(Ok(filter), |_| Err(PayloadError::UnknownCode { field: "filter's settings", value: kind.into() }))
}

pub(super) fn put_mapping(out: &mut Vec<u8>, mapping: &Mapping) -> Result<(), WriteError> {
    put_count(out, "the mapping", mapping.entries.len(), MAX_PARTS)?;
    put_entries(out, &mapping.entries)?;
    // Lists are appended as far as there is something to say.
    let shares = !(mapping.shared.is_empty() && mapping.shapes.is_empty());
    let rest = shares || !mapping.rest.is_empty();
    if rest || !mapping.carried.is_empty() {
        put_count(out, "joints without a bone", mapping.carried.len(), usize::from(u16::MAX))?;
        put_entries(out, &mapping.carried)?;
    }
    if rest {
        put_count(out, "turns of the rest pose", mapping.rest.len(), usize::from(u16::MAX))?;
        for turn in &mapping.rest {
            put_text(out, "a bone's name", &turn.bone)?;
            turn.degrees.to_array().into_iter().for_each(|degrees| out.put_f64(degrees.into()));
        }
    }
    if shares {
        put_shared(out, &mapping.shared)?;
        put_shapes(out, &mapping.shapes)?;
    }
    Ok(())
}

mod sharing_code {
    pub(super) const CHAIN: u8 = 1;
    pub(super) const CURL: u8 = 2;
}

fn put_shared(out: &mut Vec<u8>, shared: &[SharedJoint]) -> Result<(), WriteError> {
    put_count(out, "shared joints", shared.len(), MAX_PARTS)?;
    for joint in shared {
        out.extend_from_slice(&joint.part.0);
        out.put_u8(match joint.sharing {
            Sharing::Chain => sharing_code::CHAIN,
            Sharing::Curl => sharing_code::CURL,
        });
        put_count(out, "the bones of a shared joint", joint.bones.len(), Skeleton::MAX_BONES)?;
        for (bone, share) in &joint.bones {
            put_text(out, "a bone's name", bone)?;
            out.put_f64(*share);
        }
    }
    Ok(())
}

fn read_shared(fields: &mut Fields<'_>) -> Result<Vec<SharedJoint>, PayloadError> {
    let mut shared = Vec::new();
    for _ in 0..fields.u16("count of shared joints")? {
        let part = PartUid(fields.array("part number")?);
        let sharing = match fields.u8("sharing")? {
            sharing_code::CHAIN => Sharing::Chain,
            sharing_code::CURL => Sharing::Curl,
            value => return Err(PayloadError::UnknownCode { field: "sharing", value: value.into() }),
        };
        let mut bones = Vec::new();
        for _ in 0..fields.u16("count of bones")? {
            bones.push((fields.text("bone name")?, fields.f64("share")?));
        }
        shared.push(SharedJoint { part, sharing, bones });
    }
    Ok(shared)
}

fn put_shapes(out: &mut Vec<u8>, shapes: &[ShapeDrive]) -> Result<(), WriteError> {
    put_count(out, "driven shapes", shapes.len(), usize::from(u16::MAX))?;
    for drive in shapes {
        put_text(out, "a shape's name", &drive.shape)?;
        out.extend_from_slice(&drive.part.0);
        out.put_u8(DriveAxis::ALL.iter().position(|axis| *axis == drive.axis).unwrap_or(0) as u8);
        drive.degrees.iter().chain(&drive.weights).for_each(|number| out.put_f64(*number));
    }
    Ok(())
}

fn read_shapes(fields: &mut Fields<'_>) -> Result<Vec<ShapeDrive>, PayloadError> {
    let mut shapes = Vec::new();
    for _ in 0..fields.u16("count of driven shapes")? {
        let (shape, part) = (fields.text("shape name")?, PartUid(fields.array("part number")?));
        let code = fields.u8("axis")?;
        let axis = *DriveAxis::ALL
            .get(usize::from(code))
            .ok_or(PayloadError::UnknownCode { field: "axis", value: code.into() })?;
        let mut number = || fields.f64("angle or weight");
        let (degrees, weights) = ([number()?, number()?], [number()?, number()?]);
        shapes.push(ShapeDrive { shape, part, axis, degrees, weights });
    }
    Ok(shapes)
}

fn put_entries(out: &mut Vec<u8>, entries: &[MappingEntry]) -> Result<(), WriteError> {
    for entry in entries {
        out.extend_from_slice(&entry.part.0);
        put_text(out, "a bone's name", &entry.bone)?;
        out.put_quat(entry.mounting);
    }
    Ok(())
}

pub(super) fn read_mapping(fields: &mut Fields<'_>) -> Result<Mapping, PayloadError> {
    let count = usize::from(fields.u16("entry count")?);
    if count > MAX_PARTS {
        return Err(PayloadError::TooManyParts { count, limit: MAX_PARTS });
    }
    let entries = read_entries(fields, count)?;
    // Added after the first takes.
    let count = if fields.left() > 0 { usize::from(fields.u16("count of joints without a bone")?) } else { 0 };
    let carried = read_entries(fields, count)?;
    // Added after those.
    let count = if fields.left() > 0 { usize::from(fields.u16("count of turns of the rest pose")?) } else { 0 };
    let mut rest = Vec::new();
    for _ in 0..count {
        let bone = fields.text("bone name")?;
        let mut degree = || Ok::<f32, PayloadError>(fields.f64("turn of the rest pose")? as f32);
        rest.push(RestTurn { bone, degrees: [degree()?, degree()?, degree()?].into() });
    }
    // Added after those.
    let (shared, shapes) =
        if fields.left() > 0 { (read_shared(fields)?, read_shapes(fields)?) } else { (Vec::new(), Vec::new()) };
    Ok(Mapping { entries, carried, rest, shared, shapes })
}

fn read_entries(fields: &mut Fields<'_>, count: usize) -> Result<Vec<MappingEntry>, PayloadError> {
    let mut entries = Vec::new();
    for _ in 0..count {
        let part = PartUid(fields.array("part number")?);
        let bone = fields.text("bone name")?;
        entries.push(MappingEntry { part, bone, mounting: fields.quat("mounting")? });
    }
    Ok(entries)
}

mod shape_flag {
    pub(super) const DEVICE_TIME: u8 = 1;
}

pub(super) fn put_shape_setting(out: &mut Vec<u8>, setting: &ShapeSetting) -> Result<(), WriteError> {
    let ShapeSetting { device_micros, name, weight } = setting;
    if !weight.is_finite() {
        return Err(WriteError::BadWeight { shape: name.clone(), weight: *weight });
    }
    out.put_u8(if device_micros.is_some() { shape_flag::DEVICE_TIME } else { 0 });
    out.put_u64(device_micros.unwrap_or(0));
    put_text(out, "a shape's name", name)?;
    out.put_f32(*weight);
    Ok(())
}

pub(super) fn read_shape_setting(fields: &mut Fields<'_>) -> Result<ShapeSetting, PayloadError> {
    let flags = fields.u8("flags")?;
    let device_micros = fields.u64("device time")?;
    let (name, weight) = (fields.text("shape name")?, fields.f32("weight")?);
    if !weight.is_finite() {
        return Err(PayloadError::BadWeight { shape: name });
    }
    Ok(ShapeSetting { device_micros: (flags & shape_flag::DEVICE_TIME != 0).then_some(device_micros), name, weight })
}

mod ground_mode {
    pub(super) const OFF: u8 = 0;
    pub(super) const STAND: u8 = 1;
    pub(super) const WALK: u8 = 2;
}

mod footing {
    pub(super) const POINT: u8 = 0;
    pub(super) const SOLE: u8 = 1;
}

pub(super) fn put_ground(out: &mut Vec<u8>, ground: Option<&Ground>) -> Result<(), WriteError> {
    let Some(ground) = ground else {
        out.put_u8(ground_mode::OFF);
        return Ok(());
    };
    out.put_u8(match ground.mode {
        GroundMode::Stand => ground_mode::STAND,
        GroundMode::Walk => ground_mode::WALK,
    });
    out.put_f32(ground.floor);
    put_count(out, "the contacts", ground.contacts.len(), Skeleton::MAX_BONES)?;
    ground.contacts.iter().for_each(|&bone| out.put_u16(bone as u16));
    out.put_u32(ground.points.len() as u32);
    for point in &ground.points {
        out.put_u16(point.bone as u16);
        out.put_vec3(point.at);
    }
    if ground.footing != Footing::Point || ground.is_held {
        out.put_u8(match ground.footing {
            Footing::Point => footing::POINT,
            Footing::Sole => footing::SOLE,
        });
        out.put_u8(u8::from(ground.is_held));
    }
    Ok(())
}

pub(super) fn read_ground(
    fields: &mut Fields<'_>,
    skeleton: Option<&Skeleton>,
) -> Result<Option<Ground>, PayloadError> {
    let mode = match fields.u8("mode")? {
        ground_mode::OFF => return Ok(None),
        ground_mode::STAND => GroundMode::Stand,
        ground_mode::WALK => GroundMode::Walk,
        value => return Err(PayloadError::UnknownCode { field: "mode", value: value.into() }),
    };
    let (contacts, points) = (Vec::new(), Vec::new());
    let floor = fields.f32("floor")?;
    let mut ground = Ground { mode, footing: Footing::Point, is_held: false, floor, contacts, points };
    for _ in 0..fields.u16("contact count")? {
        ground.contacts.push(fields.u16("contact")?.into());
    }
    for _ in 0..fields.u32("point count")? {
        ground.points.push(GroundPoint { bone: fields.u16("bone")?.into(), at: fields.vec3("point")? });
    }
    // Added after the first takes with a floor.
    if fields.left() > 0 {
        ground.footing = match fields.u8("footing")? {
            footing::POINT => Footing::Point,
            footing::SOLE => Footing::Sole,
            value => return Err(PayloadError::UnknownCode { field: "footing", value: value.into() }),
        };
        ground.is_held = fields.u8("whether the roots are held")? != 0;
    }
    ground.check(skeleton.ok_or(PayloadError::NoSkeleton)?)?;
    Ok(Some(ground))
}
