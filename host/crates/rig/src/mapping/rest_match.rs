//! The puppet is zeroed in its own rest pose, and the character rests in another: arms up, an A, a T, sitting.

use glam::{DQuat, DVec3, Vec3};

use super::entries::Mapping;
use super::hints::PuppetHints;
use super::limb_directions::{RestPose, limb_end, trunk};
use super::rest_turn::RestTurn;
use crate::puppet::JointTree;
use crate::recognise::{Figure, recognise};
use crate::skeleton::Skeleton;

/// Limbs that differ by less are left as they are: exporters' T-poses are not that exact. Degrees.
pub const LEAST_REST_TURN: f64 = 10.0;
/// Trunks that differ by more are those of different kinds of body, and their limbs have nothing in common. Degrees.
const OTHER_BODY: f64 = 60.0;
/// Nearer than this to the opposite direction, the shortest way round is chance. Degrees.
const OPPOSITE: f64 = 179.0;
/// Turns are whole multiples of this, so that files show them as they are used. Degrees.
const STEP: f64 = 1e-3;

/// What brings a character's rest pose to the puppet's.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RestMatch {
    /// Parents before children. Empty where the two are alike, or where nothing is known.
    pub turns: Vec<RestTurn>,
    /// Why nothing was done, if something might have been expected.
    pub note: Option<String>,
}

/// Proposes how the bones that `mapping` drives are turned so that the character's limbs point where the puppet's do when
/// it is zeroed ([`PuppetHints::rest`]). Nothing is proposed for a character of another kind of body: a quadruped's front
/// legs are no arms held out.
///
/// ```
/// use armature_rig::{Bone, JointTree, MappingEntry, Mapping, Part, PartKind, PartUid, PuppetHints, Skeleton, Transform};
/// use armature_rig::match_rest;
/// use glam::Vec3;
///
/// // An arm that hangs, and a joint that holds it out to the left when it is zeroed.
/// let arm = Bone { name: "arm".into(), parent: None, rest: Transform::IDENTITY, tail: Vec3::NEG_Y };
/// let skeleton = Skeleton::new(vec![arm])?;
/// let uid = PartUid([1; 12]);
/// let part = Part { uid, kind: PartKind::TwistBendTwist, parent: None, outlet: 0, counts_per_turn: 4096 };
/// let tree = JointTree::new(vec![part])?;
/// let mut mapping = Mapping { entries: vec![MappingEntry::new(uid, "arm")], ..Mapping::default() };
/// let hints = PuppetHints { rest: [(uid, Vec3::X)].into(), ..PuppetHints::default() };
/// mapping.rest = match_rest(&tree, &mapping, &skeleton, &hints).turns;
/// assert_eq!(mapping.rest[0].degrees, Vec3::new(0.0, 0.0, 90.0));
/// assert!(mapping.rested(&skeleton)?.rest_segments()[0].1.distance(Vec3::X) < 1e-6);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn match_rest(tree: &JointTree, mapping: &Mapping, skeleton: &Skeleton, hints: &PuppetHints) -> RestMatch {
    if hints.rest.is_empty() {
        return RestMatch::default();
    }
    let bone_of = |part: usize| {
        let uid = tree.parts()[part].uid;
        let entry = mapping.entries.iter().find(|entry| entry.part == uid);
        entry.and_then(|entry| skeleton.find(&entry.bone))
    };
    let bone_of_part: Vec<Option<usize>> = (0..tree.parts().len()).map(bone_of).collect();
    let heads = skeleton.rest_segments();
    let mut wanted: Vec<Option<Limb>> = vec![None; skeleton.len()];
    for (part, bone) in bone_of_part.iter().enumerate() {
        let Some(bone) = *bone else { continue };
        let direction = hints.rest.get(&tree.parts()[part].uid).and_then(|direction| direction.try_normalize());
        let Some(direction) = direction.filter(|_| wanted[bone].is_none()) else { continue };
        // The limb ends where the bone of the next joint below begins.
        let below = (part + 1..bone_of_part.len()).filter(|&other| is_below(tree, other, part));
        let mut next = below.filter_map(|other| bone_of_part[other]).filter(|&next| next != bone);
        let end = next.next().map_or_else(|| heads[bone].1, |next| heads[next].0);
        wanted[bone] = Limb::new(end - heads[bone].0, direction);
    }
    match_to(skeleton, hints.trunk, &wanted, LEAST_REST_TURN)
}

/// [`match_rest`] for a puppet of which only the pose is known in which it is zeroed: what the character's bones are is
/// taken from the skeleton itself ([`recognise`]). `driven`: which of them a joint drives.
pub fn match_rest_pose(pose: RestPose, skeleton: &Skeleton, driven: &dyn Fn(usize) -> bool) -> RestMatch {
    match_pose(pose, skeleton, driven, LEAST_REST_TURN)
}

/// The skeleton with its arms and legs brought to a pose, however small the difference is: another rest pose for the same
/// bones. What cannot be recognised is named in the error.
///
/// ```
/// use armature_rig::{Bone, RestPose, Skeleton, Transform, rest_in};
/// use glam::Vec3;
///
/// let bone = |name: &str, parent, at: [f32; 3], tail: [f32; 3]| Bone {
///     name: name.into(),
///     parent,
///     rest: Transform { translation: at.into(), ..Transform::IDENTITY },
///     tail: tail.into(),
/// };
/// // An arm that hangs a little away from the body.
/// let down = [0.1, -0.3, 0.0];
/// let hanging = Skeleton::new(vec![
///     bone("spine", None, [0.0, 1.0, 0.0], [0.0, 0.5, 0.0]),
///     bone("upper_arm_l", Some(0), [0.2, 0.4, 0.0], down),
///     bone("forearm_l", Some(1), down, down),
///     bone("hand_l", Some(2), down, [0.0, -0.1, 0.0]),
/// ])?;
/// let held_out = rest_in(RestPose::T, &hanging)?.rest_segments();
/// assert!((held_out[3].0 - held_out[1].0).normalize().distance(Vec3::X) < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn rest_in(pose: RestPose, skeleton: &Skeleton) -> Result<Skeleton, String> {
    let found = match_pose(pose, skeleton, &|_| true, 0.0);
    if let Some(note) = found.note {
        return Err(note);
    }
    Mapping { rest: found.turns, ..Mapping::default() }.rested(skeleton).map_err(|error| error.to_string())
}

fn match_pose(pose: RestPose, skeleton: &Skeleton, driven: &dyn Fn(usize) -> bool, least: f64) -> RestMatch {
    let recognition = recognise(skeleton);
    let heads = skeleton.rest_segments();
    let limb = |(index, found): (usize, &Option<crate::recognise::RecognisedBone>)| {
        let bone = found.filter(|_| driven(index))?.bone;
        Limb::new(limb_end(&recognition, &heads, index, bone) - heads[index].0, pose.direction(bone)?)
    };
    let wanted: Vec<Option<Limb>> = recognition.bones.iter().enumerate().map(limb).collect();
    if wanted.iter().all(Option::is_none) {
        let note = "no arm or leg of the character was recognised".to_owned();
        return RestMatch { turns: Vec::new(), note: Some(note) };
    }
    match_to(skeleton, Some(Vec3::Y), &wanted, least)
}

/// Where a limb points and where it should.
#[derive(Clone, Copy)]
struct Limb {
    own: DVec3,
    puppet: DVec3,
}

impl Limb {
    fn new(own: Vec3, puppet: Vec3) -> Option<Self> {
        let puppet = puppet.as_dvec3().try_normalize()?;
        Some(Self { own: own.as_dvec3().try_normalize()?, puppet })
    }
}

fn is_below(tree: &JointTree, part: usize, above: usize) -> bool {
    std::iter::successors(tree.parts()[part].parent, |&parent| tree.parts()[parent].parent).any(|own| own == above)
}

/// `least`: limbs that differ by fewer degrees are left as they are.
fn match_to(skeleton: &Skeleton, puppet_trunk: Option<Vec3>, wanted: &[Option<Limb>], least: f64) -> RestMatch {
    let recognition = recognise(skeleton);
    let own_trunk = match recognition.figure {
        Figure::Quadruped | Figure::Human => trunk(&recognition, &skeleton.rest_segments()),
        Figure::Hand | Figure::Other => None,
    };
    if let Some((own, puppet)) = own_trunk.zip(puppet_trunk) {
        let apart = own.as_dvec3().angle_between(puppet.as_dvec3()).to_degrees();
        if apart > OTHER_BODY {
            let note = "the character's trunk lies otherwise than the puppet's, so its limbs keep their rest pose";
            return RestMatch { turns: Vec::new(), note: Some(note.to_owned()) };
        }
    }
    let mut turns = Vec::new();
    let mut turned: Vec<DQuat> = Vec::with_capacity(skeleton.len());
    for (bone, limb) in skeleton.bones().iter().zip(wanted) {
        let above = bone.parent.map_or(DQuat::IDENTITY, |parent| turned[parent]);
        let vector = limb.map(|limb| shortest_turn(above * limb.own, limb.puppet));
        let Some(vector) = vector.filter(|vector| vector.length() > 0.0 && vector.length() >= least) else {
            turned.push(above);
            continue;
        };
        let rounded = vector.to_array().map(|c| (libm::round(c / STEP) * STEP) as f32 + 0.0);
        let turn = RestTurn { bone: bone.name.clone(), degrees: Vec3::from(rounded) };
        turned.push(turn.rotation().map_or(above, |turn| (turn.as_dquat() * above).normalize()));
        turns.push(turn);
    }
    RestMatch { turns, note: None }
}

/// The axis times the angle in degrees that takes one direction to another the shortest way; half a turn goes through
/// the side, not through the body or the face.
fn shortest_turn(from: DVec3, to: DVec3) -> DVec3 {
    let across = from.cross(to);
    let angle = libm::atan2(across.length(), from.dot(to)).to_degrees();
    let axis = if angle < OPPOSITE {
        across.try_normalize().unwrap_or(DVec3::Z)
    } else {
        let about = if from.z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
        (about - about.dot(from) * from).normalize()
    };
    axis * angle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::MappingError;
    use crate::skeleton::Bone;

    #[test]
    fn the_shortest_turn_arrives() {
        let ways = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z, DVec3::new(0.6, 0.0, 0.8)];
        for from in ways {
            for to in ways {
                let vector = shortest_turn(from, to);
                let turn = RestTurn { bone: String::new(), degrees: vector.as_vec3() };
                let arrived = turn.rotation().unwrap().as_dquat() * from;
                assert!(arrived.distance(to) < 1e-5, "{from} to {to}: {vector} gives {arrived}");
            }
        }
        assert_eq!(shortest_turn(DVec3::Y, DVec3::NEG_Y).abs(), 180.0 * DVec3::Z, "through the side");
        assert_eq!(RestTurn { bone: String::new(), degrees: Vec3::NAN }.rotation(), None);
    }

    #[test]
    fn turns_that_cannot_be_used_are_named() {
        let bone = |name: &str, parent| Bone {
            name: name.into(),
            parent,
            rest: crate::skeleton::Transform::IDENTITY,
            tail: Vec3::Y,
        };
        let skeleton = Skeleton::new(vec![bone("upper", None), bone("lower", Some(0))]).unwrap();
        let rested = |turns: &[(&str, f32)]| {
            let turn = |(bone, degrees): &(&str, f32)| RestTurn { bone: (*bone).into(), degrees: *degrees * Vec3::Z };
            Mapping { rest: turns.iter().map(turn).collect(), ..Mapping::default() }.rested(&skeleton)
        };
        assert_eq!(rested(&[]).unwrap(), skeleton);
        assert!(matches!(rested(&[("none", 1.0)]), Err(MappingError::UnknownRestBone { .. })));
        for bad in [&[("upper", f32::NAN)][..], &[("upper", f32::INFINITY)], &[("upper", 1.0), ("upper", 2.0)]] {
            assert!(matches!(rested(bad), Err(MappingError::BadRestTurn { .. })), "{bad:?}");
        }
        // The lower bone turns in the model's frame after the upper one has taken it along.
        let segments = rested(&[("upper", 90.0), ("lower", -90.0)]).unwrap().rest_segments();
        assert!(segments[0].1.distance(Vec3::NEG_X) < 1e-6, "{segments:?}");
        assert!((segments[1].1 - segments[1].0).distance(Vec3::Y) < 1e-6, "{segments:?}");
    }
}
