//! What names of joints and bones say: which side, which limb, which segment of it.

use super::humanoid::{HumanoidPart, Side};
use super::words::{side_of_word, words};

/// What a segment belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limb {
    Trunk,
    Head,
    Arm,
    Digit,
    Leg,
    Tail,
}

/// What a name says.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Meaning {
    pub(crate) side: Option<Side>,
    pub(crate) limb: Option<Limb>,
    /// Which segment of its limb, by the number of its entry in [`SEGMENTS`]; names that programs use for different
    /// segments (a mixamo "Leg" is a shin, a "Shoulder" a collarbone or an upper arm) have none.
    pub(crate) segment: Option<usize>,
}

/// Words of names, without sides and numbers, and what they stand for. The first entry that a name contains counts.
const SEGMENTS: &[(Limb, &[&str])] = &[
    (Limb::Digit, &["thumb"]),
    (Limb::Digit, &["index"]),
    (Limb::Digit, &["middlefinger", "handmiddle", "middleproximal", "middleintermediate", "middledistal"]),
    (Limb::Digit, &["ringfinger", "handring", "ringproximal", "ringintermediate", "ringdistal"]),
    (Limb::Digit, &["little", "pinky"]),
    (Limb::Arm, &["forearm", "lowerarm", "elbow"]),
    (Limb::Arm, &["upperarm", "uparm"]),
    (Limb::Arm, &["clavicle", "collar", "scapula"]),
    (Limb::Arm, &["hand", "wrist", "palm"]),
    (Limb::Leg, &["upleg", "upperleg", "thigh", "femur"]),
    (Limb::Leg, &["lowerleg", "knee", "calf", "shin", "tibia"]),
    (Limb::Leg, &["toe"]),
    (Limb::Leg, &["foot", "ankle", "tarsus"]),
    (Limb::Head, &["neck"]),
    (Limb::Head, &["head", "skull"]),
    (Limb::Trunk, &["hips", "pelvis"]),
    (Limb::Tail, &["tail"]),
];

/// Words that tell the limb and no more.
const LIMBS: &[(Limb, &[&str])] = &[
    (Limb::Trunk, &["spine", "chest", "torso", "abdomen", "waist", "back", "body"]),
    (Limb::Arm, &["shoulder", "arm", "wing"]),
    (Limb::Leg, &["leg"]),
    (Limb::Digit, &["finger"]),
];

/// Single words that are fingers, where a number follows or precedes them.
const FINGERS: [(&str, usize); 2] = [("middle", 2), ("ring", 3)];

/// What a name says, as far as it is understood.
pub(crate) fn meaning(name: &str) -> Meaning {
    let mut side = None;
    let mut rest: Vec<String> = Vec::new();
    for word in words(name) {
        match side_of_word(&word) {
            Some(named) => side = Some(named),
            None => rest.push(word),
        }
    }
    // LHip, rShin: a letter for the side and a word that is known.
    if side.is_none()
        && let Some(word) = rest.last_mut()
        && let (Some(letter), Some(tail)) = (word.chars().next(), word.get(1..))
        && begins_known(tail)
        && matches!(letter, 'l' | 'r')
    {
        side = Some(if letter == 'l' { Side::Left } else { Side::Right });
        *word = tail.to_owned();
    }
    let joined = rest.concat();
    let (segment, limb) = known(&joined);
    // A hip with a side is a thigh, one without is the pelvis.
    let (segment, limb) = match (joined.as_str(), side) {
        (_, _) if limb.is_some() => (segment, limb),
        (hip, Some(_)) if hip.ends_with("hip") => (known("thigh").0, Some(Limb::Leg)),
        (hip, None) if hip.ends_with("hip") => (known("hips").0, Some(Limb::Trunk)),
        _ => match FINGERS.iter().find(|(word, _)| rest.iter().any(|own| own == word)) {
            Some(&(_, segment)) => (Some(segment), Some(Limb::Digit)),
            None => (None, None),
        },
    };
    Meaning { side, limb, segment }
}

impl Meaning {
    /// The same, with the segment that the bone's place in the tree says, where its name leaves it open.
    pub(crate) fn with_place(self, part: HumanoidPart) -> Self {
        let word = match part {
            HumanoidPart::UpperLeg => "thigh",
            HumanoidPart::LowerLeg => "shin",
            HumanoidPart::Foot => "foot",
            HumanoidPart::Shoulder => "clavicle",
            HumanoidPart::UpperArm => "upperarm",
            HumanoidPart::LowerArm => "forearm",
            HumanoidPart::Hand => "hand",
            _ => return self,
        };
        let (segment, limb) = known(word);
        if self.limb.is_some() && self.limb == limb && self.segment.is_none() { Self { segment, ..self } } else { self }
    }
}

/// Whether a word that is known begins the text: "knee" of an rKnee, but not "owerleg" of a lowerleg.
fn begins_known(text: &str) -> bool {
    let all = SEGMENTS.iter().chain(LIMBS).flat_map(|(_, words)| words.iter());
    text.starts_with("hip") || all.into_iter().any(|word| text.starts_with(word))
}

fn known(text: &str) -> (Option<usize>, Option<Limb>) {
    let contains = |words: &[&str]| words.iter().any(|word| text.contains(word));
    if let Some(at) = SEGMENTS.iter().position(|(_, words)| contains(words)) {
        return (Some(at), Some(SEGMENTS[at].0));
    }
    (None, LIMBS.iter().find(|(_, words)| contains(words)).map(|(limb, _)| *limb))
}

/// The cost of a joint with one meaning driving a bone with another; 0 where the names agree or say nothing.
pub(crate) fn disagreement(joint: Meaning, bone: Meaning) -> f64 {
    const OTHER_SIDE: f64 = 2.5;
    const OTHER_LIMB: f64 = 1.5;
    const OTHER_SEGMENT: f64 = 1.0;
    /// One name tells the segment, the other only the limb.
    const SOME_SEGMENT: f64 = 0.5;
    let side = joint.side.zip(bone.side).is_some_and(|(a, b)| a != b);
    let limb = joint.limb.zip(bone.limb).is_some_and(|(a, b)| a != b);
    let segment = match (joint.segment, bone.segment) {
        (Some(a), Some(b)) if a != b => OTHER_SEGMENT,
        (Some(_), None) if bone.limb.is_some() => SOME_SEGMENT,
        _ => 0.0,
    };
    f64::from(u8::from(side)) * OTHER_SIDE + f64::from(u8::from(limb)) * OTHER_LIMB + if limb { 0.0 } else { segment }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_programs_mean_the_same() {
        let same = |names: &[&str], side: Option<Side>, limb: Limb| {
            let first = meaning(names[0]);
            for name in names {
                assert_eq!((meaning(name).side, meaning(name).limb), (side, Some(limb)), "{name}");
                assert_eq!(meaning(name).segment, first.segment, "{name}");
            }
        };
        let (left, right) = (Some(Side::Left), Some(Side::Right));
        same(&["left_hip", "LeftUpLeg", "LHip", "thigh.l", "LeftThigh", "mixamorig:LeftUpLeg"], left, Limb::Leg);
        same(&["right_knee", "RightLowerLeg", "rShin", "calf_r", "RKnee"], right, Limb::Leg);
        same(&["left_elbow", "LeftForeArm", "lowerarm_l", "LElbow"], left, Limb::Arm);
        same(&["right_wrist", "RightHand", "hand.R", "RWrist"], right, Limb::Arm);
        same(&["thumb_1", "ThumbProximal"], None, Limb::Digit);
        same(&["middle_2", "MiddleDistal"], None, Limb::Digit);
        same(&["ring_1", "RingIntermediate"], None, Limb::Digit);
        same(&["hips", "Pelvis", "b_Hip_01"], None, Limb::Trunk);
        same(&["tail1", "b_Tail01_012"], None, Limb::Tail);
        for nothing in ["b12", "j0", "ul", "lr", "s1", "root", "joint_3"] {
            assert_eq!(meaning(nothing).limb, None, "{nothing}");
        }
        assert_eq!(meaning("LeftShoulder"), Meaning { side: left, limb: Some(Limb::Arm), segment: None });
    }

    #[test]
    fn left_stays_left() {
        let cost = |joint, bone| disagreement(meaning(joint), meaning(bone));
        assert_eq!(cost("left_elbow", "LeftForeArm"), 0.0);
        assert!(cost("left_elbow", "RightForeArm") > cost("left_elbow", "LeftLeg"));
        assert!(cost("left_elbow", "LeftLeg") > cost("left_elbow", "LeftHand"));
        assert_eq!(cost("joint_3", "LeftHand"), 0.0);
    }
}
