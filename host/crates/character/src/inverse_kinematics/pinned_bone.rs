//! Bones that stay where they are.

use std::fmt;
use std::str::FromStr;

/// What part of a bone's rest placement is held.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PinHold {
    /// Its head's position, and its orientation unless a joint drives it: a foot on the floor.
    #[default]
    Fixed,
    /// Its head's position; its orientation is solved: a hand on a bar.
    Turning,
    /// Its head's position except for the height: a pelvis on a stand that goes up and down.
    Upright,
}

/// A bone and what is held of it; as text `NAME`, `NAME:turning` or `NAME:upright`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PinnedBone {
    /// The bone's name.
    pub bone: String,
    /// What is held.
    pub hold: PinHold,
}

impl FromStr for PinnedBone {
    type Err = std::convert::Infallible;

    /// Any other ending is part of the name (`mixamorig:Hips`).
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (bone, hold) = match text.rsplit_once(':') {
            Some((bone, "fixed")) => (bone, PinHold::Fixed),
            Some((bone, "turning")) => (bone, PinHold::Turning),
            Some((bone, "upright")) => (bone, PinHold::Upright),
            _ => (text, PinHold::Fixed),
        };
        Ok(Self { bone: bone.to_owned(), hold })
    }
}

impl fmt::Display for PinnedBone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hold = match self.hold {
            PinHold::Fixed => "fixed",
            PinHold::Turning => "turning",
            PinHold::Upright => "upright",
        };
        write!(f, "{}:{hold}", self.bone)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pins_read_as_they_are_written() {
        for (text, bone, hold) in [
            ("LeftFoot", "LeftFoot", PinHold::Fixed),
            ("m:Hips:upright", "m:Hips", PinHold::Upright),
            ("m:Hips", "m:Hips", PinHold::Fixed),
            ("LeftHand:turning", "LeftHand", PinHold::Turning),
            ("turning:fixed", "turning", PinHold::Fixed),
        ] {
            let Ok(pin) = text.parse::<PinnedBone>();
            assert_eq!(pin, PinnedBone { bone: bone.into(), hold });
            assert_eq!(pin.to_string().parse(), Ok(pin));
        }
    }
}
