//! Which part of the puppet drives which bone of the character.

use glam::Quat;

use super::rest_turn::RestTurn;
use crate::calibration::CalibrationError;
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
/// A part drives at most one bone, unless it is [carried](Self::carried). Several parts may drive one bone: their rotations compose in tree order, from the
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
}

impl Mapping {
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

/// Why a mapping cannot be used with this puppet and this skeleton.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MappingError {
    /// The skeleton has no such bone.
    #[error("part {part} is mapped to the bone {bone:?}, which the skeleton does not have{}", nearest.as_ref().map_or_else(String::new, |n| format!("; did you mean {n:?}?")))]
    UnknownBone {
        /// The part.
        part: PartUid,
        /// The name given.
        bone: String,
        /// A bone whose name differs only in case or prefix.
        nearest: Option<String>,
    },
    /// Two entries for one part.
    #[error("part {part} is mapped twice, to {first:?} and to {second:?}; a part drives only one bone")]
    PartTwice {
        /// The part.
        part: PartUid,
        /// Bone of the first entry.
        first: String,
        /// Bone of the second entry.
        second: String,
    },
    /// A splitter has no sensor.
    #[error("part {part} is a splitter without a sensor; it cannot drive {bone:?}")]
    Splitter {
        /// The part.
        part: PartUid,
        /// The bone.
        bone: String,
    },
    /// The mounting is NaN or not a unit quaternion.
    #[error("the mounting of part {part} is not a rotation; it must be a unit quaternion (x, y, z, w)")]
    BadMounting {
        /// The part.
        part: PartUid,
    },
    /// The skeleton has no such bone to turn.
    #[error("the mapping turns the rest pose of the bone {bone:?}, which the skeleton does not have")]
    UnknownRestBone {
        /// The name given.
        bone: String,
    },
    /// A bone's rest is turned twice, or by something that is no number.
    #[error("the rest pose of the bone {bone:?} is turned twice, or its turn is not a finite number of degrees")]
    BadRestTurn {
        /// The bone.
        bone: String,
    },
    /// The calibration does not fit the parts.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}
