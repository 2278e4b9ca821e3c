//! A part: its unique number and its kind.

use core::fmt;

/// A part's unique 96-bit number, in wire order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartUid(pub [u8; 12]);

impl fmt::Display for PartUid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// What a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartKind {
    /// One sensor, bending.
    Bend,
    /// One sensor, twisting.
    Twist,
    /// Three sensors: twist, bend, twist, from the inlet outwards.
    TwistBendTwist,
    /// No sensor, 1 to 5 outlets.
    Splitter,
    /// A kind of a later version, with its number.
    Other(u8),
}

impl PartKind {
    /// Its number on the wire.
    pub const fn code(self) -> u8 {
        match self {
            Self::Bend => 1,
            Self::Twist => 2,
            Self::TwistBendTwist => 3,
            Self::Splitter => 4,
            Self::Other(code) => code,
        }
    }

    /// The kind with this number.
    pub const fn from_code(code: u8) -> Self {
        match code {
            1 => Self::Bend,
            2 => Self::Twist,
            3 => Self::TwistBendTwist,
            4 => Self::Splitter,
            other => Self::Other(other),
        }
    }

    /// How many sensors a part of this kind has; `None` if this version does not know the kind.
    pub const fn sensor_count(self) -> Option<u8> {
        match self {
            Self::Bend | Self::Twist => Some(1),
            Self::TwistBendTwist => Some(3),
            Self::Splitter => Some(0),
            Self::Other(_) => None,
        }
    }
}
