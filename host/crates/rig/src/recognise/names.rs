//! What the names of a skeleton's bones say, bone by bone.

use std::collections::BTreeMap;

use super::humanoid::{Finger, Side};
use super::words::{side_of_word, words};
use crate::skeleton::Skeleton;

/// What a name may stand for. Fingers and toes are told apart later, by their place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Named {
    Hips,
    Trunk,
    Neck,
    Head,
    Jaw,
    Eye,
    UpperLeg,
    LowerLeg,
    Foot,
    Toes,
    Shoulder,
    UpperArm,
    LowerArm,
    Hand,
    Finger(Finger),
    Metacarpal,
}

/// What a name may stand for and how well it fits, 0 to 1.
pub(super) type Candidates = &'static [(Named, f32)];

/// What one bone's name says.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Reading {
    pub(super) side: Option<Side>,
    pub(super) candidates: Candidates,
    /// It helps another bone (twists, targets, controls, ends), or is no part of the body (hair, clothes).
    pub(super) is_helper: bool,
}

/// Words of bones that are no part of the body or only help one.
const HELPERS: &[&str] = &[
    "attach",
    "attachment",
    "aux",
    "breast",
    "bust",
    "butt",
    "cloth",
    "control",
    "controller",
    "corrective",
    "ctrl",
    "dummy",
    "dyn",
    "end",
    "fk",
    "hair",
    "handle",
    "heel",
    "helper",
    "ik",
    "jiggle",
    "mch",
    "nub",
    "org",
    "phys",
    "pole",
    "prop",
    "proxy",
    "roll",
    "root",
    "sec",
    "share",
    "skirt",
    "socket",
    "target",
    "tip",
    "tweak",
    "twist",
    "vis",
    "weapon",
    "wgt",
];

use Named::{
    Eye, Foot, Hand, Head, Hips, Jaw, LowerArm, LowerLeg, Metacarpal, Neck, Shoulder, Toes, Trunk, UpperArm, UpperLeg,
};

/// What names stand for; the first entry of which the name contains a word counts.
const PARTS: &[(&[&str], Candidates)] = &[
    (&["toe", "toes"], &[(Toes, 1.0)]),
    (&["eyebrow", "eyelid", "eyelash", "eyes", "tongue", "teeth", "cheek"], &[]),
    (&["hipjoint"], &[]),
    (&["headtop", "headend", "topofhead"], &[]),
    (&["eye"], &[(Eye, 1.0)]),
    (&["jaw", "chin"], &[(Jaw, 1.0)]),
    (&["thumb", "pollex"], &[(Named::Finger(Finger::Thumb), 1.0)]),
    (&["pinky", "pinkie"], &[(Named::Finger(Finger::Little), 1.0)]),
    (&["metacarp", "carpal", "inhand"], &[(Metacarpal, 1.0)]),
    (&["forearm", "foarm", "lowerarm", "loarm", "lowarm", "armlower", "elbow", "radius", "ulna"], &[(LowerArm, 1.0)]),
    (&["upperarm", "uparm", "armupper", "humerus", "shldr", "bicep"], &[(UpperArm, 1.0)]),
    (&["clavicle", "collar", "scapula", "shoulderblade"], &[(Shoulder, 1.0)]),
    (&["spineshoulder"], &[(Trunk, 1.0)]),
    (&["shoulder"], &[(Shoulder, 0.7), (UpperArm, 0.65)]),
    (&["wrist"], &[(Hand, 1.0)]),
    (&["hand"], &[(Hand, 0.97)]),
    (&["palm"], &[(Metacarpal, 0.9)]),
    (&["thigh", "femur", "upleg", "upperleg", "legupper"], &[(UpperLeg, 1.0)]),
    (&["knee", "calf", "shin", "tibia", "lowerleg", "loleg", "lowleg", "leglower"], &[(LowerLeg, 1.0)]),
    (&["ankle"], &[(Foot, 1.0)]),
    (&["foot"], &[(Foot, 0.97), (Toes, 0.45)]),
    (&["pelvis", "hips", "spinebase"], &[(Hips, 1.0)]),
    (&["leg"], &[(LowerLeg, 0.6), (UpperLeg, 0.55)]),
    (&["arm"], &[(UpperArm, 0.6), (LowerArm, 0.3)]),
    (&["neck"], &[(Neck, 1.0)]),
    (&["head", "skull", "cranium"], &[(Head, 1.0)]),
    (
        &["spine", "chest", "torso", "abdomen", "waist", "back", "thorax", "lumbar", "ribcage", "belly", "stomach"],
        &[(Trunk, 1.0)],
    ),
];

/// Words that count only where they stand alone: others contain them.
const WHOLE_WORDS: &[(&str, Candidates)] = &[
    ("brow", &[]),
    ("ear", &[]),
    ("lid", &[]),
    ("lip", &[]),
    ("nose", &[]),
    ("ball", &[(Toes, 1.0)]),
    ("index", &[(Named::Finger(Finger::Index), 1.0)]),
    ("pointer", &[(Named::Finger(Finger::Index), 1.0)]),
    ("middle", &[(Named::Finger(Finger::Middle), 1.0)]),
    ("mid", &[(Named::Finger(Finger::Middle), 0.8)]),
    ("ring", &[(Named::Finger(Finger::Ring), 1.0)]),
    ("little", &[(Named::Finger(Finger::Little), 1.0)]),
    ("small", &[(Named::Finger(Finger::Little), 0.8)]),
];
const HIP_OF_A_SIDE: Candidates = &[(UpperLeg, 0.9)];
const HIP: Candidates = &[(Hips, 1.0)];
const METACARPAL: Candidates = &[(Metacarpal, 1.0)];
const VERTEBRA: Candidates = &[(Trunk, 1.0)];
/// The centre of gravity, and what other rigs call it.
const CENTER: Candidates = &[(Hips, 0.3)];

/// What each bone's name says, in the skeleton's order.
pub(super) fn readings(skeleton: &Skeleton) -> Vec<Reading> {
    let split: Vec<Vec<String>> = skeleton.bones().iter().map(|bone| words(&bone.name)).collect();
    let common = common_words(&split);
    let first_finger = first_finger_number(skeleton, &split);
    let names = skeleton.bones().iter().zip(&split);
    names.map(|(bone, words)| reading(&bone.name, words, &common, first_finger)).collect()
}

fn reading(name: &str, words: &[String], common: &[&str], first_finger: Option<u32>) -> Reading {
    if is_vertebra(name) {
        return Reading { candidates: VERTEBRA, ..Reading::default() };
    }
    let mut side = None;
    let mut rest: Vec<&str> = Vec::new();
    for word in words {
        match side_of_word(word) {
            Some(named) => side = Some(named),
            None if !common.contains(&word.as_str()) => rest.push(word),
            None => {}
        }
    }
    // lShldr, RHip, lfemur: a letter for the side and a word that is known.
    if side.is_none()
        && let Some(word) = rest.first_mut()
        && let (Some(letter @ ('l' | 'r')), Some(tail)) = (word.chars().next(), word.get(1..))
        && begins_known(tail)
    {
        side = Some(if letter == 'l' { Side::Left } else { Side::Right });
        *word = tail;
    }
    let joined = rest.concat();
    let is_helper = rest.iter().any(|word| HELPERS.contains(word));
    let candidates = candidates(&joined, &rest, side, finger_number(name), first_finger);
    // The whole neck turns where a limb's twist only helps.
    let is_helper = is_helper && !(joined.contains("necktwist"));
    // The pelvis has no side; what has is a muscle.
    let beside = side.is_some() && matches!(candidates.first(), Some((Hips | Trunk | Neck | Head, _)));
    Reading { side, candidates, is_helper: is_helper || beside }
}

fn candidates(
    joined: &str,
    rest: &[&str],
    side: Option<Side>,
    number: Option<u32>,
    first_finger: Option<u32>,
) -> Candidates {
    let whole = WHOLE_WORDS.iter().find(|(word, _)| rest.contains(word));
    let is_toe = joined.contains("toe");
    let is_metacarpal = joined.contains("inhand") || joined.contains("metacarp");
    if let Some((_, found)) = whole.filter(|_| !is_toe && !is_metacarpal) {
        return found;
    }
    if let (Some(number), Some(first), false) = (number, first_finger, is_toe) {
        let finger = number.wrapping_sub(first);
        return if is_metacarpal && finger > 0 { METACARPAL } else { finger_of_number(finger) };
    }
    if let Some((_, found)) = PARTS.iter().find(|(words, _)| words.iter().any(|word| joined.contains(word))) {
        return found;
    }
    match (joined, side) {
        ("cog" | "center" | "centre" | "com", None) => CENTER,
        (hip, Some(_)) if hip.ends_with("hip") || hip.starts_with("hip") => HIP_OF_A_SIDE,
        (hip, None) if hip.ends_with("hip") || hip.starts_with("hip") => HIP,
        _ => &[],
    }
}

fn finger_of_number(number: u32) -> Candidates {
    match number {
        0 => &[(Named::Finger(Finger::Thumb), 0.9)],
        1 => &[(Named::Finger(Finger::Index), 0.9)],
        2 => &[(Named::Finger(Finger::Middle), 0.9)],
        3 => &[(Named::Finger(Finger::Ring), 0.9)],
        4 => &[(Named::Finger(Finger::Little), 0.9)],
        _ => &[],
    }
}

/// The number of a finger that is called by one: "Finger12" and "finger1-2" are the second bone of finger 1.
fn finger_number(name: &str) -> Option<u32> {
    let name = name.to_lowercase();
    let (_, after) = name.split_once("finger")?;
    after.trim_start_matches(['_', '-', '.', ' ']).chars().next()?.to_digit(10)
}

/// The number of the thumb, where fingers are numbered: "Finger0" to "Finger4", "finger1-1" to "finger5-3".
fn first_finger_number(skeleton: &Skeleton, split: &[Vec<String>]) -> Option<u32> {
    let least = skeleton.bones().iter().filter_map(|bone| finger_number(&bone.name)).min()?;
    let has_thumb = split.iter().flatten().any(|word| word.contains("thumb"));
    // Beside a thumb of that name the first number is the index finger's.
    Some(if has_thumb { least.wrapping_sub(1) } else { least })
}

/// Vertebrae of motion capture suits: L5, L3, T12, T8.
fn is_vertebra(name: &str) -> bool {
    let name = name.rsplit([':', '|']).next().unwrap_or(name);
    let mut letters = name.chars();
    matches!(letters.next(), Some('L' | 'T')) && !letters.as_str().is_empty() && letters.all(|c| c.is_ascii_digit())
}

/// Words that nearly all names contain say nothing: `mixamorig`, `Bip01`, `CC_Base`, `J_Bip`.
fn common_words(split: &[Vec<String>]) -> Vec<&str> {
    const ENOUGH_BONES: usize = 5;
    const NEARLY_ALL: f64 = 0.8;
    let mut count: BTreeMap<&str, usize> = BTreeMap::new();
    for words in split {
        let mut seen: Vec<&str> = words.iter().map(String::as_str).collect();
        seen.sort_unstable();
        seen.dedup();
        for word in seen {
            *count.entry(word).or_default() += 1;
        }
    }
    let most = |times: usize| split.len() >= ENOUGH_BONES && times as f64 >= NEARLY_ALL * split.len() as f64;
    count
        .into_iter()
        .filter(|&(word, times)| most(times) && side_of_word(word).is_none())
        .map(|(word, _)| word)
        .collect()
}

/// Whether a word that is known begins the text: "knee" of an rKnee, but not "owerleg" of a lowerleg.
fn begins_known(text: &str) -> bool {
    let mut all = PARTS.iter().flat_map(|(words, _)| words.iter()).chain(WHOLE_WORDS.iter().map(|(word, _)| word));
    text.starts_with("hip") || text.starts_with("finger") || all.any(|word| word.len() > 2 && text.starts_with(word))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(name: &str) -> Reading {
        reading(name, &words(name), &[], Some(0))
    }

    #[test]
    fn one_bone_has_many_names() {
        for (named, names) in [
            (
                UpperLeg,
                &["thigh.L", "LeftUpLeg", "lThighBend", "L_Hip", "HipLeft", "lfemur", "左足", "upperleg01.L"][..],
            ),
            (LowerLeg, &["shin.L", "calf_l", "LKnee", "左ひざ", "J_Bip_L_LowerLeg", "ltibia"]),
            (LowerArm, &["forearm.L", "lowerarm_l", "LeftForeArm", "lForearmBend", "ElbowLeft", "左ひじ", "lradius"]),
            (UpperArm, &["upper_arm.L", "LeftUpperArm", "lShldrBend", "左腕", "lhumerus"]),
            (Shoulder, &["clavicle_l", "L_Collar", "Scapula_L", "lCollar", "左肩"]),
            (Toes, &["ball_l", "LeftToeBase", "toe.L", "Bip01 L Toe0", "左つま先"]),
            (Named::Finger(Finger::Ring), &["LeftHandRing1", "f_ring.01.L", "左薬指１", "Bip01 L Finger31"]),
        ] {
            for name in names {
                let read = read(name);
                assert_eq!(read.side, Some(Side::Left), "{name}");
                assert_eq!(read.candidates.first().map(|(named, _)| *named), Some(named), "{name}");
                assert!(!read.is_helper, "{name}");
            }
        }
    }

    #[test]
    fn helpers_are_no_limbs() {
        for name in
            ["upperarm_twist_01_l", "ik_foot_l", "LeftForeArmRoll", "MCH-thigh.L", "Bip01 L Toe0Nub", "左足ＩＫ"]
        {
            assert!(read(name).is_helper, "{name}");
        }
        assert!(read("DEF-pelvis.L").is_helper, "a pelvis has no side");
        assert!(read("eyebrow.L").candidates.is_empty());
    }
}
