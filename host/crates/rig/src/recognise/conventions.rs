//! What other programs call the bones of humanoids.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use super::figure::recognise;
use super::humanoid::{Finger, HumanoidBone, HumanoidPart, Side};
use crate::skeleton::{Bone, Skeleton};

/// A program's names for the bones of humanoids.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoneNames {
    /// Mixamo: `mixamorig:LeftForeArm`.
    Mixamo,
    /// The mannequins of Unreal Engine: `lowerarm_l`, three bones in the spine.
    Unreal,
    /// The body of a `MetaHuman`: as Unreal, five bones in the spine.
    MetaHuman,
    /// VRM 1.0: `leftLowerArm`.
    Vrm,
    /// The motion capture database of Carnegie Mellon University, as BVH: `LeftForeArm`.
    Cmu,
}

impl BoneNames {
    /// All of them, with what people type.
    pub const ALL: [(&'static str, Self); 5] = [
        ("mixamo", Self::Mixamo),
        ("unreal", Self::Unreal),
        ("metahuman", Self::MetaHuman),
        ("vrm", Self::Vrm),
        ("cmu", Self::Cmu),
    ];

    /// The name of a bone; `None` where the program has no such bone.
    pub fn name(self, bone: HumanoidBone) -> Option<String> {
        match self {
            Self::Vrm => Some(bone.to_string()),
            Self::Mixamo => upper_camel(bone, false).map(|name| format!("mixamorig:{name}")),
            Self::Cmu => upper_camel(bone, true),
            Self::Unreal => snake(bone, ["spine_01", "spine_02", "spine_03"]),
            Self::MetaHuman => snake(bone, ["spine_01", "spine_03", "spine_05"]),
        }
    }

    /// The skeleton with its recognised bones renamed; others keep their names, with a number where those are taken.
    pub fn rename(self, skeleton: &Skeleton) -> Skeleton {
        let recognised = recognise(skeleton);
        let mut names: Vec<Option<String>> =
            recognised.bones.iter().map(|found| found.and_then(|found| self.name(found.bone))).collect();
        let mut taken: BTreeMap<String, usize> = names.iter().flatten().map(|name| (name.clone(), 1)).collect();
        for (name, bone) in names.iter_mut().zip(skeleton.bones()).filter(|(name, _)| name.is_none()) {
            let mut own = bone.name.clone();
            while taken.contains_key(&own) {
                let number = taken.entry(bone.name.clone()).or_insert(1);
                *number += 1;
                own = format!("{}_{number}", bone.name);
            }
            taken.insert(own.clone(), 1);
            *name = Some(own);
        }
        let renamed = skeleton
            .bones()
            .iter()
            .zip(names)
            .map(|(bone, name)| Bone { name: name.unwrap_or_else(|| bone.name.clone()), ..bone.clone() });
        // Names differ, and nothing else has changed.
        Skeleton::new(renamed.collect()).unwrap_or_else(|_| skeleton.clone())
    }
}

impl fmt::Display for BoneNames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::ALL.iter().find(|(_, own)| own == self).map_or("", |(name, _)| name))
    }
}

impl FromStr for BoneNames {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(name, _)| name.eq_ignore_ascii_case(text));
        let all = || Self::ALL.map(|(name, _)| name).join(", ");
        found.map(|(_, own)| *own).ok_or_else(|| format!("{text:?} are no names of bones; there are {}", all()))
    }
}

fn upper_camel(bone: HumanoidBone, is_cmu: bool) -> Option<String> {
    let side = match bone.side {
        Some(Side::Left) => "Left",
        Some(Side::Right) => "Right",
        None => "",
    };
    let part = match bone.part {
        HumanoidPart::Hips => "Hips",
        // The database counts from the bone below.
        HumanoidPart::Spine => {
            if is_cmu {
                "LowerBack"
            } else {
                "Spine"
            }
        }
        HumanoidPart::Chest => {
            if is_cmu {
                "Spine"
            } else {
                "Spine1"
            }
        }
        HumanoidPart::UpperChest => {
            if is_cmu {
                "Spine1"
            } else {
                "Spine2"
            }
        }
        HumanoidPart::Neck => "Neck",
        HumanoidPart::Head => "Head",
        HumanoidPart::UpperLeg => "UpLeg",
        HumanoidPart::LowerLeg => "Leg",
        HumanoidPart::Foot => "Foot",
        HumanoidPart::Toes => "ToeBase",
        HumanoidPart::Shoulder => "Shoulder",
        HumanoidPart::UpperArm => "Arm",
        HumanoidPart::LowerArm => "ForeArm",
        HumanoidPart::Hand => "Hand",
        HumanoidPart::Eye if !is_cmu => "Eye",
        HumanoidPart::Finger(finger, segment) if !is_cmu => {
            let finger = if finger == Finger::Little { "Pinky".to_owned() } else { format!("{finger:?}") };
            return Some(format!("{side}Hand{finger}{segment}"));
        }
        HumanoidPart::Finger(finger, 1) => {
            let letter = &side[..1];
            return match finger {
                Finger::Thumb => Some(format!("{letter}Thumb")),
                Finger::Index => Some(format!("{side}HandIndex1")),
                _ => None,
            };
        }
        HumanoidPart::Eye | HumanoidPart::Jaw | HumanoidPart::Finger(..) => return None,
    };
    Some(format!("{side}{part}"))
}

fn snake(bone: HumanoidBone, spine: [&str; 3]) -> Option<String> {
    let part = match bone.part {
        HumanoidPart::Hips => "pelvis",
        HumanoidPart::Spine => spine[0],
        HumanoidPart::Chest => spine[1],
        HumanoidPart::UpperChest => spine[2],
        HumanoidPart::Neck => "neck_01",
        HumanoidPart::Head => "head",
        HumanoidPart::UpperLeg => "thigh",
        HumanoidPart::LowerLeg => "calf",
        HumanoidPart::Foot => "foot",
        HumanoidPart::Toes => "ball",
        HumanoidPart::Shoulder => "clavicle",
        HumanoidPart::UpperArm => "upperarm",
        HumanoidPart::LowerArm => "lowerarm",
        HumanoidPart::Hand => "hand",
        HumanoidPart::Finger(finger, segment) => {
            let finger = if finger == Finger::Little { "pinky".into() } else { format!("{finger:?}").to_lowercase() };
            return Some(format!("{finger}_{segment:02}{}", suffix(bone.side)));
        }
        HumanoidPart::Eye | HumanoidPart::Jaw => return None,
    };
    Some(format!("{part}{}", suffix(bone.side)))
}

fn suffix(side: Option<Side>) -> &'static str {
    match side {
        Some(Side::Left) => "_l",
        Some(Side::Right) => "_r",
        None => "",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::Transform;

    #[test]
    fn names_are_those_of_the_programs_and_recognised_again() {
        let name = |names: BoneNames, part, side| names.name(HumanoidBone { part, side });
        let left = Some(Side::Left);
        assert_eq!(name(BoneNames::Mixamo, HumanoidPart::LowerArm, left).unwrap(), "mixamorig:LeftForeArm");
        let finger = HumanoidPart::Finger(Finger::Little, 2);
        assert_eq!(name(BoneNames::Mixamo, finger, Some(Side::Right)).unwrap(), "mixamorig:RightHandPinky2");
        assert_eq!(name(BoneNames::Unreal, finger, left).unwrap(), "pinky_02_l");
        assert_eq!(name(BoneNames::MetaHuman, HumanoidPart::Chest, None).unwrap(), "spine_03");
        assert_eq!(name(BoneNames::Cmu, HumanoidPart::Spine, None).unwrap(), "LowerBack");
        assert_eq!(name(BoneNames::Cmu, HumanoidPart::Eye, left), None);
        assert!("blender".parse::<BoneNames>().unwrap_err().contains("metahuman"));

        let bone = |name: &str, parent, at: [f32; 3], tail: [f32; 3]| Bone {
            name: name.into(),
            parent,
            rest: Transform { translation: at.into(), ..Transform::IDENTITY },
            tail: tail.into(),
        };
        let down = [0.0, -0.4, 0.0];
        let skeleton = Skeleton::new(vec![
            bone("thigh.L", None, [0.1, 0.9, 0.0], down),
            bone("shin.L", Some(0), down, down),
            bone("foot.L", Some(1), down, [0.0, 0.0, 0.1]),
            bone("calf_l", Some(2), [0.0, 0.0, 0.3], [0.0, 0.0, 0.1]),
        ])
        .unwrap();
        let before = recognise(&skeleton);
        for (_, names) in BoneNames::ALL {
            let renamed = names.rename(&skeleton);
            assert_eq!(
                recognise(&renamed).bones[..3].iter().map(|b| b.map(|b| b.bone)).collect::<Vec<_>>(),
                before.bones[..3].iter().map(|b| b.map(|b| b.bone)).collect::<Vec<_>>(),
                "{names}"
            );
        }
        let unreal: Vec<String> = BoneNames::Unreal.rename(&skeleton).bones().iter().map(|b| b.name.clone()).collect();
        assert_eq!(unreal[..3], ["thigh_l", "calf_l", "foot_l"]);
    }
}
