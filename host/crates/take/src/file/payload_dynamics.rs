//! The payload of dynamics.

use armature_rig::{Dynamics, Skeleton, SpringBone, SpringChain, SpringCollider};

use super::bytes::{Fields, Put};
use super::error::{PayloadError, WriteError};
use super::payload::put_count;

mod state {
    pub(super) const OFF: u8 = 0;
    pub(super) const ON: u8 = 1;
}

pub(super) fn put(out: &mut Vec<u8>, dynamics: Option<&Dynamics>) -> Result<(), WriteError> {
    let Some(dynamics) = dynamics else {
        out.put_u8(state::OFF);
        return Ok(());
    };
    out.put_u8(state::ON);
    out.put_vec3(dynamics.wind);
    put_count(out, "chains that swing", dynamics.chains.len(), Skeleton::MAX_BONES)?;
    for chain in &dynamics.chains {
        put_count(out, "bones that swing", chain.bones.len(), Skeleton::MAX_BONES)?;
        for own in &chain.bones {
            out.put_u16(own.bone as u16);
            out.put_vec3(own.tail);
            [own.stiffness, own.drag, own.gravity].into_iter().for_each(|number| out.put_f64(number));
            out.put_vec3(own.gravity_direction);
            out.put_f64(own.radius);
        }
        put_count(out, "colliders", chain.colliders.len(), usize::from(u16::MAX))?;
        for collider in &chain.colliders {
            out.put_u16(collider.bone as u16);
            out.put_u8(collider.tail.is_some().into());
            out.put_vec3(collider.offset);
            out.put_vec3(collider.tail.unwrap_or_default());
            out.put_f64(collider.radius);
        }
    }
    Ok(())
}

pub(super) fn read(fields: &mut Fields<'_>, skeleton: Option<&Skeleton>) -> Result<Option<Dynamics>, PayloadError> {
    match fields.u8("state")? {
        state::OFF => return Ok(None),
        state::ON => {}
        value => return Err(PayloadError::UnknownCode { field: "state", value: value.into() }),
    }
    let mut dynamics = Dynamics { wind: fields.vec3("wind")?, chains: Vec::new() };
    for _ in 0..fields.u16("chain count")? {
        let mut chain = SpringChain::default();
        for _ in 0..fields.u16("bone count")? {
            chain.bones.push(SpringBone {
                bone: fields.u16("bone")?.into(),
                tail: fields.vec3("tail")?,
                stiffness: fields.f64("stiffness")?,
                drag: fields.f64("drag")?,
                gravity: fields.f64("gravity")?,
                gravity_direction: fields.vec3("direction of gravity")?,
                radius: fields.f64("radius")?,
            });
        }
        for _ in 0..fields.u16("collider count")? {
            let (bone, is_capsule) = (fields.u16("bone")?.into(), fields.u8("shape")? != 0);
            let (offset, tail) = (fields.vec3("centre")?, fields.vec3("other centre")?);
            let radius = fields.f64("radius")?;
            chain.colliders.push(SpringCollider { bone, offset, tail: is_capsule.then_some(tail), radius });
        }
        dynamics.chains.push(chain);
    }
    dynamics.check(skeleton.ok_or(PayloadError::NoSkeleton)?)?;
    Ok(Some(dynamics))
}
