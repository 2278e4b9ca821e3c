//! The built-in puppets: a human, a human of eight joints, a spider, a hand, and chains of any number of joints.
//!
//! A splitter's outlets are numbered from the character's left to its right, and on each side from front to back, so
//! that a host can tell equal branches apart.

use firmware_protocol::MAX_SENSORS;
use firmware_protocol::PartKind::{Bend, Twist, TwistBendTwist};

use super::parts::{Body, BodyBuilder, BodyError};

type Build = fn(BodyBuilder) -> Result<Body, BodyError>;

/// Name, what it is, how it is built.
const PRESETS: [(&str, &str, Build); 4] = [
    ("human", "human", human),
    ("human8", "human of eight joints", human8),
    ("spider", "spider with eight legs", spider),
    ("hand", "hand with five fingers", hand),
];

/// Most joints of `joints:N`: three sensors each, as many as a sample holds.
pub const MOST_JOINTS: usize = MAX_SENSORS / 3;

impl Body {
    /// The preset with this name: one of [`presets`](Self::presets), or `joints:N` with 1 to [`MOST_JOINTS`] joints. The
    /// same seed gives the same part numbers.
    pub fn preset(name: &str, seed: u64) -> Result<Self, BodyError> {
        let unknown = || BodyError::UnknownPreset {
            name: name.to_owned(),
            known: format!("{} or joints:N (N from 1 to {MOST_JOINTS})", Self::preset_names()),
        };
        let builder = BodyBuilder::new(name, seed);
        if let Some(count) = name.strip_prefix("joints:") {
            let count = count.parse().ok().filter(|n| (1..=MOST_JOINTS).contains(n)).ok_or_else(unknown)?;
            return joints(builder, count);
        }
        let (_, _, build) = PRESETS.iter().find(|(known, ..)| *known == name).ok_or_else(unknown)?;
        build(builder)
    }

    /// The presets: name, and what it is in a few words.
    pub fn presets() -> impl Iterator<Item = (&'static str, &'static str)> {
        PRESETS.iter().map(|&(name, what, _)| (name, what))
    }

    /// The names of the presets, with commas between.
    pub fn preset_names() -> String {
        PRESETS.map(|(name, ..)| name).join(", ")
    }
}

/// 19 joints, 45 sensors, on a stand, in T-pose.
fn human(mut b: BodyBuilder) -> Result<Body, BodyError> {
    let stand = b.splitter("stand", 1, None);
    let hips = b.joint("hips", TwistBendTwist, Some(stand));
    let pelvis = b.splitter("pelvis", 3, Some(hips));
    let left_hip = b.joint("left_hip", TwistBendTwist, Some(pelvis));
    let spine = b.joint("spine", TwistBendTwist, Some(pelvis));
    let right_hip = b.joint("right_hip", TwistBendTwist, Some(pelvis));
    for (side, hip) in [("left", left_hip), ("right", right_hip)] {
        let knee = b.joint(format!("{side}_knee"), Bend, Some(hip));
        b.joint(format!("{side}_ankle"), TwistBendTwist, Some(knee));
    }
    let chest = b.joint("chest", TwistBendTwist, Some(spine));
    let shoulders = b.splitter("shoulders", 3, Some(chest));
    let left_shoulder = b.joint("left_shoulder", TwistBendTwist, Some(shoulders));
    let neck = b.joint("neck", TwistBendTwist, Some(shoulders));
    let right_shoulder = b.joint("right_shoulder", TwistBendTwist, Some(shoulders));
    for (side, shoulder) in [("left", left_shoulder), ("right", right_shoulder)] {
        let elbow = b.joint(format!("{side}_elbow"), Bend, Some(shoulder));
        let forearm = b.joint(format!("{side}_forearm"), Twist, Some(elbow));
        b.joint(format!("{side}_wrist"), TwistBendTwist, Some(forearm));
    }
    b.joint("head", TwistBendTwist, Some(neck));
    b.finish()
}

/// A human made of eight joints of one kind: spine, head, two arms with elbows, two legs. On a stand that holds the
/// pelvis, in T-pose.
fn human8(mut b: BodyBuilder) -> Result<Body, BodyError> {
    let stand = b.splitter("stand", 3, None);
    b.joint("left_hip", TwistBendTwist, Some(stand));
    let spine = b.joint("spine", TwistBendTwist, Some(stand));
    b.joint("right_hip", TwistBendTwist, Some(stand));
    let shoulders = b.splitter("shoulders", 3, Some(spine));
    let left_shoulder = b.joint("left_shoulder", TwistBendTwist, Some(shoulders));
    b.joint("head", TwistBendTwist, Some(shoulders));
    let right_shoulder = b.joint("right_shoulder", TwistBendTwist, Some(shoulders));
    b.joint("left_elbow", TwistBendTwist, Some(left_shoulder));
    b.joint("right_elbow", TwistBendTwist, Some(right_shoulder));
    b.finish()
}

/// A body and eight legs of three joints.
fn spider(mut b: BodyBuilder) -> Result<Body, BodyError> {
    let stand = b.splitter("stand", 1, None);
    let body = b.joint("body", TwistBendTwist, Some(stand));
    let sides = b.splitter("sides", 2, Some(body));
    for side in ["left", "right"] {
        let legs = b.splitter(format!("{side}_legs"), 4, Some(sides));
        for leg in 1..=4 {
            let hip = b.joint(format!("{side}_{leg}_hip"), TwistBendTwist, Some(legs));
            let knee = b.joint(format!("{side}_{leg}_knee"), Bend, Some(hip));
            b.joint(format!("{side}_{leg}_ankle"), Bend, Some(knee));
        }
    }
    b.finish()
}

/// A left hand with the palm facing front: the little finger is on the character's left, the thumb on its right.
fn hand(mut b: BodyBuilder) -> Result<Body, BodyError> {
    let stand = b.splitter("stand", 1, None);
    let wrist = b.joint("wrist", TwistBendTwist, Some(stand));
    let palm = b.splitter("palm", 5, Some(wrist));
    for finger in ["little", "ring", "middle", "index", "thumb"] {
        let base = b.joint(format!("{finger}_1"), TwistBendTwist, Some(palm));
        let middle = b.joint(format!("{finger}_2"), Bend, Some(base));
        b.joint(format!("{finger}_3"), Bend, Some(middle));
    }
    b.finish()
}

/// One three-axis joint with up to four chains of equal length attached to it.
fn joints(mut b: BodyBuilder, count: usize) -> Result<Body, BodyError> {
    let root = b.joint("joint_1", TwistBendTwist, None);
    let chains = (count - 1).min(4);
    if chains > 0 {
        let hub = b.splitter("hub", chains as u8, Some(root));
        let mut ends = vec![hub; chains];
        for joint in 1..count {
            let end = &mut ends[(joint - 1) % chains];
            *end = b.joint(format!("joint_{}", joint + 1), TwistBendTwist, Some(*end));
        }
    }
    b.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint_count(body: &Body) -> usize {
        (0..body.parts().len()).filter(|&part| !body.sensors(part).is_empty()).count()
    }

    #[test]
    fn presets_have_the_promised_joints() {
        for (name, joints, sensors) in [
            ("human", 19, 45),
            ("human8", 8, 24),
            ("spider", 25, 43),
            ("hand", 16, 28),
            ("joints:32", 32, 96),
            ("joints:1", 1, 3),
            ("joints:149", 149, 447),
        ] {
            let body = Body::preset(name, 1).unwrap();
            assert_eq!((joint_count(&body), body.sensor_count()), (joints, sensors), "{name}");
            let mut uids: Vec<_> = body.parts().iter().map(|p| p.uid).collect();
            uids.sort_unstable();
            uids.dedup();
            assert_eq!(uids.len(), body.parts().len());
            assert_eq!(body, Body::preset(name, 1).unwrap());
            assert_ne!(body.parts()[0].uid, Body::preset(name, 2).unwrap().parts()[0].uid);
        }
        for name in ["", "dog", "joints", "joints:0", "joints:150", "joints:x", "human:2"] {
            assert!(matches!(Body::preset(name, 1), Err(BodyError::UnknownPreset { .. })), "{name}");
        }
    }

    #[test]
    fn what_hangs_below_is_found() {
        let body = Body::preset("human", 0).unwrap();
        let at = |label| body.find(label).unwrap();
        assert!(body.is_below(at("left_wrist"), at("chest")));
        assert!(!body.is_below(at("left_knee"), at("chest")));
    }
}
