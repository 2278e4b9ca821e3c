//! A joint that blends a shape of the character: a jaw, a blink.

use std::fmt;
use std::str::FromStr;

use super::error::MappingError;
use crate::puppet::{PartKind, PartUid};

/// Which sensor of a part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriveAxis {
    /// The one that bends.
    #[default]
    Bend,
    /// The one that twists; of two, the one at the inlet.
    Twist,
    /// The one that twists at the outlet, where there are two.
    EndTwist,
}

impl DriveAxis {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Bend, Self::Twist, Self::EndTwist];

    /// Its place among a part's sensors; `None` if the part has no such sensor.
    pub fn sensor_of(self, kind: PartKind) -> Option<usize> {
        match (kind, self) {
            (PartKind::Bend, Self::Bend) | (PartKind::Twist | PartKind::TwistBendTwist, Self::Twist) => Some(0),
            (PartKind::TwistBendTwist, Self::Bend) => Some(1),
            (PartKind::TwistBendTwist, Self::EndTwist) => Some(2),
            _ => None,
        }
    }
}

impl fmt::Display for DriveAxis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bend => "bend",
            Self::Twist => "twist",
            Self::EndTwist => "end-twist",
        })
    }
}

impl FromStr for DriveAxis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|axis| axis.to_string() == text);
        found.ok_or_else(|| format!("{text:?} is no axis of a joint: write bend, twist or end-twist"))
    }
}

/// One axis of a joint blends one shape: from one angle to another, the weight goes from one number to another along a
/// straight line, and stays beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeDrive {
    /// The shape, by its name in the character.
    pub shape: String,
    /// The part, by its unique number.
    pub part: PartUid,
    /// Which of its sensors.
    pub axis: DriveAxis,
    /// Two different angles, degrees from the rest pose, -180 to 180.
    pub degrees: [f64; 2],
    /// The weight at each of them.
    pub weights: [f64; 2],
}

impl ShapeDrive {
    /// The weight at an angle, radians.
    pub fn weight(&self, angle: f64) -> f32 {
        let ([from, to], [low, high]) = (self.degrees, self.weights);
        let part = ((angle.to_degrees() - from) / (to - from)).clamp(0.0, 1.0);
        (low + (high - low) * part) as f32
    }

    /// Whether its numbers can be used.
    pub(crate) fn check(&self) -> Result<(), MappingError> {
        let bad = |what: String| Err(MappingError::BadShape { shape: self.shape.clone(), what });
        let ([from, to], weights) = (self.degrees, self.weights);
        if !(from.abs() <= 180.0 && to.abs() <= 180.0 && (to - from).abs() >= 1e-3) {
            return bad(format!("from {from}° to {to}° is no range; give two different angles from -180 to 180"));
        }
        // Beyond that no shape is meant, and the skin would be torn.
        if !weights.iter().all(|weight| weight.abs() <= 10.0) {
            return bad(format!("weights {} and {} are not possible; give -10 to 10", weights[0], weights[1]));
        }
        Ok(())
    }
}
