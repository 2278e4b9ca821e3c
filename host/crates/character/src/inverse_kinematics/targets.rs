//! Targets as they are followed: which point of the skeleton each one pulls, and where to at a moment.

use armature_rig::{PoseMoment, Skeleton, Target, TargetError, TargetPoint};
use glam::{Affine3A, Quat, Vec3};

use super::bone_roles::Dragged;
use super::ease::{Ease, FormerPose, share_of};
use super::held_pins::Pin;
use super::joint_limit::HandleLimit;
use super::layout::Layout;
use super::rest::RestRig;
use super::shape::Shape;

/// The last part of a chain's reach over which its end slows down: nearer to straight, a small way of the end turns the
/// bones far. What is nearer is reached exactly; at the very end of the reach, 1.1 % of it is missing.
const SLOWS_DOWN: f32 = 0.03;
/// A bone that moves less than this share of a point is not made to move for it.
const LEAST_SHARE: f64 = 0.05;
/// What a soft target counts among the rigid bones beside pins and hard targets, for each part of its strength: the energy
/// has already brought it where it gives way to, and what is held must not suffer from it.
const SOFT_COUNTS: f32 = 0.03;

/// A target, and what is left of the way to it.
#[derive(Clone, Debug)]
pub(super) struct Followed {
    pub(super) target: Target,
    /// The bones that move the point: the bone, its share, and the point at rest.
    pub(super) bones: Vec<(usize, f64, Vec3)>,
    /// From where it goes to where it was, for the energy and for the rigid bones.
    away: [Option<Vec3>; 2],
    turned_away: Quat,
    ease: Ease,
    /// How much of that is left.
    left: f32,
    /// Set or moved since the last pose.
    is_new: bool,
    over_micros: u32,
    /// Where it was to be in the last pose (world), for the energy and for the rigid bones.
    now: [Option<Vec3>; 2],
    now_turned: Option<Quat>,
    /// Where it was when the target was set (model space).
    was: Option<Vec3>,
    /// By how much it was missed then (mesh units).
    pub(super) missed: f32,
    /// The most that it was missed by.
    worst: f32,
}

impl Followed {
    /// `shape`: for points of the skin.
    pub(super) fn new(target: Target, over_micros: u32, rig: &RestRig, shape: &Shape) -> Result<Self, TargetError> {
        let bones = match target.point {
            TargetPoint::Head(bone) => vec![(bone, 1.0, rig.heads[bone])],
            TargetPoint::Tail(bone) => vec![(bone, 1.0, rig.tails[bone])],
            TargetPoint::Skin { vertices, barycentric } => shape.bones_of_point(vertices, barycentric)?,
        };
        Ok(Self {
            target,
            bones,
            away: [None; 2],
            turned_away: Quat::IDENTITY,
            ease: Ease::default(),
            left: 0.0,
            is_new: true,
            over_micros,
            now: [None; 2],
            now_turned: None,
            was: None,
            missed: 0.0,
            worst: 0.0,
        })
    }

    /// Whether another target of the same point changes nothing but where it goes.
    pub(super) fn is_moved_by(&self, target: &Target) -> bool {
        self.target.point.is(&target.point)
            && self.target.position.is_some() == target.position.is_some()
            && self.target.orientation.is_some() == target.orientation.is_some()
            && self.target.strength.to_bits() == target.strength.to_bits()
    }

    /// Goes elsewhere from the next pose on.
    pub(super) fn go_to(&mut self, target: Target, over_micros: u32) {
        (self.target, self.over_micros, self.is_new) = (target, over_micros, true);
    }

    /// Another target was set or let go. What a soft one has to give way to is different now, so its bones go from where
    /// they are.
    pub(super) fn begin_again(&mut self, over_micros: u32) {
        if self.target.strength < 1.0 && !self.is_new {
            (self.over_micros, self.is_new) = (over_micros, true);
            self.now[Way::OfBones as usize] = None;
        }
    }

    /// The bone that moves the point most.
    pub(super) fn bone(&self) -> usize {
        self.bones
            .iter()
            .fold((0, 0.0), |most, (bone, share, _)| if *share > most.1 { (*bone, *share) } else { most })
            .0
    }

    /// By how much it was missed in this pose.
    pub(super) fn miss(&mut self, distance: f32) {
        self.missed = distance;
        if self.target.strength >= 1.0 {
            self.worst = self.worst.max(distance);
        }
    }

    /// The most that it was missed by; a soft target is never missed.
    pub(super) fn worst(&self, skeleton: &Skeleton) -> Missed {
        Missed { name: self.target.point.name(skeleton), distance: self.worst }
    }

    /// Whether its orientation is as given, whatever the shape would prefer.
    pub(super) fn turns(&self) -> bool {
        self.target.orientation.is_some() && self.target.strength >= 1.0
    }

    /// What it asks of the bones.
    pub(super) fn mark(&self, dragged: &mut [Dragged]) {
        for (bone, share, _) in &self.bones {
            dragged[*bone].reached |= *share >= LEAST_SHARE;
        }
        dragged[self.bone()].turned |= self.turns();
    }

    /// The point in a pose (model space).
    fn place_in(&self, pose: &FormerPose, rig: &RestRig) -> Vec3 {
        let at = |(bone, share, rest): &(usize, f64, Vec3)| {
            let turn = pose.rotations[*bone] * rig.rotations[*bone].inverse();
            (pose.heads[*bone] + turn * (*rest - rig.heads[*bone])) * *share as f32
        };
        self.bones.iter().map(at).sum()
    }

    /// At this moment: the place that it is to have in the end (model space), and the orientation of its bone now. `former`:
    /// the pose before, if it is known.
    pub(super) fn begin(
        &mut self,
        moment: PoseMoment,
        former: Option<&FormerPose>,
        rig: &RestRig,
    ) -> (Option<Vec3>, Option<Quat>) {
        if std::mem::take(&mut self.is_new) {
            self.ease = Ease::over(self.over_micros);
            self.away = [None; 2];
            self.was = former.map(|pose| self.place_in(pose, rig));
            let was = self.now_turned.or_else(|| former.map(|pose| pose.rotations[self.bone()]));
            let from = was.zip(self.target.orientation).map(|(was, to)| (was * to.inverse()).normalize());
            self.turned_away = from.unwrap_or(Quat::IDENTITY);
        }
        self.left = self.ease.left(moment.device_micros);
        self.now_turned = self.target.orientation.map(|to| {
            let on_the_way = if self.left > 0.0 { share_of(self.turned_away, self.left) * to } else { to };
            on_the_way.normalize()
        });
        (self.target.position.map(|to| to - moment.offset), self.now_turned)
    }

    /// On the way to a place: from where it was when the target was set. All in model space.
    pub(super) fn on_the_way(&mut self, to: Vec3, moment: PoseMoment, way: Way) -> Vec3 {
        let way = way as usize;
        let was = self.now[way].map(|now| now - moment.offset).or(self.was);
        let away = *self.away[way].get_or_insert_with(|| was.map_or(Vec3::ZERO, |was| was - to));
        let at = if self.left > 0.0 { to + away * self.left } else { to };
        self.now[way] = Some(at + moment.offset);
        at
    }
}

/// Which of the two solvers goes to a target.
#[derive(Clone, Copy, Debug)]
pub(super) enum Way {
    /// The energy of the shape.
    OfEnergy = 0,
    /// The rigid bones after it.
    OfBones = 1,
}

/// A pin or a target, and by how much it was missed.
#[derive(Clone, Debug, PartialEq)]
pub struct Missed {
    /// The bone or the point.
    pub name: String,
    /// How far it was from where it belongs, mesh units.
    pub distance: f32,
}

/// How a target's point hangs on the handles of a layout.
#[derive(Clone, Debug)]
pub(super) struct Attachment {
    /// For the energy: handle, share and point at rest.
    pub(super) on_handles: Vec<(usize, f64, [f64; 3])>,
    /// For the rigid bones; its `target` is where it goes now.
    pub(super) pin: Pin,
    /// What the segments with free rotations reach together; infinite where the root may move.
    reach: f32,
    /// Whether anything at all can bring it nearer.
    pub(super) can_move: bool,
}

impl Attachment {
    /// `limits`: of the joints between handles.
    pub(super) fn new(
        followed: &Followed,
        rig: &RestRig,
        layout: &Layout,
        roots: &[usize],
        limits: &[HandleLimit],
    ) -> Self {
        let mut segments: Vec<(usize, Vec3)> = Vec::new();
        let mut add = |handle: usize, along: Vec3| match segments.iter_mut().find(|(known, _)| *known == handle) {
            Some((_, sum)) => *sum += along,
            None => segments.push((handle, along)),
        };
        let mut rest_root = Vec3::ZERO;
        let mut root_of_most = 0;
        for (bone, share, rest) in &followed.bones {
            let share = *share as f32;
            add(layout.handle_of_bone[*bone], (*rest - rig.heads[*bone]) * share);
            let mut at = *bone;
            while let Some(parent) = rig.parent(at) {
                add(layout.handle_of_bone[parent], (rig.heads[at] - rig.heads[parent]) * share);
                at = parent;
            }
            rest_root += rig.heads[at] * share;
            if *bone == followed.bone() {
                root_of_most = at;
            }
        }
        segments.retain(|(_, along)| *along != Vec3::ZERO);
        let root = roots.iter().position(|&root| root == root_of_most).unwrap_or(0);
        let is_free = !layout.placed[layout.handle_of_bone[root_of_most]];
        let turning: Vec<(usize, Vec3)> =
            segments.iter().copied().filter(|(handle, _)| layout.is_solved(*handle)).collect();
        let reach = if is_free { f32::INFINITY } else { reach_of(&turning, limits) };
        let part = |(bone, share, rest): &(usize, f64, Vec3)| {
            (layout.handle_of_bone[*bone], *share, rest.as_dvec3().to_array())
        };
        let strength = followed.target.strength;
        let weight = Vec3::splat(if strength >= 1.0 { 1.0 } else { SOFT_COUNTS * strength });
        Self {
            on_handles: followed.bones.iter().map(part).collect(),
            can_move: followed.target.position.is_some() && reach > 0.0,
            reach,
            pin: Pin { target: rest_root, weight, root, rest_root, segments },
        }
    }

    /// Where the point is as the energy moves its handles.
    pub(super) fn place(&self, transforms: &[Affine3A]) -> Vec3 {
        let part = |(handle, share, at): &(usize, f64, [f64; 3])| {
            transforms[*handle].transform_point3(Vec3::from_array(at.map(|c| c as f32))) * *share as f32
        };
        self.on_handles.iter().map(part).sum()
    }

    /// The nearest place within reach, approached smoothly. `turns`: of the handles that are given.
    pub(super) fn within_reach(&self, goal: Vec3, layout: &Layout, turns: &[Quat], shifts: &[Vec3]) -> Vec3 {
        if !self.reach.is_finite() {
            return goal;
        }
        let given = self.pin.segments.iter().filter(|(handle, _)| !layout.is_solved(*handle));
        let centre =
            given.fold(self.pin.rest_root + shifts[self.pin.root], |at, (handle, along)| at + turns[*handle] * *along);
        let way = goal - centre;
        let (length, soft) = (way.length(), SLOWS_DOWN * self.reach);
        let exact = self.reach - soft;
        if !length.is_finite() || length <= exact {
            return goal;
        }
        centre + way * ((exact + soft * -libm::expm1f(-(length - exact) / soft)) / length)
    }
}

/// How far the end of segments that turn is from their beginning at most. `segments`: from the end on; each with the handle
/// that turns it.
fn reach_of(segments: &[(usize, Vec3)], limits: &[HandleLimit]) -> f32 {
    let mut reach = 0.0_f32;
    for (number, (handle, along)) in segments.iter().enumerate() {
        let below = number.checked_sub(1).map(|below| segments[below]);
        let limit = below.and_then(|(own, _)| limits.iter().find(|limit| limit.own == own && limit.above == *handle));
        // What a hinge keeps bent makes the two shorter than their sum.
        let cosine = match (limit, below) {
            (Some(limit), Some((_, below))) => limit.straightest(*along, below),
            _ => 1.0,
        };
        let length = along.length();
        reach = (reach * reach + length * length + 2.0 * reach * length * cosine).max(0.0).sqrt();
    }
    reach
}
