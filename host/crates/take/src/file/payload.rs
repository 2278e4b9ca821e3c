//! The payloads of header, skeleton, topology, sample, pose, event and end.
//!
//! The table in the [module's documentation](super) is the contract; every `put_` here is next to its `read_`.

use armature_rig::{Bone, JointTree, Part, PartKind, PartUid, RawSample, SensorState, Skeleton, Transform};

use super::bytes::{Fields, NONE_U16, Put};
use super::error::{PayloadError, WriteError};
use super::format::MAX_PARTS;
use super::packed_pose::PackedPose;
use super::record::{ClockFault, Event, EventKind, Header, InverseKinematicsHeader, Sample, Topology, Totals};

pub(super) fn put_text(out: &mut Vec<u8>, field: &'static str, text: &str) -> Result<(), WriteError> {
    put_count(out, field, text.len(), usize::from(u16::MAX))?;
    out.extend_from_slice(text.as_bytes());
    Ok(())
}

pub(super) fn put_count(out: &mut Vec<u8>, field: &'static str, count: usize, limit: usize) -> Result<(), WriteError> {
    let short = u16::try_from(count).ok().filter(|_| count <= limit);
    out.put_u16(short.ok_or(WriteError::TooMany { field, count, limit })?);
    Ok(())
}

mod header_flag {
    pub(super) const VIRTUAL_CLOCK: u32 = 1;
    pub(super) const RATE: u32 = 2;
    pub(super) const SEED: u32 = 4;
    pub(super) const UNIX_MICROS: u32 = 8;
    pub(super) const INVERSE_KINEMATICS: u32 = 16;
    pub(super) const PREFERENCES: u32 = 32;
    pub(super) const LIMITS: u32 = 64;
    pub(super) const IK_SETTINGS: u32 = 128;
}

pub(super) fn put_header(out: &mut Vec<u8>, header: &Header) -> Result<(), WriteError> {
    let set = |on: bool, flag: u32| if on { flag } else { 0 };
    let preferences = header.inverse_kinematics.as_ref().map(|ik| &ik.preferences).filter(|words| !words.is_empty());
    let limits = header.inverse_kinematics.as_ref().map(|ik| &ik.limits).filter(|words| !words.is_empty());
    let settings = header.inverse_kinematics.as_ref().map(|ik| &ik.settings).filter(|words| !words.is_empty());
    out.put_u32(
        set(header.virtual_clock, header_flag::VIRTUAL_CLOCK)
            | set(header.nominal_samples_per_second.is_some(), header_flag::RATE)
            | set(header.seed.is_some(), header_flag::SEED)
            | set(header.unix_micros.is_some(), header_flag::UNIX_MICROS)
            | set(header.inverse_kinematics.is_some(), header_flag::INVERSE_KINEMATICS)
            | set(preferences.is_some(), header_flag::PREFERENCES)
            | set(limits.is_some(), header_flag::LIMITS)
            | set(settings.is_some(), header_flag::IK_SETTINGS),
    );
    out.put_f64(header.nominal_samples_per_second.unwrap_or(0.0));
    out.put_u64(header.seed.unwrap_or(0));
    out.put_u64(header.unix_micros.unwrap_or(0) as u64);
    out.extend_from_slice(&header.character_hash);
    put_text(out, "the character's name", &header.character_name)?;
    put_text(out, "the program's version", &header.program_version)?;
    let Some(ik) = &header.inverse_kinematics else { return Ok(()) };
    put_count(out, "the pinned bones", ik.pins.len(), Skeleton::MAX_BONES)?;
    ik.pins.iter().try_for_each(|name| put_text(out, "a pinned bone's name", name))?;
    if let Some(preferences) = preferences {
        put_count(out, "what bones prefer", preferences.len(), Skeleton::MAX_BONES)?;
        preferences.iter().try_for_each(|words| put_text(out, "what a bone prefers", words))?;
    }
    if let Some(limits) = limits {
        put_count(out, "the limits of joints", limits.len(), Skeleton::MAX_BONES)?;
        limits.iter().try_for_each(|words| put_text(out, "the limit of a joint", words))?;
    }
    let Some(settings) = settings else { return Ok(()) };
    put_count(out, "the settings of inverse kinematics", settings.len(), Skeleton::MAX_BONES)?;
    settings.iter().try_for_each(|words| put_text(out, "a setting of inverse kinematics", words))
}

/// The record of inverse kinematics that begins in the middle of a take.
pub(super) fn put_inverse_kinematics(out: &mut Vec<u8>, ik: &InverseKinematicsHeader) -> Result<(), WriteError> {
    for (field, words) in
        [("the pinned bones", &ik.pins), ("what bones prefer", &ik.preferences), ("the limits of joints", &ik.limits)]
    {
        put_count(out, field, words.len(), Skeleton::MAX_BONES)?;
        words.iter().try_for_each(|words| put_text(out, field, words))?;
    }
    if ik.settings.is_empty() {
        return Ok(());
    }
    put_count(out, "the settings of inverse kinematics", ik.settings.len(), Skeleton::MAX_BONES)?;
    ik.settings.iter().try_for_each(|words| put_text(out, "a setting of inverse kinematics", words))
}

pub(super) fn read_inverse_kinematics(fields: &mut Fields<'_>) -> Result<InverseKinematicsHeader, PayloadError> {
    fn words(fields: &mut Fields<'_>, field: &'static str) -> Result<Vec<String>, PayloadError> {
        let count = fields.u16(field)?;
        (0..count).map(|_| fields.text(field)).collect()
    }
    let (pins, preferences) = (words(fields, "pinned bones")?, words(fields, "preferences")?);
    let limits = words(fields, "limits")?;
    let settings = if fields.left() > 0 { words(fields, "settings")? } else { Vec::new() };
    Ok(InverseKinematicsHeader { pins, preferences, limits, settings })
}

pub(super) fn read_header(fields: &mut Fields<'_>) -> Result<Header, PayloadError> {
    let flags = fields.u32("flags")?;
    let rate = fields.f64("nominal rate")?;
    let seed = fields.u64("seed")?;
    let unix_micros = fields.u64("wall-clock time")? as i64;
    let mut header = Header {
        virtual_clock: flags & header_flag::VIRTUAL_CLOCK != 0,
        nominal_samples_per_second: (flags & header_flag::RATE != 0).then_some(rate),
        seed: (flags & header_flag::SEED != 0).then_some(seed),
        unix_micros: (flags & header_flag::UNIX_MICROS != 0).then_some(unix_micros),
        character_hash: fields.array("character hash")?,
        character_name: fields.text("character name")?,
        program_version: fields.text("program version")?,
        inverse_kinematics: None,
    };
    if flags & header_flag::INVERSE_KINEMATICS != 0 {
        let count = fields.u16("pinned bones")?;
        let pins = (0..count).map(|_| fields.text("pinned bone")).collect::<Result<_, _>>()?;
        let count = if flags & header_flag::PREFERENCES != 0 { fields.u16("preferences")? } else { 0 };
        let preferences = (0..count).map(|_| fields.text("what a bone prefers")).collect::<Result<_, _>>()?;
        let count = if flags & header_flag::LIMITS != 0 { fields.u16("limits")? } else { 0 };
        let limits = (0..count).map(|_| fields.text("the limit of a joint")).collect::<Result<_, _>>()?;
        let count = if flags & header_flag::IK_SETTINGS != 0 { fields.u16("settings")? } else { 0 };
        let settings = (0..count).map(|_| fields.text("a setting")).collect::<Result<_, _>>()?;
        header.inverse_kinematics = Some(InverseKinematicsHeader { pins, preferences, limits, settings });
    }
    Ok(header)
}

fn put_parent(out: &mut Vec<u8>, parent: Option<usize>) {
    out.put_u16(parent.map_or(NONE_U16, |index| index as u16));
}

fn read_parent(fields: &mut Fields<'_>) -> Result<Option<usize>, PayloadError> {
    let index = fields.u16("parent")?;
    Ok((index != NONE_U16).then_some(usize::from(index)))
}

pub(super) fn put_skeleton(out: &mut Vec<u8>, skeleton: &Skeleton) -> Result<(), WriteError> {
    put_count(out, "the skeleton", skeleton.len(), Skeleton::MAX_BONES)?;
    for bone in skeleton.bones() {
        put_text(out, "a bone's name", &bone.name)?;
        put_parent(out, bone.parent);
        out.put_vec3(bone.rest.translation);
        out.put_quat(bone.rest.rotation);
        out.put_vec3(bone.rest.scale);
        out.put_vec3(bone.tail);
    }
    Ok(())
}

pub(super) fn read_skeleton(fields: &mut Fields<'_>) -> Result<Skeleton, PayloadError> {
    let count = fields.u16("bone count")?;
    let mut bones = Vec::new();
    for _ in 0..count {
        bones.push(Bone {
            name: fields.text("bone name")?,
            parent: read_parent(fields)?,
            rest: Transform {
                translation: fields.vec3("rest translation")?,
                rotation: fields.quat("rest rotation")?,
                scale: fields.vec3("rest scale")?,
            },
            tail: fields.vec3("tail")?,
        });
    }
    Ok(Skeleton::new(bones)?)
}

pub(super) fn put_topology(out: &mut Vec<u8>, epoch: u16, tree: &JointTree) -> Result<(), WriteError> {
    out.put_u16(epoch);
    put_count(out, "the joint tree", tree.parts().len(), MAX_PARTS)?;
    for part in tree.parts() {
        out.extend_from_slice(&part.uid.0);
        let (kind, outlets) = match part.kind {
            PartKind::Bend => (1, 0),
            PartKind::Twist => (2, 0),
            PartKind::TwistBendTwist => (3, 0),
            PartKind::Splitter { outlets } => (4, outlets),
        };
        out.put_u8(kind);
        out.put_u8(outlets);
        put_parent(out, part.parent);
        out.put_u8(part.outlet);
        out.put_u32(part.counts_per_turn);
    }
    Ok(())
}

pub(super) fn read_topology(fields: &mut Fields<'_>) -> Result<Topology, PayloadError> {
    let epoch = fields.u16("epoch")?;
    let count = usize::from(fields.u16("part count")?);
    if count > MAX_PARTS {
        return Err(PayloadError::TooManyParts { count, limit: MAX_PARTS });
    }
    let mut parts = Vec::new();
    for _ in 0..count {
        let uid = PartUid(fields.array("part number")?);
        let kind = fields.u8("part kind")?;
        let outlets = fields.u8("outlets")?;
        let kind = match kind {
            1 => PartKind::Bend,
            2 => PartKind::Twist,
            3 => PartKind::TwistBendTwist,
            4 => PartKind::Splitter { outlets },
            _ => return Err(PayloadError::UnknownCode { field: "part kind", value: kind.into() }),
        };
        let parent = read_parent(fields)?;
        let outlet = fields.u8("outlet")?;
        let counts_per_turn = fields.u32("counts per turn")?;
        parts.push(Part { uid, kind, parent, outlet, counts_per_turn });
    }
    Ok(Topology { epoch, tree: JointTree::new(parts)? })
}

mod sample_flag {
    pub(super) const HOST_TIME: u8 = 1;
    pub(super) const STATES: u8 = 2;
}

pub(super) fn put_sample(
    out: &mut Vec<u8>,
    raw: &RawSample,
    host_receive_seconds: Option<f64>,
) -> Result<(), WriteError> {
    if raw.counts.len() != raw.states.len() {
        return Err(WriteError::UnevenSample { counts: raw.counts.len(), states: raw.states.len() });
    }
    let all_ok = raw.states.iter().all(|&state| state == SensorState::Ok);
    out.put_u32(raw.sequence);
    out.put_u64(raw.device_micros);
    out.put_u16(raw.epoch);
    out.put_u8(
        if host_receive_seconds.is_some() { sample_flag::HOST_TIME } else { 0 }
            | if all_ok { 0 } else { sample_flag::STATES },
    );
    put_count(out, "the sample", raw.counts.len(), usize::from(u16::MAX))?;
    if let Some(seconds) = host_receive_seconds {
        out.put_f64(seconds);
    }
    out.extend(raw.counts.iter().flat_map(|count| count.to_le_bytes()));
    if !all_ok {
        out.extend(raw.states.chunks(4).map(|four| {
            four.iter().enumerate().fold(0, |byte, (place, &state)| byte | (state_code(state) << (2 * place)))
        }));
    }
    Ok(())
}

pub(super) fn read_sample(fields: &mut Fields<'_>) -> Result<Sample, PayloadError> {
    let sequence = fields.u32("sequence number")?;
    let device_micros = fields.u64("device time")?;
    let epoch = fields.u16("epoch")?;
    let flags = fields.u8("flags")?;
    let sensors = usize::from(fields.u16("sensor count")?);
    let host_receive_seconds = if flags & sample_flag::HOST_TIME != 0 { Some(fields.f64("host time")?) } else { None };
    let counts = fields.bytes(2 * sensors, "counts")?;
    let states = if flags & sample_flag::STATES != 0 {
        let packed = fields.bytes(sensors.div_ceil(4), "states")?;
        (0..sensors).map(|sensor| state_of(packed[sensor / 4] >> (2 * (sensor % 4)))).collect()
    } else {
        vec![SensorState::Ok; sensors]
    };
    let counts = counts.as_chunks().0.iter().map(|&pair| u16::from_le_bytes(pair)).collect();
    Ok(Sample { raw: RawSample { device_micros, sequence, epoch, counts, states }, host_receive_seconds })
}

fn state_code(state: SensorState) -> u8 {
    match state {
        SensorState::Ok => 0,
        SensorState::NoData => 1,
        SensorState::MagnetWeak => 2,
        SensorState::Outlier => 3,
    }
}

fn state_of(bits: u8) -> SensorState {
    match bits & 3 {
        0 => SensorState::Ok,
        1 => SensorState::NoData,
        2 => SensorState::MagnetWeak,
        _ => SensorState::Outlier,
    }
}

pub(super) fn put_pose_head(out: &mut Vec<u8>, sequence: u32, device_micros: u64, bone_count: usize) {
    out.put_u32(sequence);
    out.put_u64(device_micros);
    out.put_u16(bone_count as u16);
}

pub(super) fn read_pose(fields: &mut Fields<'_>, skeleton: Option<&Skeleton>) -> Result<PackedPose, PayloadError> {
    let expected = skeleton.ok_or(PayloadError::NoSkeleton)?.len();
    let sequence = fields.u32("sequence number")?;
    let device_micros = fields.u64("device time")?;
    let bone_count = fields.u16("bone count")?;
    if usize::from(bone_count) != expected {
        return Err(PayloadError::BoneCount { got: bone_count.into(), expected });
    }
    PackedPose::read(sequence, device_micros, bone_count, fields)
}

mod event_flag {
    pub(super) const DEVICE_TIME: u8 = 1;
    pub(super) const HOST_TIME: u8 = 2;
}

pub(super) fn put_event(out: &mut Vec<u8>, event: &Event) -> Result<(), WriteError> {
    out.put_u8(
        if event.device_micros.is_some() { event_flag::DEVICE_TIME } else { 0 }
            | if event.host_seconds.is_some() { event_flag::HOST_TIME } else { 0 },
    );
    out.put_u64(event.device_micros.unwrap_or(0));
    out.put_f64(event.host_seconds.unwrap_or(0.0));
    match &event.kind {
        EventKind::LostSamples { count, after_sequence } => {
            out.put_u16(1);
            out.put_u64(*count);
            out.put_u32(*after_sequence);
        }
        EventKind::Noise { crc_errors, discarded_bytes } => {
            out.put_u16(2);
            out.put_u64(*crc_errors);
            out.put_u64(*discarded_bytes);
        }
        EventKind::Restart => out.put_u16(3),
        EventKind::Reconnect => out.put_u16(4),
        EventKind::TopologyChange { epoch } => {
            out.put_u16(5);
            out.put_u16(*epoch);
        }
        EventKind::Marker { text } => {
            out.put_u16(6);
            put_text(out, "the marker", text)?;
        }
        EventKind::Resync { count } => {
            out.put_u16(7);
            out.put_u64(*count);
        }
        EventKind::ClockFault { fault, micros } => {
            out.put_u16(8);
            out.put_u8(match fault {
                ClockFault::Leapt => 1,
                ClockFault::Stood => 2,
                ClockFault::WentBack => 3,
            });
            out.put_u64(*micros);
        }
        EventKind::Posing { p50_micros, p99_micros, max_micros } => {
            out.put_u16(9);
            [p50_micros, p99_micros, max_micros].into_iter().for_each(|micros| out.put_u32(*micros));
        }
    }
    Ok(())
}

pub(super) fn read_event(fields: &mut Fields<'_>) -> Result<Event, PayloadError> {
    let flags = fields.u8("flags")?;
    let device_micros = fields.u64("device time")?;
    let host_seconds = fields.f64("host time")?;
    let kind = match fields.u16("event code")? {
        1 => EventKind::LostSamples { count: fields.u64("count")?, after_sequence: fields.u32("sequence number")? },
        2 => EventKind::Noise {
            crc_errors: fields.u64("checksum errors")?,
            discarded_bytes: fields.u64("discarded bytes")?,
        },
        3 => EventKind::Restart,
        4 => EventKind::Reconnect,
        5 => EventKind::TopologyChange { epoch: fields.u16("epoch")? },
        6 => EventKind::Marker { text: fields.text("marker")? },
        7 => EventKind::Resync { count: fields.u64("count")? },
        8 => EventKind::ClockFault {
            fault: match fields.u8("clock fault")? {
                1 => ClockFault::Leapt,
                2 => ClockFault::Stood,
                3 => ClockFault::WentBack,
                value => return Err(PayloadError::UnknownCode { field: "clock fault", value: value.into() }),
            },
            micros: fields.u64("time")?,
        },
        9 => EventKind::Posing {
            p50_micros: fields.u32("time")?,
            p99_micros: fields.u32("time")?,
            max_micros: fields.u32("time")?,
        },
        code => return Err(PayloadError::UnknownCode { field: "event code", value: code.into() }),
    };
    Ok(Event {
        device_micros: (flags & event_flag::DEVICE_TIME != 0).then_some(device_micros),
        host_seconds: (flags & event_flag::HOST_TIME != 0).then_some(host_seconds),
        kind,
    })
}

pub(super) fn put_totals(out: &mut Vec<u8>, totals: &Totals) {
    for number in [totals.records, totals.samples, totals.poses, totals.events, totals.bytes] {
        out.put_u64(number);
    }
}

pub(super) fn read_totals(fields: &mut Fields<'_>) -> Result<Totals, PayloadError> {
    Ok(Totals {
        records: fields.u64("records")?,
        samples: fields.u64("samples")?,
        poses: fields.u64("poses")?,
        events: fields.u64("events")?,
        bytes: fields.u64("bytes")?,
    })
}
