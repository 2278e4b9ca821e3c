//! Points of the character that are dragged to places, on a timetable: in words, and as the engine takes them.

use std::str::FromStr;

use armature_rig::{Target, TargetChange, TargetPoint};
use clap::Args;
use glam::{Quat, Vec3};

use super::LoadedCharacter;
use crate::failure::Failure;

/// A target is gone to, and let go, over this time unless it says otherwise, seconds.
const OVER_SECONDS: f64 = 0.25;

/// Dragging.
#[derive(Clone, Debug, Default, PartialEq, Args)]
pub struct TargetArgs {
    /// Drag a point of the character to a place, besides what the puppet does: BONE=X,Y,Z in the character's own unit, +Y up,
    /// +Z where it looks; BONE=+X,Y,Z is counted from where it rests. BONE is a bone's joint, BONE:tail its end, vertex:N a
    /// point of the skin. BONE@2..4= holds it from second 2 to second 4 only. More words, after colons: turn=X,Y,Z gives the
    /// bone an orientation (a turn from rest, degrees about the axes), strength=0.3 pulls instead of holding, over=0.5 is how
    /// many seconds it takes to go there and to come back. May be given several times; bones that a joint turns stay with it
    #[arg(long = "target", value_name = "BONE=X,Y,Z")]
    pub targets: Vec<Wish>,
}

/// Where a point comes from.
#[derive(Clone, Debug, PartialEq)]
enum Named {
    Head(String),
    Tail(String),
    Vertices([u32; 3]),
}

/// One target of a timetable.
#[derive(Clone, Debug, PartialEq)]
pub struct Wish {
    text: String,
    point: Named,
    from: f64,
    to: Option<f64>,
    place: Option<Vec3>,
    /// The place is counted from where the point rests.
    from_rest: bool,
    /// Degrees about the axes of the model, away from rest.
    turn: Option<Vec3>,
    strength: f32,
    over: f64,
}

/// Text that is no target.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{text:?} is no target: {why}; write BONE=X,Y,Z, BONE:tail=+X,Y,Z, vertex:N@2..4=X,Y,Z or BONE=turn=X,Y,Z, with \
     :strength=0.3 or :over=0.5 behind it"
)]
pub struct UnknownTarget {
    text: String,
    why: &'static str,
}

impl FromStr for Wish {
    type Err = UnknownTarget;

    fn from_str(text: &str) -> Result<Self, UnknownTarget> {
        let wrong = |why| UnknownTarget { text: text.to_owned(), why };
        let (name, words) = text.split_once('=').ok_or_else(|| wrong("it gives no place"))?;
        let (name, when) = match name.rsplit_once('@') {
            Some((name, when)) => (name, Some(when)),
            None => (name, None),
        };
        let (from, to) = match when {
            Some(when) => times(when).ok_or_else(|| wrong("its times are not FROM..TO in seconds"))?,
            None => (0.0, None),
        };
        let point = named(name).ok_or_else(|| wrong("it names no point"))?;
        let mut wish = Self {
            text: text.to_owned(),
            point,
            from,
            to,
            place: None,
            from_rest: false,
            turn: None,
            strength: 1.0,
            over: OVER_SECONDS,
        };
        for (index, word) in words.split(':').enumerate() {
            let number = |value: &str| value.trim().parse::<f64>().ok().filter(|number| number.is_finite());
            match word.split_once('=') {
                None if index == 0 => {
                    let place = word.trim();
                    wish.from_rest = place.starts_with('+');
                    let place = place.strip_prefix('+').unwrap_or(place);
                    wish.place = Some(three(place).ok_or_else(|| wrong("its place is not three numbers"))?);
                }
                Some(("turn", value)) => {
                    wish.turn = Some(three(value).ok_or_else(|| wrong("its turn is not three angles"))?);
                }
                Some(("strength", value)) => {
                    let strength = number(value).filter(|strength| *strength > 0.0 && *strength <= 1.0);
                    wish.strength = strength.ok_or_else(|| wrong("its strength is not above 0 and at most 1"))? as f32;
                }
                Some(("over", value)) => {
                    let over = number(value).filter(|over| (0.0..=60.0).contains(over));
                    wish.over = over.ok_or_else(|| wrong("over= is not from 0 to 60 seconds"))?;
                }
                _ => return Err(wrong("it has a word that means nothing")),
            }
        }
        if wish.place.is_none() && wish.turn.is_none() {
            return Err(wrong("it asks for nothing"));
        }
        Ok(wish)
    }
}

/// `FROM..TO`, each with or without an `s`, each may be missing.
fn times(text: &str) -> Option<(f64, Option<f64>)> {
    let (from, to) = text.split_once("..")?;
    let time = |text: &str| {
        let text = text.trim();
        let seconds: f64 = text.strip_suffix('s').unwrap_or(text).parse().ok()?;
        (0.0..=1e6).contains(&seconds).then_some(seconds)
    };
    let from = if from.trim().is_empty() { 0.0 } else { time(from)? };
    let to = if to.trim().is_empty() { None } else { Some(time(to)?) };
    to.is_none_or(|to| to > from).then_some((from, to))
}

fn named(name: &str) -> Option<Named> {
    let vertices = |text: &str| text.split(',').map(|v| v.trim().parse().ok()).collect::<Option<Vec<u32>>>();
    if let Some(text) = name.strip_prefix("vertex:") {
        return vertices(text).filter(|found| found.len() == 1).map(|found| Named::Vertices([found[0]; 3]));
    }
    if let Some(text) = name.strip_prefix("triangle:") {
        return vertices(text).and_then(|found| found.try_into().ok()).map(Named::Vertices);
    }
    let bone = |bone: &str| (!bone.is_empty()).then(|| bone.to_owned());
    match name.strip_suffix(":tail") {
        Some(name) => bone(name).map(Named::Tail),
        None => bone(name).map(Named::Head),
    }
}

fn three(text: &str) -> Option<Vec3> {
    let numbers: Option<Vec<f32>> = text.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers: [f32; 3] = numbers?.try_into().ok()?;
    Some(Vec3::from(numbers)).filter(|place| place.is_finite())
}

impl TargetArgs {
    /// What is to happen when, microseconds from the start, in time order.
    pub fn for_character(&self, character: &LoadedCharacter) -> Result<Vec<(u64, TargetChange)>, Failure> {
        let mut timetable = Vec::new();
        for wish in &self.targets {
            let target = wish.target(character)?;
            let micros = |seconds: f64| (seconds * 1e6).round() as u64;
            let over_micros = micros(wish.over) as u32;
            timetable.push((micros(wish.from), TargetChange::Set { target, over_micros }));
            if let Some(to) = wish.to {
                timetable.push((micros(to), TargetChange::Release { point: target.point, over_micros }));
            }
        }
        // One that ends where the next of the same point begins is let go first.
        let order = |(micros, change): &(u64, TargetChange)| (*micros, matches!(change, TargetChange::Set { .. }));
        timetable.sort_by_key(order);
        Ok(timetable)
    }
}

impl Wish {
    fn target(&self, character: &LoadedCharacter) -> Result<Target, Failure> {
        let skeleton = &character.skeleton;
        let bone = |name: &str| {
            skeleton.find(name).ok_or_else(|| {
                let names: Vec<&str> = skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
                let what = format!("--target {}: {} has no bone {name:?}", self.text, character.name);
                Failure::usage(what, format!("its bones are {}", names.join(", ")))
            })
        };
        let segments = skeleton.rest_segments();
        let (point, rest) = match &self.point {
            Named::Head(name) => (TargetPoint::Head(bone(name)?), segments[bone(name)?].0),
            Named::Tail(name) => (TargetPoint::Tail(bone(name)?), segments[bone(name)?].1),
            Named::Vertices(vertices) => {
                let positions = character.shape.as_ref().map_or(&[][..], |shape| &shape.positions);
                let places: Option<Vec<Vec3>> =
                    vertices.iter().map(|&v| positions.get(v as usize).copied().map(Vec3::from)).collect();
                let places = places.ok_or_else(|| {
                    let what = format!("--target {}: {} has no such vertex", self.text, character.name);
                    Failure::usage(what, format!("its {} vertices are numbered from 0", positions.len()))
                })?;
                let is_one = vertices[0] == vertices[1] && vertices[1] == vertices[2];
                let barycentric = if is_one { [1.0, 0.0, 0.0] } else { [1.0 / 3.0; 3] };
                let rest = places.iter().zip(barycentric).map(|(place, share)| *place * share).sum();
                (TargetPoint::Skin { vertices: *vertices, barycentric }, rest)
            }
        };
        let orientation = self.turn.map(|degrees| {
            let turn = Quat::from_scaled_axis(degrees * (std::f32::consts::PI / 180.0));
            let own = match point {
                TargetPoint::Head(bone) | TargetPoint::Tail(bone) => {
                    skeleton.rest_model_from_bone()[bone].to_scale_rotation_translation().1
                }
                TargetPoint::Skin { .. } => Quat::IDENTITY,
            };
            (turn * own).normalize()
        });
        let position = self.place.map(|place| if self.from_rest { rest + place } else { place });
        let target = Target { point, position, orientation, strength: self.strength };
        target.check(skeleton).map_err(|why| Failure::usage(format!("--target {}: {why}", self.text), ""))?;
        Ok(target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_of_targets() {
        let read = |text: &str| text.parse::<Wish>().unwrap();
        let hand = read("LeftHand@2s..4s=0.5,1.2,0.3");
        assert_eq!((hand.point, hand.from, hand.to), (Named::Head("LeftHand".into()), 2.0, Some(4.0)));
        assert_eq!((hand.place, hand.from_rest, hand.strength), (Some(Vec3::new(0.5, 1.2, 0.3)), false, 1.0));
        let tail = read("mixamorig:Head:tail=+0,-0.1,0:turn=0,30,0:strength=0.25:over=1");
        assert_eq!(tail.point, Named::Tail("mixamorig:Head".into()));
        assert_eq!((tail.place, tail.from_rest), (Some(Vec3::new(0.0, -0.1, 0.0)), true));
        assert_eq!((tail.turn, tail.strength, tail.over), (Some(Vec3::new(0.0, 30.0, 0.0)), 0.25, 1.0));
        assert_eq!(read("vertex:12@..3=1,2,3").point, Named::Vertices([12; 3]));
        assert_eq!((read("triangle:1,2,3@5..=1,2,3").from, read("Head=1,2,3").from), (5.0, 0.0));
        assert_eq!(read("Head=turn=0,30,0").place, None);
        for wrong in [
            "",
            "Head",
            "Head=",
            "=1,2,3",
            "Head=1,2",
            "Head=1,2,nan",
            "Head=1,2,3:strength=0",
            "Head=1,2,3:pull=1",
            "Head@4..2=1,2,3",
            "Head@x..=1,2,3",
            "vertex:x=1,2,3",
            "Head=1,2,3:over=-1",
            "Head=strength=1",
        ] {
            assert!(wrong.parse::<Wish>().is_err(), "{wrong}");
        }
    }
}
