//! The payload of targets.

use armature_rig::{Skeleton, Target, TargetChange, TargetPoint};

use super::bytes::{Fields, Put};
use super::error::PayloadError;

mod action {
    pub(super) const RELEASE: u8 = 0;
    pub(super) const SET: u8 = 1;
}

mod point {
    pub(super) const HEAD: u8 = 0;
    pub(super) const TAIL: u8 = 1;
    pub(super) const SKIN: u8 = 2;
}

mod given {
    pub(super) const POSITION: u8 = 1;
    pub(super) const ORIENTATION: u8 = 2;
}

pub(super) fn put_target(out: &mut Vec<u8>, change: &TargetChange) {
    let (action, over_micros) = match change {
        TargetChange::Set { over_micros, .. } => (action::SET, over_micros),
        TargetChange::Release { over_micros, .. } => (action::RELEASE, over_micros),
    };
    out.put_u8(action);
    out.put_u32(*over_micros);
    match change.point() {
        TargetPoint::Head(bone) => {
            out.put_u8(point::HEAD);
            out.put_u16(bone as u16);
        }
        TargetPoint::Tail(bone) => {
            out.put_u8(point::TAIL);
            out.put_u16(bone as u16);
        }
        TargetPoint::Skin { vertices, barycentric } => {
            out.put_u8(point::SKIN);
            vertices.into_iter().for_each(|vertex| out.put_u32(vertex));
            barycentric.into_iter().for_each(|share| out.put_f32(share));
        }
    }
    let TargetChange::Set { target, .. } = change else { return };
    let set = |on: bool, flag: u8| if on { flag } else { 0 };
    out.put_u8(set(target.position.is_some(), given::POSITION) | set(target.orientation.is_some(), given::ORIENTATION));
    out.put_f32(target.strength);
    target.position.iter().for_each(|position| out.put_vec3(*position));
    target.orientation.iter().for_each(|orientation| out.put_quat(*orientation));
}

pub(super) fn read_target(fields: &mut Fields<'_>, skeleton: Option<&Skeleton>) -> Result<TargetChange, PayloadError> {
    let action = fields.u8("action")?;
    let over_micros = fields.u32("time")?;
    let point = match fields.u8("point")? {
        point::HEAD => TargetPoint::Head(fields.u16("bone")?.into()),
        point::TAIL => TargetPoint::Tail(fields.u16("bone")?.into()),
        point::SKIN => {
            let vertices = [fields.u32("vertex")?, fields.u32("vertex")?, fields.u32("vertex")?];
            let barycentric = [fields.f32("share")?, fields.f32("share")?, fields.f32("share")?];
            TargetPoint::Skin { vertices, barycentric }
        }
        value => return Err(PayloadError::UnknownCode { field: "point", value: value.into() }),
    };
    let change = match action {
        action::RELEASE => TargetChange::Release { point, over_micros },
        action::SET => {
            let flags = fields.u8("what is given")?;
            let strength = fields.f32("strength")?;
            let position = (flags & given::POSITION != 0).then(|| fields.vec3("place")).transpose()?;
            let orientation = (flags & given::ORIENTATION != 0).then(|| fields.quat("orientation")).transpose()?;
            TargetChange::Set { target: Target { point, position, orientation, strength }, over_micros }
        }
        value => return Err(PayloadError::UnknownCode { field: "action", value: value.into() }),
    };
    change.check(skeleton.ok_or(PayloadError::NoSkeleton)?)?;
    Ok(change)
}
