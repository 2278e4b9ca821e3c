//! Bones that stay where they are.

use std::fmt;
use std::str::FromStr;

/// What of a bone is held as it is at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PinHold {
    /// Its head's place, and its turn unless a joint drives it: a foot on the floor.
    #[default]
    Fixed,
    /// Its head's place; its turn is found: a hand on a bar.
    Turning,
    /// Its head's place but for the height: a pelvis on a stand that goes up and down.
    Upright,
}

/// A bone and what of it is held; as text `NAME`, `NAME:turning` or `NAME:upright`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PinnedBone {
    /// The bone's name.
    pub bone: String,
    /// What is held.
    pub hold: PinHold,
}

impl FromStr for PinnedBone {
    type Err = std::convert::Infallible;

    /// A name with any other ending is a name as it stands (`mixamorig:Hips`).
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
