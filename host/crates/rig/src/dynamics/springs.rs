//! Chains of bones as springs, on the device's clock.

use glam::{Affine3A, DQuat, DVec3};

use super::settings::{Dynamics, DynamicsError, SpringBone, SpringCollider};
use crate::skeleton::{Pose, Skeleton, Transform};

/// The length of a step, microseconds of the device's clock.
pub const STEP_MICROS: u64 = 4_000;
/// After a longer gap than this between samples, bones hang on as they were and begin anew from rest, microseconds.
pub const LONGEST_GAP_MICROS: u64 = 1_000_000;
/// VRM's strengths and drag are for steps of a 60th of a second.
const VRM_RATE: f64 = 60.0;

/// A tip is pushed out of colliders and brought back to its distance from the head at most so often in a step.
const PUSHES: usize = 8;

const STEP_SECONDS: f64 = STEP_MICROS as f64 * 1e-6;

/// A frame without its scale: where a bone is and how it is turned, and the whole of it.
#[derive(Clone, Copy, Debug)]
struct Frame {
    affine: Affine3A,
    rotation: DQuat,
}

impl Frame {
    const IDENTITY: Self = Self { affine: Affine3A::IDENTITY, rotation: DQuat::IDENTITY };

    fn of(affine: Affine3A) -> Self {
        let (_, rotation, _) = affine.to_scale_rotation_translation();
        let rotation = rotation.as_dquat();
        Self { affine, rotation: if rotation.is_finite() { rotation.normalize() } else { DQuat::IDENTITY } }
    }

    fn child(&self, local: &Transform) -> Self {
        let rotation = (self.rotation * local.rotation.as_dquat()).normalize();
        Self { affine: self.affine * local.to_affine(), rotation }
    }

    fn place(&self, point: glam::Vec3) -> DVec3 {
        self.affine.transform_point3(point).as_dvec3()
    }

    /// Part of the way to another frame; scales go along straight lines.
    fn towards(&self, other: &Self, part: f64) -> Self {
        let (scale, _, at) = self.affine.to_scale_rotation_translation();
        let (other_scale, _, other_at) = other.affine.to_scale_rotation_translation();
        let rotation = between(self.rotation, other.rotation, part);
        let part = part as f32;
        let (scale, at) = (scale.lerp(other_scale, part), at.lerp(other_at, part));
        Self { affine: Affine3A::from_scale_rotation_translation(scale, rotation.as_quat(), at), rotation }
    }
}

/// A rotation between two near ones, about the shorter way.
fn between(a: DQuat, b: DQuat, part: f64) -> DQuat {
    let b = if a.dot(b) < 0.0 { -b } else { b };
    (a * (1.0 - part) + b * part).normalize()
}

/// What a swinging bone hangs on.
#[derive(Clone, Copy, Debug)]
enum Above {
    /// Model space.
    Nothing,
    /// A bone that does not swing, nor anything above it: its place in `carriers`.
    Carrier(usize),
    /// A bone whose frame is found anew in every step: its place in `links`.
    Link(usize),
}

/// A bone that swings, or one between such bones.
#[derive(Clone, Copy, Debug)]
struct Link {
    bone: usize,
    above: Above,
    /// `None`: it does not swing itself.
    spring: Option<SpringBone>,
    /// The colliders of its chain, in `colliders`.
    first_collider: usize,
    past_collider: usize,
}

/// Where the tip of a bone is in model space, now and a step before, and how the bone is turned in its parent's frame.
#[derive(Clone, Copy, Debug)]
struct Swing {
    tip: DVec3,
    tip_before: DVec3,
    turn: DQuat,
    turn_before: DQuat,
}

/// Moves the bones of [`Dynamics`]. Uses the device's clock only, so that a replay repeats it; begins anew with
/// [`restart`](Self::restart).
///
/// Rotations alone change: bones keep their lengths. Bones that a joint drives stay as they are and carry those below them.
/// What is shown is a step of [`STEP_MICROS`] late.
#[derive(Clone, Debug)]
pub struct SpringBones {
    dynamics: Dynamics,
    /// Parents before children.
    links: Vec<Link>,
    colliders: Vec<(usize, SpringCollider)>,
    /// Bones that carry chains and colliders from outside.
    carriers: Vec<usize>,
    carrier_of_collider: Vec<Above>,
    /// Of the carriers: at the sample before, at this one, and in the step.
    carried_before: Vec<Frame>,
    carried: Vec<Frame>,
    carried_in_step: Vec<Frame>,
    swings: Vec<Swing>,
    /// Of the links, in the step.
    frames: Vec<Frame>,
    /// Of all bones, at this sample.
    model_from_bone: Vec<Affine3A>,
    /// The device's clock at the sample before and at the latest step; `None` before the first sample.
    clock: Option<(u64, u64)>,
}

impl SpringBones {
    /// Prepares for a skeleton.
    pub fn new(skeleton: &Skeleton, dynamics: Dynamics) -> Result<Self, DynamicsError> {
        dynamics.check(skeleton)?;
        let mut colliders = Vec::new();
        let mut springs: Vec<Option<(SpringBone, usize, usize)>> = vec![None; skeleton.len()];
        for chain in &dynamics.chains {
            let first = colliders.len();
            colliders.extend(chain.colliders.iter().map(|collider| (collider.bone, *collider)));
            for own in &chain.bones {
                springs[own.bone] = Some((*own, first, colliders.len()));
            }
        }
        // A bone matters if it swings, or lies between one that does and something that needs its place.
        let mut is_below = vec![false; skeleton.len()];
        for (bone, own) in skeleton.bones().iter().enumerate() {
            is_below[bone] = springs[bone].is_some() || own.parent.is_some_and(|parent| is_below[parent]);
        }
        let mut needed: Vec<bool> = springs.iter().map(Option::is_some).collect();
        colliders.iter().for_each(|(bone, _)| needed[*bone] = true);
        for bone in (0..skeleton.len()).rev() {
            if let Some(parent) = skeleton.bones()[bone].parent.filter(|_| needed[bone]) {
                needed[parent] = true;
            }
        }
        let mut links: Vec<Link> = Vec::new();
        let mut carriers: Vec<usize> = Vec::new();
        let mut link_of = vec![None; skeleton.len()];
        let mut carrier = |bone: usize| {
            carriers.iter().position(|known| *known == bone).unwrap_or_else(|| {
                carriers.push(bone);
                carriers.len() - 1
            })
        };
        for bone in (0..skeleton.len()).filter(|&bone| needed[bone] && is_below[bone]) {
            let above = match skeleton.bones()[bone].parent {
                None => Above::Nothing,
                Some(parent) => link_of[parent].map_or_else(|| Above::Carrier(carrier(parent)), Above::Link),
            };
            let (spring, first_collider, past_collider) =
                springs[bone].map_or((None, 0, 0), |(spring, first, past)| (Some(spring), first, past));
            link_of[bone] = Some(links.len());
            links.push(Link { bone, above, spring, first_collider, past_collider });
        }
        let of = |(bone, _): &(usize, SpringCollider)| {
            link_of[*bone].map_or_else(|| Above::Carrier(carrier(*bone)), Above::Link)
        };
        let carrier_of_collider = colliders.iter().map(of).collect();
        let still =
            Swing { tip: DVec3::ZERO, tip_before: DVec3::ZERO, turn: DQuat::IDENTITY, turn_before: DQuat::IDENTITY };
        Ok(Self {
            carried_before: vec![Frame::IDENTITY; carriers.len()],
            carried: vec![Frame::IDENTITY; carriers.len()],
            carried_in_step: vec![Frame::IDENTITY; carriers.len()],
            swings: vec![still; links.len()],
            frames: vec![Frame::IDENTITY; links.len()],
            model_from_bone: vec![Affine3A::IDENTITY; skeleton.len()],
            clock: None,
            dynamics,
            links,
            colliders,
            carriers,
            carrier_of_collider,
        })
    }

    /// What swings, and how.
    pub fn dynamics(&self) -> &Dynamics {
        &self.dynamics
    }

    /// Forgets how bones swing: the next pose is the first, and they begin from it.
    pub fn restart(&mut self) {
        self.clock = None;
    }

    /// Turns the bones that swing in the next pose. `micros`: the device's clock; `is_driven`: whether a joint drives a bone.
    /// A pose that is not finite stays as it is and moves nothing. Allocates nothing.
    pub fn follow(&mut self, micros: u64, skeleton: &Skeleton, pose: &mut Pose, is_driven: &dyn Fn(usize) -> bool) {
        if self.links.is_empty() || !pose.parent_from_bone.iter().all(Transform::is_finite) {
            return;
        }
        pose.forward_kinematics(skeleton, &mut self.model_from_bone);
        if !self.carriers.iter().all(|&bone| self.model_from_bone[bone].is_finite()) {
            return;
        }
        for (frame, &bone) in self.carried.iter_mut().zip(&self.carriers) {
            *frame = Frame::of(self.model_from_bone[bone]);
        }
        let gap = self.clock.and_then(|(before, _)| micros.checked_sub(before));
        match (self.clock, gap) {
            (Some((before, mut stepped)), Some(gap)) if gap <= LONGEST_GAP_MICROS => {
                while micros - stepped >= STEP_MICROS {
                    stepped += STEP_MICROS;
                    let part = if gap == 0 { 1.0 } else { stepped.saturating_sub(before) as f64 / gap as f64 };
                    self.step(pose, part, is_driven);
                }
                self.clock = Some((micros, stepped));
            }
            (clock, _) => {
                // The first pose, a long pause, or a clock that has gone back: bones hang as they did, at rest.
                self.settle(pose, clock.is_none(), is_driven);
                self.clock = Some((micros, micros));
            }
        }
        self.carried_before.copy_from_slice(&self.carried);
        let late = self.clock.map_or(0.0, |(now, stepped)| (now - stepped) as f64 / STEP_MICROS as f64);
        for (link, swing) in self.links.iter().zip(&self.swings) {
            if link.spring.is_some() && !is_driven(link.bone) {
                pose.parent_from_bone[link.bone].rotation =
                    between(swing.turn_before, swing.turn, late).as_quat().normalize();
            }
        }
    }

    fn frame_above(above: Above, carried: &[Frame], frames: &[Frame]) -> Frame {
        match above {
            Above::Nothing => Frame::IDENTITY,
            Above::Carrier(index) => carried[index],
            Above::Link(index) => frames[index],
        }
    }

    /// Without speed: every bone as it is turned now, or, with `anew`, as in the pose.
    fn settle(&mut self, pose: &Pose, anew: bool, is_driven: &dyn Fn(usize) -> bool) {
        for (index, link) in self.links.iter().enumerate() {
            let above = Self::frame_above(link.above, &self.carried, &self.frames);
            let mut local = pose.parent_from_bone[link.bone];
            let swing = &mut self.swings[index];
            if anew || link.spring.is_none() || is_driven(link.bone) {
                swing.turn = local.rotation.as_dquat().normalize();
            }
            swing.turn_before = swing.turn;
            local.rotation = swing.turn.as_quat().normalize();
            self.frames[index] = above.child(&local);
            if let Some(spring) = link.spring {
                swing.tip = self.frames[index].place(spring.tail);
                swing.tip_before = swing.tip;
            }
        }
    }

    /// One step, to `part` of the way from the sample before to this one.
    fn step(&mut self, pose: &Pose, part: f64, is_driven: &dyn Fn(usize) -> bool) {
        for (own, (before, now)) in self.carried_in_step.iter_mut().zip(self.carried_before.iter().zip(&self.carried)) {
            *own = before.towards(now, part);
        }
        let wind = self.dynamics.wind.as_dvec3() * STEP_SECONDS;
        for (index, link) in self.links.iter().enumerate() {
            let above = Self::frame_above(link.above, &self.carried_in_step, &self.frames);
            let mut local = pose.parent_from_bone[link.bone];
            let rest = above.child(&local);
            let swing = &mut self.swings[index];
            swing.turn_before = swing.turn;
            let Some(spring) = link.spring.filter(|_| !is_driven(link.bone)) else {
                swing.turn = local.rotation.as_dquat().normalize();
                self.frames[index] = rest;
                if let Some(spring) = link.spring {
                    swing.tip_before = swing.tip;
                    swing.tip = rest.place(spring.tail);
                }
                continue;
            };
            let head: DVec3 = rest.affine.translation.as_dvec3();
            let along = rest.place(spring.tail) - head;
            let length = along.length();
            let axis = along.normalize_or(DVec3::Y);
            let keeps = libm::pow(1.0 - spring.drag, VRM_RATE * STEP_SECONDS);
            let pull = axis * spring.stiffness + spring.gravity_direction.as_dvec3() * spring.gravity;
            let blown = (swing.tip - swing.tip_before - wind) * keeps + wind;
            let free = swing.tip + blown + pull * (VRM_RATE * STEP_SECONDS * STEP_SECONDS);
            let on_rod = |tip: DVec3| head + (tip - head).normalize_or(axis) * length;
            let mut tip = on_rod(free);
            for _ in 0..PUSHES {
                let mut is_out = true;
                for collider in link.first_collider..link.past_collider {
                    let carrier = self.carrier_of_collider[collider];
                    let (_, shape) = &self.colliders[collider];
                    // A collider on a bone further down the chain is where it was a step ago.
                    let frame = Self::frame_above(carrier, &self.carried_in_step, &self.frames);
                    if let Some(out) = pushed_out(tip, &frame, shape, spring.radius) {
                        tip = on_rod(out);
                        is_out = false;
                    }
                }
                if is_out {
                    break;
                }
            }
            if !tip.is_finite() {
                tip = head + along;
            }
            (swing.tip_before, swing.tip) = (swing.tip, tip);
            let turned = (arc(axis, (tip - head).normalize_or(axis)) * rest.rotation).normalize();
            swing.turn = (above.rotation.conjugate() * turned).normalize();
            local.rotation = swing.turn.as_quat().normalize();
            self.frames[index] = above.child(&local);
        }
    }
}

/// Where a point has to go that is inside a collider; `None` for one that is outside.
fn pushed_out(point: DVec3, frame: &Frame, shape: &SpringCollider, radius: f64) -> Option<DVec3> {
    let start = frame.place(shape.offset);
    let nearest = match shape.tail {
        None => start,
        Some(tail) => {
            let along = frame.place(tail) - start;
            let squared = along.length_squared();
            let part = if squared > 0.0 { ((point - start).dot(along) / squared).clamp(0.0, 1.0) } else { 0.0 };
            start + along * part
        }
    };
    let reach = shape.radius + radius;
    let away = point - nearest;
    (away.length() < reach).then(|| nearest + away.normalize_or(DVec3::Y) * reach)
}

/// The shortest turn from one unit vector to another.
fn arc(from: DVec3, to: DVec3) -> DQuat {
    let cos = from.dot(to);
    if cos < -1.0 + 1e-12 {
        let side = from.any_orthonormal_vector();
        return DQuat::from_xyzw(side.x, side.y, side.z, 0.0);
    }
    let cross = from.cross(to);
    DQuat::from_xyzw(cross.x, cross.y, cross.z, 1.0 + cos).normalize()
}
