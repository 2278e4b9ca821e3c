//! The calibration steps.

use std::fmt;
use std::str::FromStr;

/// What is calibrated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum CalibrationStep {
    /// The counts of the rest pose.
    Zero,
    /// Range, direction and wrap-around of each sensor.
    Sweep,
    /// The full orientation in which each part is mounted.
    Mounting,
    /// Which way the puppet faces.
    Heading,
}

/// No step has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is not a calibration step; the steps are zero, sweep, mounting and heading")]
pub struct UnknownStep {
    /// The text given.
    pub text: String,
}

impl CalibrationStep {
    /// All steps, in the order in which they make sense.
    pub const ALL: [Self; 4] = [Self::Zero, Self::Sweep, Self::Mounting, Self::Heading];

    /// What the user should do, one instruction for each measurement.
    pub fn instructions(self) -> &'static [&'static str] {
        match self {
            Self::Zero => &["hold the puppet still in its rest pose"],
            Self::Sweep => &[
                "from the rest pose, move every joint slowly to its stop: first forward (a twist: to the left, seen from \
                 its outlet), then the other way",
            ],
            Self::Mounting => &[
                "bend the joints forward by about 60° and hold still",
                "bring them back, twist the joints to the left by about 60° and hold still",
            ],
            Self::Heading => &["turn the puppet so that it faces forward, and hold still"],
        }
    }
}

impl fmt::Display for CalibrationStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Zero => "zero",
            Self::Sweep => "sweep",
            Self::Mounting => "mounting",
            Self::Heading => "heading",
        })
    }
}

impl FromStr for CalibrationStep {
    type Err = UnknownStep;

    fn from_str(text: &str) -> Result<Self, UnknownStep> {
        let found = Self::ALL.into_iter().find(|step| step.to_string() == text);
        found.ok_or_else(|| UnknownStep { text: text.to_owned() })
    }
}
