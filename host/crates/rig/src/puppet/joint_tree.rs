//! The puppet as plugged together: a tree of parts.

use std::{fmt, str::FromStr};

/// A part's unique 96-bit number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PartUid(pub [u8; 12]);

impl fmt::Display for PartUid {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

/// Why a text is not a part's number.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{text:?} is not a part's number; it is written as 24 hexadecimal digits")]
pub struct PartUidError {
    /// The text given.
    pub text: String,
}

impl FromStr for PartUid {
    type Err = PartUidError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let error = || PartUidError { text: text.to_owned() };
        let digits: Vec<u32> = text.chars().map_while(|c| c.to_digit(16)).collect();
        if digits.len() != 24 || text.chars().count() != 24 {
            return Err(error());
        }
        let mut uid = Self::default();
        for (byte, pair) in uid.0.iter_mut().zip(digits.chunks_exact(2)) {
            *byte = (pair[0] * 16 + pair[1]) as u8;
        }
        Ok(uid)
    }
}

/// The axis one sensor of a joint measures, in the joint's own frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JointAxis {
    /// About +X, perpendicular to the part.
    Bend,
    /// About +Y, along the part.
    Twist,
}

/// What a part is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PartKind {
    /// One sensor, bending.
    Bend,
    /// One sensor, twisting.
    Twist,
    /// Three sensors; the rotation is twist · bend · twist, from the inlet outwards.
    TwistBendTwist,
    /// No sensor, 1 to 5 outlets.
    Splitter {
        /// How many outlets.
        outlets: u8,
    },
}

impl PartKind {
    /// The axes of the part's sensors, from the inlet outwards.
    pub fn axes(self) -> &'static [JointAxis] {
        match self {
            Self::Bend => &[JointAxis::Bend],
            Self::Twist => &[JointAxis::Twist],
            Self::TwistBendTwist => &[JointAxis::Twist, JointAxis::Bend, JointAxis::Twist],
            Self::Splitter { .. } => &[],
        }
    }

    /// How many parts can be plugged into this one.
    pub fn outlets(self) -> u8 {
        match self {
            Self::Splitter { outlets } => outlets,
            Self::Bend | Self::Twist | Self::TwistBendTwist => 1,
        }
    }
}

/// One part of a puppet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The part's unique number; it stays the same wherever the part is plugged in.
    pub uid: PartUid,
    /// What it is.
    pub kind: PartKind,
    /// Index of the part it is plugged into, always smaller than its own; `None` for the root.
    pub parent: Option<usize>,
    /// Zero-based outlet of the parent it is plugged into; 0 for the root.
    pub outlet: u8,
    /// Resolution of its sensors: raw counts per full turn.
    pub counts_per_turn: u32,
}

/// Parts, parents before children; sensors are numbered part by part, from each inlet outwards.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JointTree {
    parts: Vec<Part>,
    first_sensor: Vec<usize>,
    sensor_count: usize,
}

/// Why a list of parts is not a puppet.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum JointTreeError {
    /// A parent does not come before its child.
    #[error("part {part} is plugged into part {parent}, which does not come before it")]
    ParentAfterChild {
        /// Zero-based part.
        part: usize,
        /// The parent index given.
        parent: usize,
    },
    /// Two parts report the same number.
    #[error("two parts report the number {uid}; each part needs its own")]
    DuplicateUid {
        /// The shared number.
        uid: PartUid,
    },
    /// An outlet that the parent does not have, or that is taken.
    #[error("part {part} claims outlet {outlet} of part {parent}, which is taken or does not exist")]
    BadOutlet {
        /// Zero-based part.
        part: usize,
        /// Its parent.
        parent: usize,
        /// The outlet claimed.
        outlet: u8,
    },
    /// An impossible resolution.
    #[error("part {part} reports {counts_per_turn} counts per turn; 2 to 65536 are possible")]
    BadResolution {
        /// Zero-based part.
        part: usize,
        /// The value given.
        counts_per_turn: u32,
    },
}

impl JointTree {
    /// Checks and takes a list of parts.
    pub fn new(parts: Vec<Part>) -> Result<Self, JointTreeError> {
        let mut first_sensor = Vec::with_capacity(parts.len());
        let mut sensor_count = 0;
        for (index, part) in parts.iter().enumerate() {
            if let Some(parent) = part.parent {
                if parent >= index {
                    return Err(JointTreeError::ParentAfterChild { part: index, parent });
                }
                let taken = parts[..index].iter().any(|p| p.parent == Some(parent) && p.outlet == part.outlet);
                if taken || part.outlet >= parts[parent].kind.outlets() {
                    return Err(JointTreeError::BadOutlet { part: index, parent, outlet: part.outlet });
                }
            }
            if parts[..index].iter().any(|p| p.uid == part.uid) {
                return Err(JointTreeError::DuplicateUid { uid: part.uid });
            }
            if !part.kind.axes().is_empty() && !(2..=65536).contains(&part.counts_per_turn) {
                return Err(JointTreeError::BadResolution { part: index, counts_per_turn: part.counts_per_turn });
            }
            first_sensor.push(sensor_count);
            sensor_count += part.kind.axes().len();
        }
        Ok(Self { parts, first_sensor, sensor_count })
    }

    /// All parts, parents before children.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Number of sensors of all parts: the length of a sample.
    pub fn sensor_count(&self) -> usize {
        self.sensor_count
    }

    /// The sensors of a part, as a range into a sample.
    pub fn sensors(&self, part: usize) -> std::ops::Range<usize> {
        let first = self.first_sensor[part];
        first..first + self.parts[part].kind.axes().len()
    }

    /// Index of the part with this number.
    pub fn find(&self, uid: PartUid) -> Option<usize> {
        self.parts.iter().position(|p| p.uid == uid)
    }

    /// Indices of the parts plugged into this one, by outlet.
    pub fn children(&self, part: usize) -> Vec<usize> {
        let mut children: Vec<usize> = (0..self.parts.len()).filter(|&i| self.parts[i].parent == Some(part)).collect();
        children.sort_by_key(|&i| self.parts[i].outlet);
        children
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_read_as_it_is_written() {
        let uid = PartUid([0, 1, 0x7f, 0x80, 0xff, 5, 6, 7, 8, 9, 0xa0, 0x0b]);
        assert_eq!(uid.to_string().parse(), Ok(uid));
        for wrong in ["", "00", "0001020304050607080910zz", "00010203040506070809101112", "é0010203040506070809101112"]
        {
            assert!(wrong.parse::<PartUid>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_no_tree_is_named() {
        let part = |number: u8, kind, parent, outlet| Part {
            uid: PartUid([number; 12]),
            kind,
            parent,
            outlet,
            counts_per_turn: 16384,
        };
        let split = PartKind::Splitter { outlets: 2 };
        let ok =
            vec![part(1, split, None, 0), part(2, PartKind::Bend, Some(0), 1), part(3, PartKind::Twist, Some(0), 0)];
        let tree = JointTree::new(ok.clone()).unwrap();
        assert_eq!(tree.children(0), [2, 1], "children come by outlet");
        assert_eq!(tree.sensors(2), 1..2);
        let with = |change: fn(&mut Part)| {
            let mut parts = ok.clone();
            change(&mut parts[2]);
            JointTree::new(parts)
        };
        assert!(matches!(with(|p| p.outlet = 1), Err(JointTreeError::BadOutlet { part: 2, .. })));
        assert!(matches!(with(|p| p.outlet = 2), Err(JointTreeError::BadOutlet { part: 2, .. })));
        assert!(matches!(with(|p| p.parent = Some(2)), Err(JointTreeError::ParentAfterChild { .. })));
        assert!(matches!(with(|p| p.uid = PartUid([1; 12])), Err(JointTreeError::DuplicateUid { .. })));
        assert!(matches!(with(|p| p.counts_per_turn = 1), Err(JointTreeError::BadResolution { .. })));
    }
}
