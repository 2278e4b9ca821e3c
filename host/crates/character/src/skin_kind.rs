//! How a character's skin follows its bones.

use std::fmt;
use std::str::FromStr;

/// How a skin follows the bones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum SkinKind {
    /// Linear blending, as in every other program: joints collapse where they turn far.
    #[default]
    Linear,
    /// Dual quaternions: no joint collapses, but joints bulge and twists stay near them.
    DualQuaternion,
    /// Bones that stretch and twist along their length (thesis chapter 6), blended linearly.
    StretchTwist,
    /// The same over dual quaternions.
    StretchTwistDualQuaternion,
}

impl SkinKind {
    /// All of them.
    pub const ALL: [Self; 4] =
        [Self::Linear, Self::DualQuaternion, Self::StretchTwist, Self::StretchTwistDualQuaternion];

    /// What it is called in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Linear => "lbs",
            Self::DualQuaternion => "dqs",
            Self::StretchTwist => "stretch-twist",
            Self::StretchTwistDualQuaternion => "stretch-twist-dqs",
        }
    }

    /// Whether bones stretch and twist along their length, for which endpoint weights are needed.
    pub fn stretches(self) -> bool {
        matches!(self, Self::StretchTwist | Self::StretchTwistDualQuaternion)
    }
}

impl fmt::Display for SkinKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for SkinKind {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.map(Self::name).join(", ");
        Self::ALL.into_iter().find(|kind| kind.name() == text).ok_or_else(|| format!("choose one of {known}"))
    }
}

/// How endpoint weights are computed: how far along a bone each vertex is (thesis 6.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EndpointMethod {
    /// From bounded biharmonic weights of the joints (eq. 6.7): smooth, and they follow the shape.
    Biharmonic,
    /// From bone heat weights of the joints: on the surface alone; they fade beyond the ends of a bone.
    BoneHeat,
    /// The nearest place on the bone (eq. 6.8): at once, with a kink at the joints.
    Projection,
    /// From the inverse squared distances of the joints (eq. 6.9): smooth, but blind to the shape.
    InverseDistance,
}

impl EndpointMethod {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Biharmonic, Self::BoneHeat, Self::Projection, Self::InverseDistance];

    /// What it is called in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Biharmonic => "bbw",
            Self::BoneHeat => "heat",
            Self::Projection => "projection",
            Self::InverseDistance => "distance",
        }
    }
}

impl fmt::Display for EndpointMethod {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for EndpointMethod {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.map(Self::name).join(", ");
        Self::ALL.into_iter().find(|method| method.name() == text).ok_or_else(|| format!("choose one of {known}"))
    }
}

/// How far along its bones each vertex is.
#[derive(Clone, Debug, PartialEq)]
pub struct Endpoints {
    /// How they were computed.
    pub method: EndpointMethod,
    /// As long as the bones of the influences and in their order: 0 at the head of that bone, 1 at its tail.
    pub weights: Vec<f32>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back() {
        for kind in SkinKind::ALL {
            assert_eq!(kind.to_string().parse(), Ok(kind));
        }
        for method in EndpointMethod::ALL {
            assert_eq!(method.to_string().parse(), Ok(method));
        }
        let refused: Result<SkinKind, String> = "LBS".parse();
        assert_eq!(refused, Err("choose one of lbs, dqs, stretch-twist, stretch-twist-dqs".into()));
    }
}
