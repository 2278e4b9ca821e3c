//! Which bone is which, as far as a skeleton's names and shape say.

use armature_character::inverse_kinematics::anatomical_limits;
use armature_rig::{Evidence, Figure, Skeleton, recognise};
use serde_json::{Value, json};

use super::Findings;
use crate::terminal::counted;

/// Less sure bones are listed one by one.
const SURE: f32 = 0.9;

/// A line for the whole figure and one for the bones to look at; nothing for what is no figure.
pub(super) fn recognised(skeleton: &Skeleton) -> Findings {
    let (rest_words, rest) = rest_pose(skeleton);
    let recognition = recognise(skeleton);
    let found: Vec<_> = skeleton.bones().iter().zip(&recognition.bones).filter_map(|(b, f)| Some((b, (*f)?))).collect();
    let limits: Vec<String> = anatomical_limits(skeleton).iter().map(ToString::to_string).collect();
    let value = json!({
        "figure": recognition.figure.to_string(), "limits": limits,
        "bones": found.iter().map(|(bone, found)| json!({
            "name": bone.name, "is": found.bone.to_string(), "by": by(found.evidence),
            "confidence": (f64::from(found.confidence) * 100.0).round() / 100.0,
        })).collect::<Vec<Value>>(),
        "rest_pose": rest,
    });
    if found.is_empty() {
        return (Vec::new(), value);
    }
    let figure = match recognition.figure {
        Figure::Human => "a human",
        Figure::Quadruped => "a quadruped",
        Figure::Hand => "a hand",
        Figure::Other => "part of a figure",
    };
    let bones = counted(skeleton.len(), "bone", "bones");
    let mut words = vec![format!("recognised: {figure}, {} of {bones}", found.len())];
    words.extend(rest_words);
    let list = |is_sure: bool| -> Vec<String> {
        let wanted = found.iter().filter(|(_, found)| (found.confidence >= SURE) == is_sure);
        wanted.map(|(bone, found)| format!("{} = {}", bone.name, found.bone)).collect()
    };
    for (what, bones) in [("by name", list(true)), ("by place or shape, please check", list(false))] {
        if !bones.is_empty() {
            words.push(format!("{what}: {}", bones.join(", ")));
        }
    }
    if !limits.is_empty() {
        words.push(format!("turn, without a joint, no further than (degrees, --limit): {}", limits.join(", ")));
    }
    (words, value)
}

/// The pose in which a person rests, beside the poses in which puppets are zeroed.
fn rest_pose(skeleton: &Skeleton) -> (Option<String>, Value) {
    use armature_rig::{RestPose, RestTurn, match_rest_pose};

    if recognise(skeleton).figure != Figure::Human {
        return (None, Value::Null);
    }
    let turned = |pose| match_rest_pose(pose, skeleton, &|_| true).turns;
    let (t, a) = (turned(RestPose::T), turned(RestPose::A));
    let nearest = |turns: &[RestTurn]| turns.iter().map(RestTurn::angle).sum::<f32>();
    let (pose, turns) = if nearest(&a) < nearest(&t) { (RestPose::A, a) } else { (RestPose::T, t) };
    let bones: Vec<String> = turns.iter().map(|turn| format!("{} by {:.0}°", turn.bone, turn.angle())).collect();
    let value = json!({
        "nearest": pose.to_string(),
        "off_degrees": turns.iter().map(|turn| json!({"bone": turn.bone, "degrees": turn.angle()})).collect::<Vec<_>>(),
    });
    let beside = if bones.is_empty() { String::new() } else { format!(", but for {}", bones.join(", ")) };
    let article = if pose == RestPose::A { "an" } else { "a" };
    (Some(format!("rests in {article} {pose}{beside}")), value)
}

fn by(evidence: Evidence) -> &'static str {
    match evidence {
        Evidence::Name => "name",
        Evidence::NameAndPlace => "name and place",
        Evidence::Shape => "shape",
    }
}
