//! Which bones carry a character, where the floor is, and where its skin could cross it.

use glam::Vec3;

use crate::recognise::{Figure, HumanoidPart, Recognition, recognise};
use crate::skeleton::Skeleton;

/// Ends of chains no higher above the lowest point than this share of the skeleton's height stand on the ground.
const ON_THE_GROUND: f32 = 0.1;
/// What a bone that is not a contact has within this share of the height above the floor at rest cannot block the way
/// down: the hem of a trouser, a bone that marks the ground.
const BESIDE_THE_FEET: f32 = 0.02;

/// How the roots follow the feet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GroundMode {
    /// On the spot: where a step has led away, the character glides back once all its feet are on the floor.
    Stand,
    /// Steps lead away.
    Walk,
}

/// What of a foot stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Footing {
    /// The lowest point of the one that carries; it turns about that point. So it was in the first takes with a floor.
    Point,
    /// Where it is and where it faces, as far as it lies on the floor. Where no joint turns any leg, all feet stay, and the
    /// legs bend.
    Sole,
}

/// A point of the skin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPoint {
    /// The bone it follows.
    pub bone: usize,
    /// In the bone's frame, the mesh's unit.
    pub at: Vec3,
}

/// How a character stands on the floor. Takes hold it, so that a replay needs the skeleton alone.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// How the roots follow.
    pub mode: GroundMode,
    /// What stays of the feet.
    pub footing: Footing,
    /// Whether something else places the roots, such as pinned bones: they are only lifted where something would be below
    /// the floor.
    pub is_held: bool,
    /// The floor's height, mesh units.
    pub floor: f32,
    /// The bones that may carry the character, each with everything below it.
    pub contacts: Vec<usize>,
    /// What must not cross the floor.
    pub points: Vec<GroundPoint>,
}

/// Why a character cannot stand.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GroundError {
    /// Nothing carries it.
    #[error("no bone was recognised as a foot, and none was named")]
    NoContacts,
    /// A bone that is not there.
    #[error("there is no bone {bone}; the skeleton has {count} bones")]
    NoBone {
        /// The index given.
        bone: usize,
        /// Bones of the skeleton.
        count: usize,
    },
    /// A contact without a point, or a number that is not finite.
    #[error("the bone {name:?} has no skin that could stand on the floor, or the floor's height is no number")]
    NoPlace {
        /// The bone.
        name: String,
    },
}

impl Ground {
    /// The bones that carry a skeleton: feet (of quadrupeds all four) where they are recognised, else the ends of chains
    /// that are near the lowest point in the rest pose. Empty if there are none.
    pub fn feet(skeleton: &Skeleton) -> Vec<usize> {
        let recognition = recognise(skeleton);
        let feet = recognised_feet(&recognition);
        if !feet.is_empty() || recognition.figure == Figure::Hand {
            return feet;
        }
        let segments = skeleton.rest_segments();
        let heights = || segments.iter().flat_map(|(head, tail)| [head.y, tail.y]);
        let (low, high) = (heights().fold(f32::INFINITY, f32::min), heights().fold(f32::NEG_INFINITY, f32::max));
        let ground = low + ON_THE_GROUND * (high - low);
        let mut is_end = vec![true; skeleton.len()];
        for parent in skeleton.bones().iter().filter_map(|bone| bone.parent) {
            is_end[parent] = false;
        }
        let stands = |bone: &usize| skeleton.bones()[*bone].parent.is_some() && segments[*bone].1.y <= ground;
        (0..skeleton.len()).filter(|&bone| is_end[bone]).filter(stands).collect()
    }

    /// By the skeleton alone: heads and tails of its bones, and the floor under those of the contacts.
    pub fn of_skeleton(skeleton: &Skeleton, mode: GroundMode, contacts: &[usize]) -> Result<Self, GroundError> {
        let segments = skeleton.rest_segments();
        let groups = groups(skeleton, contacts)?;
        let of_contacts = || segments.iter().zip(&groups).filter(|(_, group)| group.is_some());
        let floor = of_contacts().flat_map(|((head, tail), _)| [head.y, tail.y]).fold(f32::INFINITY, f32::min);
        let inverse: Vec<_> = skeleton.rest_model_from_bone().iter().map(glam::Affine3A::inverse).collect();
        let mut points = Vec::new();
        for (bone, (head, tail)) in segments.iter().enumerate() {
            for end in [*head, *tail] {
                points.push((bone, inverse[bone].transform_point3(end)));
                if groups[bone].is_some() {
                    points.push((bone, inverse[bone].transform_point3(Vec3::new(end.x, floor, end.z))));
                }
            }
        }
        Self::of_points(skeleton, mode, contacts, &points)
    }

    /// By points of the skin: `points` are bones and places in their frames. The floor is where the lowest point of the
    /// contacts is at rest; points of other bones that are no higher are left out.
    pub fn of_points(
        skeleton: &Skeleton,
        mode: GroundMode,
        contacts: &[usize],
        points: &[(usize, Vec3)],
    ) -> Result<Self, GroundError> {
        let groups = groups(skeleton, contacts)?;
        if let Some((bone, _)) = points.iter().find(|(bone, _)| *bone >= skeleton.len()) {
            return Err(GroundError::NoBone { bone: *bone, count: skeleton.len() });
        }
        let frames = skeleton.rest_model_from_bone();
        let height = |(bone, at): &(usize, Vec3)| frames[*bone].transform_point3(*at).y;
        let of_contacts = points.iter().filter(|(bone, _)| groups[*bone].is_some());
        let floor = of_contacts.map(height).fold(f32::INFINITY, f32::min);
        let highest = points.iter().map(height).fold(floor, f32::max);
        let above = floor + BESIDE_THE_FEET * (highest - floor);
        let counts = |point: &&(usize, Vec3)| groups[point.0].is_some() || height(point) > above;
        let points = points.iter().filter(counts).map(|&(bone, at)| GroundPoint { bone, at }).collect();
        let (footing, is_held) = (Footing::Sole, false);
        let ground = Self { mode, footing, is_held, floor, contacts: contacts.to_vec(), points };
        ground.check(skeleton)?;
        Ok(ground)
    }

    /// What of it is hardly meant, in a sentence: a floor above the middle of the skeleton at rest.
    pub fn doubt(&self, skeleton: &Skeleton) -> Option<String> {
        let segments = skeleton.rest_segments();
        let below = segments.iter().filter(|(head, tail)| head.y.max(tail.y) < self.floor).count();
        let contact = self.contacts.first().and_then(|&contact| skeleton.bones().get(contact))?;
        (2 * below > segments.len()).then(|| {
            format!(
                "the floor is under {:?}, and {below} of {} bones are below it at rest; name feet as contacts",
                contact.name,
                segments.len()
            )
        })
    }

    /// Whether it can be used with a skeleton.
    pub fn check(&self, skeleton: &Skeleton) -> Result<(), GroundError> {
        let groups = groups(skeleton, &self.contacts)?;
        if let Some(point) = self.points.iter().find(|point| point.bone >= skeleton.len()) {
            return Err(GroundError::NoBone { bone: point.bone, count: skeleton.len() });
        }
        let named = |bone: usize| GroundError::NoPlace { name: skeleton.bones()[bone].name.clone() };
        let has_point = |contact: usize| self.points.iter().any(|point| groups[point.bone] == Some(contact));
        // A contact below another one belongs to it.
        let is_own = |contact: usize| groups[self.contacts[contact]] == Some(contact);
        if let Some(contact) = (0..self.contacts.len()).find(|&contact| is_own(contact) && !has_point(contact)) {
            return Err(named(self.contacts[contact]));
        }
        match self.points.iter().find(|point| !(point.at.is_finite() && self.floor.is_finite())) {
            Some(point) => Err(named(point.bone)),
            None => Ok(()),
        }
    }
}

/// For every bone, the contact that it belongs to: toes to their foot.
pub(super) fn groups(skeleton: &Skeleton, contacts: &[usize]) -> Result<Vec<Option<usize>>, GroundError> {
    if contacts.is_empty() {
        return Err(GroundError::NoContacts);
    }
    if let Some(bone) = contacts.iter().find(|&&bone| bone >= skeleton.len()) {
        return Err(GroundError::NoBone { bone: *bone, count: skeleton.len() });
    }
    let mut groups: Vec<Option<usize>> = Vec::with_capacity(skeleton.len());
    for (index, bone) in skeleton.bones().iter().enumerate() {
        let above = bone.parent.and_then(|parent| groups[parent]);
        groups.push(above.or_else(|| contacts.iter().position(|&contact| contact == index)));
    }
    Ok(groups)
}

fn recognised_feet(recognition: &Recognition) -> Vec<usize> {
    let stands = |part: HumanoidPart| match recognition.figure {
        Figure::Quadruped => matches!(part, HumanoidPart::Foot | HumanoidPart::Hand),
        _ => part == HumanoidPart::Foot,
    };
    let bones = recognition.bones.iter().enumerate();
    bones.filter(|(_, found)| found.is_some_and(|found| stands(found.bone.part))).map(|(bone, _)| bone).collect()
}
