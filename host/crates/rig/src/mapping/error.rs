//! Why a mapping cannot be used.

use crate::calibration::CalibrationError;
use crate::puppet::PartUid;

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
    /// A rotation cannot be divided like this.
    #[error("the rotation of part {part} cannot be shared: {what}")]
    BadShares {
        /// The part.
        part: PartUid,
        /// What is wrong.
        what: String,
    },
    /// A shape cannot be driven like this.
    #[error("the shape {shape:?} cannot be driven: {what}")]
    BadShape {
        /// The shape.
        shape: String,
        /// What is wrong.
        what: String,
    },
    /// The calibration does not fit the parts.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}
