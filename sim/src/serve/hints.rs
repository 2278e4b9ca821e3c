//! What a host may know of a simulated puppet that a real one would not say.

use std::collections::BTreeMap;

use armature_rig::{Motion, PartUid, PuppetHints, PuppetKind};
use glam::Vec3;

use super::options::{Options, OptionsError};
use crate::body::Body;
use crate::motion::puppet_from_motion;
use crate::servo::ServoBusSettings;

/// What a body says of itself: what it is, and what its joints are called.
pub fn hints_of(body: &Body) -> PuppetHints {
    let joints = body.parts().iter().filter(|part| part.kind.sensor_count().is_some_and(|sensors| sensors > 0));
    PuppetHints {
        kind: (body.name() == "hand").then_some(PuppetKind::Hand),
        names: joints.map(|part| (PartUid(part.uid.0), part.label.clone())).collect(),
        rest: limbs_in_t(body),
        trunk: Some(Vec3::Y),
        ..PuppetHints::default()
    }
}

/// Where the arms and legs of the built-in people point: they stand in a T.
fn limbs_in_t(body: &Body) -> BTreeMap<PartUid, Vec3> {
    let limb = |label: &str| {
        let (side, joint) = label.split_once('_')?;
        let out = match side {
            "left" => Vec3::X,
            "right" => Vec3::NEG_X,
            _ => return None,
        };
        match joint {
            "shoulder" | "elbow" | "forearm" | "wrist" => Some(out),
            "hip" | "knee" => Some(Vec3::NEG_Y),
            _ => None,
        }
    };
    body.parts().iter().filter_map(|part| Some((PartUid(part.uid.0), limb(&part.label)?))).collect()
}

/// What a motion's skeleton says of the puppet that is made from it.
pub(super) fn hints_of_motion(motion: &Motion, seed: u64) -> Result<PuppetHints, OptionsError> {
    let (body, track) = puppet_from_motion(motion, seed)?;
    let part_of_bone = |bone: usize| PartUid(body.parts()[track.parts[bone]].uid.0);
    Ok(PuppetHints::of_skeleton(&motion.skeleton, part_of_bone))
}

impl Options {
    /// What is known of the puppet besides its tree; reads motion files. Of an arm of servos only that it is an arm.
    pub fn hints(&self) -> Result<PuppetHints, OptionsError> {
        if let Some(motion) = self.own_motion()? {
            return hints_of_motion(&motion, self.seed);
        }
        if ServoBusSettings::preset(&self.puppet, self.seed).is_ok() {
            return Ok(PuppetHints { kind: Some(PuppetKind::Arm), ..PuppetHints::default() });
        }
        Ok(hints_of(&Body::preset(&self.puppet, self.seed)?))
    }
}
