//! Where the arms and legs of a person point, in a skeleton and in the poses in which puppets are zeroed.

use std::fmt;
use std::str::FromStr;

use glam::Vec3;

use crate::recognise::{Finger, HumanoidBone, HumanoidPart, Recognition, Side, recognise};
use crate::skeleton::Skeleton;

/// A pose in which puppets are zeroed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RestPose {
    /// Arms straight out to the sides, legs down.
    T,
    /// Arms half way down, legs down.
    A,
}

impl RestPose {
    /// Where a limb of a person points; `None` for anything else.
    pub(super) fn direction(self, bone: HumanoidBone) -> Option<Vec3> {
        let out = match bone.side? {
            Side::Left => Vec3::X,
            Side::Right => Vec3::NEG_X,
        };
        match bone.part {
            HumanoidPart::UpperArm | HumanoidPart::LowerArm | HumanoidPart::Hand => Some(match self {
                Self::T => out,
                Self::A => (out + Vec3::NEG_Y).normalize(),
            }),
            HumanoidPart::UpperLeg | HumanoidPart::LowerLeg => Some(Vec3::NEG_Y),
            _ => None,
        }
    }
}

impl fmt::Display for RestPose {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::T => "T",
            Self::A => "A",
        })
    }
}

impl FromStr for RestPose {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.to_ascii_lowercase().as_str() {
            "t" => Ok(Self::T),
            "a" => Ok(Self::A),
            _ => Err(format!("{text:?} is no rest pose; there are t and a")),
        }
    }
}

/// Where the limbs of a skeleton point, and its trunk: what is known of a puppet that was made from it.
pub(super) fn directions(skeleton: &Skeleton) -> (Vec<(usize, Vec3)>, Option<Vec3>) {
    let recognition = recognise(skeleton);
    let heads = skeleton.rest_segments();
    let limb = |(index, found): (usize, &Option<crate::recognise::RecognisedBone>)| {
        let bone = found.as_ref()?.bone;
        RestPose::T.direction(bone)?;
        Some((index, (limb_end(&recognition, &heads, index, bone) - heads[index].0).try_normalize()?))
    };
    (recognition.bones.iter().enumerate().filter_map(limb).collect(), trunk(&recognition, &heads))
}

/// Where the bone of a limb ends: where the next one begins, whatever lies between.
pub(super) fn limb_end(recognition: &Recognition, heads: &[(Vec3, Vec3)], index: usize, bone: HumanoidBone) -> Vec3 {
    let found = next_part(bone.part).and_then(|part| recognition.find(HumanoidBone { part, ..bone }));
    found.map_or(heads[index].1, |next| heads[next].0)
}

/// The part of a limb that comes next.
pub(crate) fn next_part(part: HumanoidPart) -> Option<HumanoidPart> {
    match part {
        HumanoidPart::UpperArm => Some(HumanoidPart::LowerArm),
        HumanoidPart::LowerArm => Some(HumanoidPart::Hand),
        HumanoidPart::UpperLeg => Some(HumanoidPart::LowerLeg),
        HumanoidPart::LowerLeg => Some(HumanoidPart::Foot),
        HumanoidPart::Hand => Some(HumanoidPart::Finger(Finger::Middle, 1)),
        _ => None,
    }
}

/// From the hips to the arms.
pub(super) fn trunk(recognition: &Recognition, heads: &[(Vec3, Vec3)]) -> Option<Vec3> {
    let both = |part| {
        let of = |side| Some(heads[recognition.find(HumanoidBone { part, side: Some(side) })?].0);
        Some(0.5 * (of(Side::Left)? + of(Side::Right)?))
    };
    (both(HumanoidPart::UpperArm)? - both(HumanoidPart::UpperLeg)?).try_normalize()
}
