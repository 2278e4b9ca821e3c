//! What a skeleton is as a whole, and each of its bones.

use std::fmt;

use super::body_plan::{BoneTraits, body_plan};
use super::fingers::{below, fingers};
use super::humanoid::{Evidence, HumanoidBone, HumanoidPart, Side};
use super::limbs::{Found, Limb, named_limb, shaped_limb};
use super::names::{Named, Reading, readings};
use super::trunk::trunk;
use crate::skeleton::Skeleton;

/// What a skeleton is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// Two legs, two arms and a trunk that stands.
    Human,
    /// Four legs and a trunk that lies; the front legs are recognised as arms.
    Quadruped,
    /// A hand by itself.
    Hand,
    /// None of these.
    Other,
}

impl fmt::Display for Figure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Human => "human",
            Self::Quadruped => "quadruped",
            Self::Hand => "hand",
            Self::Other => "other",
        })
    }
}

/// A bone that was recognised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecognisedBone {
    /// What it is.
    pub bone: HumanoidBone,
    /// What it was recognised by.
    pub evidence: Evidence,
    /// How sure that is, 0 to 1.
    pub confidence: f32,
}

/// What was recognised.
#[derive(Clone, Debug, PartialEq)]
pub struct Recognition {
    /// What the skeleton is.
    pub figure: Figure,
    /// What each bone is, in the skeleton's order. No two are the same.
    pub bones: Vec<Option<RecognisedBone>>,
}

impl Recognition {
    /// The index of the bone that is this one.
    pub fn find(&self, bone: HumanoidBone) -> Option<usize> {
        self.bones.iter().position(|found| found.is_some_and(|found| found.bone == bone))
    }

    /// How many bones were recognised.
    pub fn count(&self) -> usize {
        self.bones.iter().flatten().count()
    }
}

/// Names the bones that humanoids have in common, whoever made the rig and whatever it calls them; quadrupeds and hands by
/// the same names. Left and right are taken from names, else from the shape: the character looks along +Z, its left is
/// +X.
///
/// ```
/// use armature_rig::{Bone, Skeleton, Transform, recognise};
///
/// let bone = |name: &str, parent, at: [f32; 3], tail: [f32; 3]| Bone {
///     name: name.into(),
///     parent,
///     rest: Transform { translation: at.into(), ..Transform::IDENTITY },
///     tail: tail.into(),
/// };
/// let down = [0.0, -0.4, 0.0];
/// let skeleton = Skeleton::new(vec![
///     bone("thigh_l", None, [0.1, 0.9, 0.0], down),
///     bone("calf_l", Some(0), down, down),
///     bone("foot_l", Some(1), down, [0.0, 0.0, 0.1]),
/// ])?;
/// let names: Vec<_> = recognise(&skeleton).bones.iter().flatten().map(|found| found.bone.to_string()).collect();
/// assert_eq!(names, ["leftUpperLeg", "leftLowerLeg", "leftFoot"]);
/// # Ok::<(), armature_rig::SkeletonError>(())
/// ```
pub fn recognise(skeleton: &Skeleton) -> Recognition {
    recognise_by(skeleton, &body_plan(skeleton))
}

/// [`recognise`] where the shape is known already.
pub(crate) fn recognise_by(skeleton: &Skeleton, traits: &[BoneTraits]) -> Recognition {
    let readings = readings(skeleton);
    let sides = sides(skeleton, &readings, traits);
    let mut found = Taken { bones: vec![None; skeleton.len()] };
    let mut begin = [Vec::new(), Vec::new()];
    for (at, limb) in [Limb::Leg, Limb::Arm].into_iter().enumerate() {
        let named = [Side::Left, Side::Right].map(|side| (side, named_limb(skeleton, &readings, &sides, limb, side)));
        let is_named = named.iter().any(|(_, found)| !found.is_empty());
        let limbs = if is_named { named } else { shaped_limbs(skeleton, &readings, traits, limb) };
        for (side, bones) in limbs {
            begin[at].extend(bones.first().map(|(bone, ..)| *bone));
            let hand = bones.iter().find(|(_, part, ..)| *part == HumanoidPart::Hand).map(|(bone, ..)| *bone);
            found.take(&bones, Some(side));
            if let Some(hand) = hand {
                found.take(&fingers(skeleton, &readings, traits, hand), Some(side));
            }
        }
    }
    let [legs, arms] = begin;
    let is_lone_hand = legs.is_empty() && !found.has(HumanoidPart::LowerArm);
    if is_lone_hand && let Some(figure) = lone_hand(skeleton, &readings, traits, &sides, &mut found) {
        return Recognition { figure, bones: found.bones };
    }
    if !legs.is_empty() || !arms.is_empty() {
        found.take(&trunk(skeleton, &readings, traits, &legs, &arms), None);
        found.take_face(skeleton, &readings, &sides);
    }
    let figure = figure(&found, traits);
    Recognition { figure, bones: found.bones }
}

struct Taken {
    bones: Vec<Option<RecognisedBone>>,
}

impl Taken {
    /// What comes first stays.
    fn take(&mut self, bones: &[Found], side: Option<Side>) {
        for &(index, part, evidence, confidence) in bones {
            let bone = HumanoidBone { part, side };
            if self.bones[index].is_none() && !self.bones.iter().flatten().any(|own| own.bone == bone) {
                self.bones[index] = Some(RecognisedBone { bone, evidence, confidence });
            }
        }
    }

    /// Eyes and jaw, by their names.
    fn take_face(&mut self, skeleton: &Skeleton, readings: &[Reading], sides: &[Option<Side>]) {
        let head = self.bones.iter().position(|own| own.is_some_and(|own| own.bone.part == HumanoidPart::Head));
        for bone in head.into_iter().flat_map(|head| below(skeleton, head)) {
            let named = readings[bone].candidates.first().map(|(named, _)| *named);
            let (part, side) = match named {
                Some(Named::Eye) if sides[bone].is_some() => (HumanoidPart::Eye, sides[bone]),
                Some(Named::Jaw) => (HumanoidPart::Jaw, None),
                _ => continue,
            };
            if !readings[bone].is_helper {
                self.take(&[(bone, part, Evidence::Name, 0.9)], side);
            }
        }
    }

    fn has(&self, part: HumanoidPart) -> bool {
        self.bones.iter().flatten().any(|own| own.bone.part == part)
    }

    fn both(&self, part: HumanoidPart) -> Option<[usize; 2]> {
        let of =
            |side| self.bones.iter().position(|own| own.is_some_and(|own| own.bone == HumanoidBone { part, side }));
        Some([of(Some(Side::Left))?, of(Some(Side::Right))?])
    }
}

/// The side of each bone: what its name says, else its parent's; by the shape, if no name says any.
fn sides(skeleton: &Skeleton, readings: &[Reading], traits: &[BoneTraits]) -> Vec<Option<Side>> {
    let is_named = readings.iter().any(|reading| reading.side.is_some());
    let mut sides: Vec<Option<Side>> = Vec::with_capacity(skeleton.len());
    for (bone, reading) in readings.iter().enumerate() {
        let above = skeleton.bones()[bone].parent.and_then(|parent| sides[parent]);
        let own = if is_named { reading.side } else { traits[bone].side };
        sides.push(own.or(above));
    }
    sides
}

/// Pairs of limbs that face each other: arms nearer to the head, legs the others.
fn shaped_limbs(
    skeleton: &Skeleton,
    readings: &[Reading],
    traits: &[BoneTraits],
    limb: Limb,
) -> [(Side, Vec<Found>); 2] {
    // Names that say nothing of limbs may still say that a bone is none.
    let says_other = |bone: usize| readings[bone].is_helper || !readings[bone].candidates.is_empty();
    let begins = |bone: usize| {
        let own = &traits[bone];
        let on_trunk = skeleton.bones()[bone].parent.is_none_or(|parent| traits[parent].side.is_none());
        on_trunk && own.mirror.is_some() && !own.appendage && own.arm == (limb == Limb::Arm) && !says_other(bone)
    };
    let reach = |bone: usize| {
        let ends = std::iter::once(bone).chain(below(skeleton, bone));
        ends.map(|end| traits[end].tip.distance(traits[bone].head)).fold(0.0, f32::max)
    };
    [Side::Left, Side::Right].map(|side| {
        let firsts = (0..skeleton.len()).filter(|&bone| begins(bone) && traits[bone].side == Some(side));
        let longest = firsts.max_by(|&a, &b| reach(a).total_cmp(&reach(b)));
        (side, longest.map_or_else(Vec::new, |first| shaped_limb(skeleton, traits, limb, first)))
    })
}

/// A skeleton that is all hand: its fingers begin at the root or at a wrist.
fn lone_hand(
    skeleton: &Skeleton,
    readings: &[Reading],
    traits: &[BoneTraits],
    sides: &[Option<Side>],
    found: &mut Taken,
) -> Option<Figure> {
    const LEAST_FINGERS: usize = 3;
    let is_finger =
        |bone: &usize| readings[*bone].candidates.iter().any(|(named, _)| matches!(named, Named::Finger(_)));
    let firsts = (0..skeleton.len()).filter(is_finger).filter(|&bone| {
        let parent = skeleton.bones()[bone].parent;
        parent.is_none_or(|parent| !is_finger(&parent))
    });
    let firsts: Vec<usize> = firsts.collect();
    let hand = (0..skeleton.len()).find(|&bone| {
        readings[bone].candidates.first().is_some_and(|(named, _)| *named == Named::Hand)
            || firsts.iter().filter(|&&first| skeleton.bones()[first].parent == Some(bone)).count() >= LEAST_FINGERS
    })?;
    if firsts.len() < LEAST_FINGERS {
        return None;
    }
    let side = sides.iter().flatten().next().copied().or(Some(Side::Left));
    found.take(&[(hand, HumanoidPart::Hand, Evidence::NameAndPlace, 0.8)], side);
    found.take(&fingers(skeleton, readings, traits, hand), side);
    Some(Figure::Hand)
}

fn figure(found: &Taken, traits: &[BoneTraits]) -> Figure {
    let (legs, arms) = (found.both(HumanoidPart::UpperLeg), found.both(HumanoidPart::UpperArm));
    let (Some(legs), Some(arms)) = (legs, arms) else { return Figure::Other };
    let middle = |pair: [usize; 2]| 0.5 * (traits[pair[0]].head + traits[pair[1]].head);
    let way = middle(arms) - middle(legs);
    if way.z.abs() > way.y.abs() { Figure::Quadruped } else { Figure::Human }
}
