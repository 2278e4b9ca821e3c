//! What a VRM avatar says of itself, as bytes and back.

use armature_formats::model::{Avatar, Expression, HumanoidBone, SpringChain, SpringCollider, SpringJoint};

use super::bytes::{Reader, Writer};
use super::error::CacheError;
use crate::character::Character;

pub(super) fn write_avatar(w: &mut Writer, avatar: Option<&Avatar>) {
    w.option(avatar, |w, avatar| {
        // Destructured, here and below, so that a new field cannot be forgotten.
        let Avatar { version, humanoid, expressions, springs } = avatar;
        w.bytes(version.as_bytes());
        w.list(humanoid, |w, HumanoidBone { name, bone }| {
            w.bytes(name.as_bytes());
            w.u32(*bone);
        });
        w.list(expressions, |w, Expression { name, targets }| {
            w.bytes(name.as_bytes());
            w.list(targets, |w, (target, weight)| {
                w.u32(*target);
                w.f32s([*weight]);
            });
        });
        w.list(springs, |w, SpringChain { name, joints, colliders }| {
            w.bytes(name.as_bytes());
            w.list(joints, |w, joint| {
                let SpringJoint { bone, stiffness, gravity, gravity_direction, drag, radius } = *joint;
                w.u32(bone);
                w.f32s([stiffness, gravity, drag, radius]);
                w.f32s(gravity_direction);
            });
            w.list(colliders, |w, collider| {
                let SpringCollider { bone, offset, tail, radius } = *collider;
                w.u32(bone);
                w.f32s([radius]);
                w.f32s(offset);
                w.option(tail, Writer::f32s);
            });
        });
    });
}

/// `character`: complete but for its avatar.
pub(super) fn read_avatar(r: &mut Reader, character: &Character) -> Result<Option<Avatar>, CacheError> {
    let (bones, targets) = (character.skeleton.len(), character.surface.morph_targets.len());
    let within = |r: &mut Reader, what: &str, count: usize| {
        let number = r.u32()?;
        if (number as usize) < count { Ok(number) } else { Err(r.bad(format!("{what} {number} of {count}"))) }
    };
    let bone = |r: &mut Reader| within(r, "bone", bones);
    let joint = |r: &mut Reader| {
        let (bone, [stiffness, gravity, drag, radius]) = (bone(r)?, r.f32s()?);
        Ok(SpringJoint { bone, stiffness, gravity, gravity_direction: r.f32s()?, drag, radius })
    };
    let collider = |r: &mut Reader| {
        let (bone, [radius]) = (bone(r)?, r.f32s()?);
        Ok(SpringCollider { bone, offset: r.f32s()?, tail: r.option(Reader::f32s)?, radius })
    };
    r.option(|r| {
        Ok(Avatar {
            version: r.text()?,
            humanoid: r.list(12, |r| Ok(HumanoidBone { name: r.text()?, bone: bone(r)? }))?,
            expressions: r.list(16, |r| {
                let name = r.text()?;
                let targets = r.list(8, |r| Ok((within(r, "morph target", targets)?, r.f32s::<1>()?[0])))?;
                Ok(Expression { name, targets })
            })?,
            springs: r.list(24, |r| {
                Ok(SpringChain { name: r.text()?, joints: r.list(32, joint)?, colliders: r.list(21, collider)? })
            })?,
        })
    })
}
