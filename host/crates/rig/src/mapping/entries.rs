//! Which part of the puppet drives which bone of the character.

use glam::Quat;

use super::error::MappingError;
use super::rest_turn::RestTurn;
use super::shape_drive::ShapeDrive;
use super::shares::SharedJoint;
use crate::puppet::PartUid;
use crate::skeleton::{Bone, Skeleton};

/// One part drives one bone.
#[derive(Clone, Debug, PartialEq)]
pub struct MappingEntry {
    /// The part, by its unique number.
    pub part: PartUid,
    /// The bone, by its name.
    pub bone: String,
    /// `nominal_from_mounted`: how the part is rotated relative to the bone's joint frame
    /// ([`Skeleton::bone_from_joint`](crate::Skeleton::bone_from_joint)); a unit quaternion, identity if it is mounted
    /// as intended.
    pub mounting: Quat,
}

impl MappingEntry {
    /// A part mounted as intended.
    pub fn new(part: PartUid, bone: impl Into<String>) -> Self {
        Self { part, bone: bone.into(), mounting: Quat::IDENTITY }
    }
}

/// Which part drives which bone.
///
/// A part drives at most one bone, unless it is [carried](Self::carried) or [shared](Self::shared). Several parts may drive one bone: their rotations compose in tree order, from the
/// puppet's root outwards. Bones without a part stay in the rest pose. Parts that are not plugged in are kept, so that
/// one mapping serves a puppet that is taken apart and put back together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mapping {
    /// In no particular order.
    pub entries: Vec<MappingEntry>,
    /// Joints without a bone of their own, each once for every bone that it turns together with the joints below it; see
    /// [`carried`](crate::carried). Their bones are driven by `entries` too.
    pub carried: Vec<MappingEntry>,
    /// What turns the character's rest pose into the one in which the puppet is zeroed; a bone at most once. Empty: the
    /// puppet is zeroed in the character's rest pose.
    pub rest: Vec<RestTurn>,
    /// Joints of `entries` that turn several bones; a part at most once.
    pub shared: Vec<SharedJoint>,
    /// Joints that blend shapes of the character; a shape at most once. Their parts need no bone.
    pub shapes: Vec<ShapeDrive>,
}

impl Mapping {
    /// For each bone of the skeleton whether a joint drives it, alone or with others.
    pub fn driven_bones(&self, skeleton: &Skeleton) -> Vec<bool> {
        let mut driven = vec![false; skeleton.len()];
        let own = self.entries.iter().map(|entry| entry.bone.as_str());
        let shared = self.shared.iter().flat_map(|joint| joint.bones.iter().map(|(bone, _)| bone.as_str()));
        for bone in own.chain(shared).filter_map(|name| skeleton.find(name)) {
            driven[bone] = true;
        }
        driven
    }

    /// The character's skeleton with the bones turned as [`rest`](Self::rest) says: what the puppet's zero looks like.
    /// Without turns it is the skeleton itself, bit for bit.
    pub fn rested(&self, skeleton: &Skeleton) -> Result<Skeleton, MappingError> {
        let mut bones: Vec<Bone> = skeleton.bones().to_vec();
        let mut turns: Vec<Option<Quat>> = vec![None; bones.len()];
        for turn in &self.rest {
            let found = skeleton.find(&turn.bone);
            let bone = found.ok_or_else(|| MappingError::UnknownRestBone { bone: turn.bone.clone() })?;
            let bad = || MappingError::BadRestTurn { bone: turn.bone.clone() };
            let rotation = turn.rotation().filter(|_| turns[bone].is_none()).ok_or_else(bad)?;
            turns[bone] = Some(rotation);
        }
        // `model_from_bone`, rotations alone.
        let mut model: Vec<Quat> = Vec::with_capacity(bones.len());
        for (index, bone) in bones.iter_mut().enumerate() {
            let above = bone.parent.map_or(Quat::IDENTITY, |parent| model[parent]);
            if let Some(turn) = turns[index] {
                bone.rest.rotation = (above.inverse() * turn * above * bone.rest.rotation).normalize();
            }
            model.push((above * bone.rest.rotation).normalize());
        }
        Skeleton::new(bones).map_err(|_| MappingError::BadRestTurn { bone: String::new() })
    }
}
