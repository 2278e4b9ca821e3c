//! What can be wrong with a take.

use std::io;

use armature_rig::{DynamicsError, GroundError, JointTreeError, SkeletonError, TargetError};

use super::format::{MAJOR_VERSION, MAX_PAYLOAD_BYTES};

/// Why bytes cannot be read as a take at all. Damage further on is not an error: see [`crate::ReadReport`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TakeError {
    /// The first bytes are not those of a take.
    #[error("byte 0: not a take (its first 8 bytes are wrong); choose a file that `--record` wrote")]
    NotATake,
    /// The file ends inside its first record.
    #[error(
        "byte {bytes}: the file ends before its header does; nothing was recorded, or the copy is incomplete: copy it again"
    )]
    EndsInHeader {
        /// Length of the file.
        bytes: u64,
    },
    /// The version's own checksum does not match.
    #[error("byte 8: the version number is damaged; restore the file from another copy")]
    DamagedVersion,
    /// A take of another major version.
    #[error(
        "byte 8: the take has format version {major}.{minor}, but this program reads {MAJOR_VERSION}.x; open it with a program that reads {major}.x"
    )]
    OtherMajorVersion {
        /// The take's major version.
        major: u16,
        /// The take's minor version.
        minor: u16,
    },
    /// The first record is damaged or not a header.
    #[error("byte {offset}: the header record is damaged; restore the file from another copy")]
    DamagedHeader {
        /// Where it starts.
        offset: u64,
    },
    /// The header's checksum matches but its content is invalid.
    #[error("byte {offset}: the header record is invalid ({reason}); record again with a current program")]
    BadHeader {
        /// Where it starts.
        offset: u64,
        /// What is wrong.
        reason: PayloadError,
    },
}

/// Why the payload of a record with a matching checksum is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PayloadError {
    /// The payload ends inside a field.
    #[error("the payload ends inside its {field}")]
    TooShort {
        /// The field.
        field: &'static str,
    },
    /// The payload continues after its last field, although the take's minor version has no further fields.
    #[error("{bytes} bytes follow the last field")]
    TooLong {
        /// How many.
        bytes: usize,
    },
    /// A text is not UTF-8.
    #[error("its {field} is not UTF-8")]
    NotText {
        /// The field.
        field: &'static str,
    },
    /// A code that this version does not know.
    #[error("its {field} has the unknown value {value}")]
    UnknownCode {
        /// The field.
        field: &'static str,
        /// The value.
        value: u32,
    },
    /// More parts than a take may hold.
    #[error("{count} parts are more than a take may hold ({limit})")]
    TooManyParts {
        /// Parts announced.
        count: usize,
        /// Parts possible.
        limit: usize,
    },
    /// Joint settings that do not follow a calibration.
    #[error("it must follow a calibration, but does not")]
    Alone,
    /// Joint settings for a sensor that the preceding calibration does not have.
    #[error("it refers to a sensor that the calibration before it does not have")]
    NoSuchSensor,
    /// A weight that is not finite.
    #[error("the weight of the shape {shape:?} is no finite number")]
    BadWeight {
        /// The shape.
        shape: String,
    },
    /// The bones are not a skeleton.
    #[error(transparent)]
    Skeleton(#[from] SkeletonError),
    /// The skeleton cannot stand like this.
    #[error(transparent)]
    Ground(#[from] GroundError),
    /// The skeleton cannot swing like this.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
    /// The target cannot be used.
    #[error(transparent)]
    Target(#[from] TargetError),
    /// The parts are not a puppet.
    #[error(transparent)]
    JointTree(#[from] JointTreeError),
    /// A pose before the skeleton, or after a damaged one.
    #[error("no skeleton was read before it")]
    NoSkeleton,
    /// A pose for a different skeleton.
    #[error("it moves {got} bones, but the take's skeleton has {expected}")]
    BoneCount {
        /// Bones in the record.
        got: usize,
        /// Bones in the skeleton.
        expected: usize,
    },
    /// A second header or skeleton.
    #[error("a take has only one of these")]
    Repeated,
}

/// Why a record was not written.
#[derive(Debug, thiserror::Error)]
pub enum WriteError {
    /// The file, pipe or socket reported an error.
    #[error("the take could not be written: {0}; what was written before can still be read")]
    Io(#[from] io::Error),
    /// An earlier write failed, so the place where the next record starts is unknown.
    #[error("the take was cut off by an earlier write error; start a new take")]
    CutOff,
    /// A payload beyond the format's limit.
    #[error("a record of {bytes} bytes is larger than a take may hold ({MAX_PAYLOAD_BYTES})")]
    TooLarge {
        /// Its payload.
        bytes: u64,
    },
    /// A list or text too long for its 16-bit count.
    #[error("{field} has {count} entries or bytes; a take holds at most {limit}: shorten it")]
    TooMany {
        /// The field.
        field: &'static str,
        /// How many there are.
        count: usize,
        /// The most there may be.
        limit: usize,
    },
    /// A weight that is not finite.
    #[error("the weight of the shape {shape:?} is {weight}; give a number")]
    BadWeight {
        /// The shape.
        shape: String,
        /// Its weight.
        weight: f32,
    },
    /// A sample with a different number of states than counts.
    #[error("the sample has {counts} counts but {states} states; it needs one state per count")]
    UnevenSample {
        /// Its counts.
        counts: usize,
        /// Its states.
        states: usize,
    },
    /// A pose before the skeleton.
    #[error("the take has no skeleton yet; write the skeleton before the first pose")]
    NoSkeleton,
    /// A second skeleton.
    #[error("the take already has a skeleton; start a new take for another character")]
    SecondSkeleton,
    /// A pose with a different number of bones than the skeleton.
    #[error("the pose moves {got} bones, but the take's skeleton has {expected}")]
    BoneCount {
        /// Bones in the pose.
        got: usize,
        /// Bones in the skeleton.
        expected: usize,
    },
}
