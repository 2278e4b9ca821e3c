//! The bones that humanoid rigs have in common, by the names of VRM 1.0.

use std::fmt;

/// A side of the character, as the character would say it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Side {
    /// +X of a character that looks along +Z.
    Left,
    /// −X of a character that looks along +Z.
    Right,
}

/// A finger.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[expect(missing_docs, reason = "the five fingers need no words")]
pub enum Finger {
    Thumb,
    Index,
    Middle,
    Ring,
    Little,
}

impl Finger {
    /// From the thumb to the little finger.
    pub const ALL: [Self; 5] = [Self::Thumb, Self::Index, Self::Middle, Self::Ring, Self::Little];
}

/// What a bone is, apart from its side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[expect(missing_docs, reason = "parts of the body need no words")]
pub enum HumanoidPart {
    Hips,
    Spine,
    Chest,
    UpperChest,
    Neck,
    Head,
    Jaw,
    Eye,
    UpperLeg,
    LowerLeg,
    Foot,
    Toes,
    /// The collarbone.
    Shoulder,
    UpperArm,
    LowerArm,
    Hand,
    /// A finger's first, second or third bone (1 to 3) from the hand. The thumb's first is its metacarpal.
    Finger(Finger, u8),
}

/// A bone of a humanoid. Prints as VRM 1.0 calls it: `leftUpperLeg`, `rightThumbMetacarpal`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct HumanoidBone {
    /// What it is.
    pub part: HumanoidPart,
    /// Its side; `None` for bones of the middle.
    pub side: Option<Side>,
}

/// What a bone was recognised by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// Its name alone.
    Name,
    /// Its name, which other rigs use for another bone, and its place in the tree.
    NameAndPlace,
    /// Its place in the tree and its shape.
    Shape,
}

impl fmt::Display for HumanoidBone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = match self.part {
            HumanoidPart::Finger(finger, segment) => {
                let segments = match finger {
                    Finger::Thumb => ["Metacarpal", "Proximal", "Distal"],
                    _ => ["Proximal", "Intermediate", "Distal"],
                };
                format!("{finger:?}{}", segments[usize::from(segment.clamp(1, 3)) - 1])
            }
            part => format!("{part:?}"),
        };
        match self.side {
            Some(Side::Left) => write!(f, "left{part}"),
            Some(Side::Right) => write!(f, "right{part}"),
            None => {
                let mut letters = part.chars();
                let first = letters.next().map_or_else(String::new, |letter| letter.to_lowercase().to_string());
                write!(f, "{first}{}", letters.as_str())
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_print_as_vrm_calls_them() {
        let print = |part, side| HumanoidBone { part, side }.to_string();
        assert_eq!(print(HumanoidPart::UpperChest, None), "upperChest");
        assert_eq!(print(HumanoidPart::UpperLeg, Some(Side::Left)), "leftUpperLeg");
        assert_eq!(print(HumanoidPart::Finger(Finger::Thumb, 1), Some(Side::Right)), "rightThumbMetacarpal");
        assert_eq!(print(HumanoidPart::Finger(Finger::Little, 3), Some(Side::Left)), "leftLittleDistal");
    }
}
