//! From a pose, which turns bones rigidly, to bones that stretch and twist along their length (thesis section 6.2).
//!
//! A joint that turns a bone against its parent about the bone's own axis twists the skin. A rigid bone puts all of
//! that twist next to the joint; here it is taken up along a whole bone. Which one, depends on the joint:
//!
//! - A limb's bone (upper arm, forearm, thigh) takes up its own twist: its start stays with its parent, its end turns
//!   (`θ_a = −twist`). So a forearm that is twisted at the elbow, which is a hinge, spreads the twist down to the wrist.
//! - A bone that must stay rigid because it carries several others (a palm, a chest), ends the limb (a head) or stands
//!   across it (a foot) twists the end of its parent (`θ_b = twist`), so that a turned hand twists the forearm.
//!
//! Either way the skin has no jump at the joint. A bone stretches where the bone that continues it starts farther away
//! than at rest, or nearer.

use armature_deform::skin::{SkinError, StretchTwist};
use armature_rig::Skeleton;
use glam::{Affine3A, DAffine3, DQuat, DVec3};

/// A bone continues another if it starts within this part of the other's length from its tail.
const AT_TAIL: f64 = 0.1;
/// A bone across its parent makes at least this angle with it: cos 45°.
const ACROSS: f64 = 0.707;
/// Smaller twists (radians) and stretches (parts of the length) are rounding.
const ROUNDING: f64 = 1e-5;
/// A bone is never squeezed to less than this part of its length.
const LEAST_LENGTH: f64 = 0.01;
/// A twist beyond half a turn goes on if it was nearly there a frame ago, up to this angle to either side.
const MOST_TWIST: f64 = 1.5 * std::f64::consts::PI;
/// How far a twist may have gone between two frames to be the same motion, radians.
const ONE_MOTION: f64 = 1.0;

/// What takes up the twist of the joint at a bone's head.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TakenUp {
    Nowhere,
    /// Along the bone itself, from its start.
    OwnStart,
    /// Along the parent, up to its end.
    ParentEnd,
}

#[derive(Clone, Debug)]
struct TwistingBone {
    parent: Option<usize>,
    /// Rotation from the bone's frame at rest to model space, inverted.
    rest_inverse: DQuat,
    /// From head to tail in model space at rest.
    along: DVec3,
    /// The bone that continues it, and where that one's head is at rest, in this bone's frame.
    continued: Option<(usize, DVec3)>,
    taken_up: TakenUp,
    /// Unit, in model space at rest; what `taken_up` twists about.
    twist_axis: DVec3,
}

/// A bone in a pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PosedBone {
    /// Where its head is, model space.
    pub start: DVec3,
    /// Its rotation in model space. Along a stretched bone it points to the bone that continues it.
    pub rotation: DQuat,
    /// Its length over that at rest.
    pub stretch: f64,
    /// Twists about it at its head and tail, radians, on top of `rotation`.
    pub twist: [f64; 2],
}

impl PosedBone {
    /// The same for skinning, of a bone that had this rotation, inverted, when the mesh was bound.
    pub fn since(&self, bound_inverse: DQuat) -> StretchTwist {
        StretchTwist {
            start: self.start.as_vec3(),
            turn: (self.rotation * bound_inverse).as_quat(),
            stretch: self.stretch as f32,
            twist: self.twist.map(|angle| angle as f32),
        }
    }
}

/// The bones of a skeleton, prepared for finding how they stretch and twist in each pose.
#[derive(Clone, Debug)]
pub struct TwistingBones {
    bones: Vec<TwistingBone>,
    /// The rotation of each bone in the latest pose, model space.
    rotations: Vec<DQuat>,
    /// The twist of each joint in the latest pose.
    twists: Vec<f64>,
    posed: Vec<PosedBone>,
}

impl TwistingBones {
    /// Takes a skeleton at rest.
    pub fn new(skeleton: &Skeleton) -> Self {
        let frames: Vec<DAffine3> = skeleton.rest_model_from_bone().iter().map(widened).collect();
        let ends: Vec<[DVec3; 2]> =
            skeleton.rest_segments().into_iter().map(|(head, tail)| [head.as_dvec3(), tail.as_dvec3()]).collect();
        let along = |bone: usize| ends[bone][1] - ends[bone][0];
        let continues = |bone: usize, parent: usize| {
            let length = along(parent).length();
            length > 0.0 && ends[bone][0].distance(ends[parent][1]) <= AT_TAIL * length
        };
        let bone = |(bone, of): (usize, &armature_rig::Bone)| {
            let mut continued: Option<(usize, f64)> = None;
            for child in skeleton.children(bone).filter(|&child| continues(child, bone)) {
                let apart = ends[child][0].distance(ends[bone][1]);
                if continued.is_none_or(|(_, least)| apart < least) {
                    continued = Some((child, apart));
                }
            }
            let rest = frames[bone];
            let inverse = rest.inverse();
            let is_rigid = carried(skeleton, &ends, bone) != 1;
            let own = along(bone).normalize_or_zero();
            let (taken_up, twist_axis) = match of.parent {
                Some(parent) if continues(bone, parent) => {
                    let axis = along(parent).normalize_or_zero();
                    let is_across = own.dot(axis) < ACROSS;
                    if is_rigid || is_across { (TakenUp::ParentEnd, axis) } else { (TakenUp::OwnStart, own) }
                }
                Some(_) if !is_rigid => (TakenUp::OwnStart, own),
                _ => (TakenUp::Nowhere, DVec3::ZERO),
            };
            TwistingBone {
                parent: of.parent,
                rest_inverse: rotation_of(&rest).unwrap_or(DQuat::IDENTITY).inverse(),
                along: along(bone),
                continued: continued.map(|(child, _)| (child, inverse.transform_point3(ends[child][0]))),
                taken_up: if twist_axis == DVec3::ZERO { TakenUp::Nowhere } else { taken_up },
                twist_axis,
            }
        };
        let mut bones: Vec<TwistingBone> = skeleton.bones().iter().enumerate().map(bone).collect();
        // Of several bones at one end, one twists it.
        for bone in 0..bones.len() {
            let continues = |parent: usize| bones[parent].continued.is_some_and(|(child, _)| child == bone);
            if bones[bone].taken_up == TakenUp::ParentEnd && !bones[bone].parent.is_some_and(continues) {
                bones[bone].taken_up = TakenUp::Nowhere;
            }
        }
        let still = PosedBone { start: DVec3::ZERO, rotation: DQuat::IDENTITY, stretch: 1.0, twist: [0.0; 2] };
        Self {
            rotations: vec![DQuat::IDENTITY; bones.len()],
            twists: vec![0.0; bones.len()],
            posed: vec![still; bones.len()],
            bones,
        }
    }

    /// Finds how each bone stretches and twists. `model_from_bone`: one frame per bone. Allocates nothing.
    ///
    /// A pose says a twist only up to whole turns; one that grows from pose to pose is followed beyond half a turn, up
    /// to three quarters.
    pub fn solve(&mut self, model_from_bone: &[Affine3A]) -> Result<&[PosedBone], SkinError> {
        let (got, expected) = (model_from_bone.len(), self.bones.len());
        if got != expected {
            return Err(SkinError::Length { what: "posed bones", got, expected });
        }
        for (bone, (frame, of)) in model_from_bone.iter().zip(&self.bones).enumerate() {
            if !frame.is_finite() {
                return Err(SkinError::PoseNotFinite { bone });
            }
            // A bone without a size has no rotation of its own.
            self.rotations[bone] = rotation_of(&widened(frame)).unwrap_or(of.rest_inverse.inverse());
            self.posed[bone] = PosedBone {
                start: frame.translation.as_dvec3(),
                rotation: self.rotations[bone],
                stretch: 1.0,
                twist: [0.0; 2],
            };
        }
        for (bone, of) in self.bones.iter().enumerate() {
            if let Some((child, at_rest)) = of.continued {
                let gone = widened(&model_from_bone[bone]).transform_point3(at_rest);
                let moved = model_from_bone[child].translation.as_dvec3() - gone;
                stretch(&mut self.posed[bone], of, moved);
            }
            let (Some(parent), true) = (of.parent, of.taken_up != TakenUp::Nowhere) else { continue };
            let since_rest = |bone: usize| self.rotations[bone] * self.bones[bone].rest_inverse;
            let twist = twist_about(since_rest(parent).inverse() * since_rest(bone), of.twist_axis);
            let twist = followed(twist, self.twists[bone]);
            self.twists[bone] = twist;
            if twist.abs() < ROUNDING {
                continue;
            }
            match of.taken_up {
                TakenUp::OwnStart => self.posed[bone].twist[0] = -twist,
                TakenUp::ParentEnd => self.posed[parent].twist[1] = twist,
                TakenUp::Nowhere => {}
            }
        }
        Ok(&self.posed)
    }

    /// Bones whose skin can twist: those that take up the twist of a joint.
    pub fn twistable(&self) -> Vec<usize> {
        let taker = |(bone, of): (usize, &TwistingBone)| match of.taken_up {
            TakenUp::OwnStart => Some(bone),
            TakenUp::ParentEnd => of.parent,
            TakenUp::Nowhere => None,
        };
        let mut all: Vec<usize> = self.bones.iter().enumerate().filter_map(taker).collect();
        all.sort_unstable();
        all.dedup();
        all
    }
}

/// How many bones a bone carries further; those that only help to spread a twist, without children along its length, do not
/// count.
fn carried(skeleton: &Skeleton, ends: &[[DVec3; 2]], bone: usize) -> usize {
    let [head, tail] = ends[bone];
    let along = tail - head;
    let helps = |child: &usize| {
        let at = ends[*child][0] - head;
        let share = at.dot(along) / along.length_squared();
        let aside = at - along * share;
        (0.0..1.0 - AT_TAIL).contains(&share)
            && aside.length() < AT_TAIL * along.length()
            && skeleton.children(*child).next().is_none()
    };
    skeleton.children(bone).filter(|child| !helps(child)).count()
}

/// Lengthens a bone so that its end moves with the bone that continues it, and turns it there.
fn stretch(posed: &mut PosedBone, of: &TwistingBone, moved: DVec3) {
    let length = of.along.length();
    if !(moved.length() > ROUNDING * length && moved.is_finite()) {
        return;
    }
    let before = posed.rotation * (of.rest_inverse * of.along);
    let now = before + moved;
    posed.stretch = (now.length() / length).max(LEAST_LENGTH);
    if now.length() > LEAST_LENGTH * length {
        posed.rotation = DQuat::from_rotation_arc(before.normalize(), now.normalize()) * posed.rotation;
    }
}

/// The angle by which a rotation turns about a unit axis, −π to π; 0 for half a turn about an axis across it.
fn twist_about(rotation: DQuat, axis: DVec3) -> f64 {
    let about = rotation.xyz().dot(axis);
    let (sine, cosine) = if rotation.w < 0.0 { (-about, -rotation.w) } else { (about, rotation.w) };
    if sine.abs() + cosine < 1e-9 { 0.0 } else { 2.0 * libm::atan2(sine, cosine) }
}

/// The same twist, a whole turn on if that continues the one before.
fn followed(twist: f64, before: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let nearest = twist + turn * ((before - twist) / turn).round();
    if (nearest - before).abs() <= ONE_MOTION && nearest.abs() <= MOST_TWIST { nearest } else { twist }
}

fn widened(frame: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: frame.matrix3.as_dmat3(), translation: frame.translation.as_dvec3() }
}

fn rotation_of(frame: &DAffine3) -> Option<DQuat> {
    let (_, rotation, _) = frame.to_scale_rotation_translation();
    (rotation.is_finite() && (rotation.length() - 1.0).abs() < 0.1).then(|| rotation.normalize())
}

#[cfg(test)]
mod tests {
    use armature_rig::{Bone, Pose, Transform};
    use glam::{Quat, Vec3};

    use super::*;

    /// An arm along +X with a hand of two fingers, and a foot across its end.
    fn arm() -> Skeleton {
        let bone = |name: &str, parent, at: Vec3, tail: Vec3| Bone {
            name: name.into(),
            parent,
            rest: Transform { translation: at, ..Transform::IDENTITY },
            tail,
        };
        let bones = vec![
            bone("shoulder", None, Vec3::ZERO, Vec3::Y),
            bone("upper", Some(0), Vec3::ZERO, 3.0 * Vec3::X),
            bone("lower", Some(1), 3.0 * Vec3::X, 2.0 * Vec3::X),
            bone("helper", Some(2), Vec3::X, Vec3::X),
            bone("hand", Some(2), 2.0 * Vec3::X, Vec3::X),
            bone("index", Some(4), Vec3::new(1.0, 0.0, 0.3), Vec3::X),
            bone("ring", Some(4), Vec3::new(1.0, 0.0, -0.3), Vec3::X),
        ];
        Skeleton::new(bones).unwrap()
    }

    fn posed(bones: &mut TwistingBones, skeleton: &Skeleton, pose: &Pose) -> Vec<PosedBone> {
        let mut frames = skeleton.rest_model_from_bone();
        pose.forward_kinematics(skeleton, &mut frames);
        bones.solve(&frames).unwrap().to_vec()
    }

    #[test]
    fn a_hand_and_a_forearm_twist_the_forearm() {
        let skeleton = arm();
        let mut bones = TwistingBones::new(&skeleton);
        for (name, expected) in [("lower", [-1.0, 0.0]), ("hand", [0.0, 1.0])] {
            let mut pose = skeleton.rest_pose();
            let bone = skeleton.find(name).unwrap();
            // Bent as well as twisted.
            pose.parent_from_bone[bone].rotation = Quat::from_rotation_z(0.8) * Quat::from_rotation_x(1.0);
            for (other, of) in posed(&mut bones, &skeleton, &pose).iter().enumerate() {
                let expected = if other == skeleton.find("lower").unwrap() { expected } else { [0.0; 2] };
                let off = (of.twist[0] - expected[0]).abs().max((of.twist[1] - expected[1]).abs());
                assert!(off.max((of.stretch - 1.0).abs()) < 1e-6, "{name}: bone {other} {of:?}");
            }
        }
        let twistable: Vec<&str> = bones.twistable().iter().map(|&b| skeleton.bones()[b].name.as_str()).collect();
        assert_eq!(twistable, ["upper", "lower"]);
    }

    #[test]
    fn a_bend_does_not_twist_and_rest_is_exact() {
        let skeleton = arm();
        let mut bones = TwistingBones::new(&skeleton);
        let mut pose = skeleton.rest_pose();
        for of in posed(&mut bones, &skeleton, &pose) {
            assert_eq!((of.stretch, of.twist), (1.0, [0.0; 2]));
        }
        for joint in &mut pose.parent_from_bone {
            joint.rotation = Quat::from_axis_angle(Vec3::new(0.0, 0.6, 0.8), 0.7);
        }
        let bent = posed(&mut bones, &skeleton, &pose);
        assert!(bent.iter().all(|of| of.twist.iter().all(|t| t.abs() < 1e-6)), "{bent:?}");
    }

    #[test]
    fn a_bone_reaches_for_the_one_that_continues_it() {
        let skeleton = arm();
        let mut bones = TwistingBones::new(&skeleton);
        let mut pose = skeleton.rest_pose();
        let hand = skeleton.find("hand").unwrap();
        pose.parent_from_bone[hand].translation = Vec3::new(3.0, 0.5, 0.0);
        let of = posed(&mut bones, &skeleton, &pose)[2];
        let end = of.start + of.rotation * (2.0 * DVec3::X) * of.stretch;
        assert!(end.distance(DVec3::new(6.0, 0.5, 0.0)) < 1e-6, "{end}");
        pose.parent_from_bone[hand].translation = Vec3::ZERO;
        let squeezed = posed(&mut bones, &skeleton, &pose)[2];
        assert!(squeezed.stretch >= LEAST_LENGTH && squeezed.rotation.is_finite());
    }

    #[test]
    fn a_twist_goes_on_beyond_half_a_turn_and_comes_back() {
        let skeleton = arm();
        let mut bones = TwistingBones::new(&skeleton);
        let hand = skeleton.find("hand").unwrap();
        let mut twist_at = |angle: f64| {
            let mut pose = skeleton.rest_pose();
            pose.parent_from_bone[hand].rotation = Quat::from_rotation_x(angle as f32);
            posed(&mut bones, &skeleton, &pose)[2].twist[1]
        };
        for step in (0..=40).chain((0..40).rev()) {
            let angle = 0.1 * f64::from(step);
            assert!((twist_at(angle) - angle).abs() < 1e-5, "{angle}");
        }
        assert!((twist_at(4.0) - (4.0 - std::f64::consts::TAU)).abs() < 1e-5, "a leap starts anew");
    }

    #[test]
    fn nonsense_is_named_and_a_bone_without_a_size_keeps_still() {
        let skeleton = arm();
        let mut bones = TwistingBones::new(&skeleton);
        let mut frames = skeleton.rest_model_from_bone();
        assert!(matches!(bones.solve(&frames[1..]), Err(SkinError::Length { .. })));
        frames[2] = Affine3A::from_scale(Vec3::ZERO);
        assert!(bones.solve(&frames).unwrap().iter().all(|of| of.rotation.is_finite()));
        frames[2] = Affine3A::from_translation(Vec3::NAN);
        assert_eq!(bones.solve(&frames), Err(SkinError::PoseNotFinite { bone: 2 }));
    }
}
