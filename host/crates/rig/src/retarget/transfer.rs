//! The motion of one skeleton on another.

use std::ops::ControlFlow;

use glam::{DQuat, DVec3};

use super::feet::{Leg, legs, plant, settle, shift};
use super::frames::{Frame, frames, rest_frames};
use super::pairs::Pairs;
use super::rest::{facing, matched_rest};
use super::trunk::{TrunkBone, trunk};
use crate::recognise::{Figure, HumanoidBone, HumanoidPart};
use crate::skeleton::{Motion, MotionError, Pose, Skeleton};

/// Fewer pairs of bones than this are no figure.
const LEAST_PAIRS: usize = 3;
/// Floors of two rest poses that differ by less than this share of the height are the same.
const SAME_FLOOR: f64 = 0.02;
/// Bones of the source that move away from their rest by more than this share of its size are worth a word.
const WORTH_A_WORD: f64 = 0.01;
/// The share of the progress for turning bones; feet take the rest.
const TURNING: f64 = 0.6;

/// How to retarget.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RetargetSettings {
    /// Keep feet in place while those of the source stand still.
    pub contacts: bool,
    /// How much larger the way of the hips is; `None`: as much as the legs are longer.
    pub scale: Option<f64>,
}

impl Default for RetargetSettings {
    fn default() -> Self {
        Self { contacts: true, scale: None }
    }
}

/// A motion on the target, and what was done.
#[derive(Clone, Debug, PartialEq)]
pub struct Retargeted {
    /// On the target's skeleton, at the source's rate.
    pub motion: Motion,
    /// What was done.
    pub report: RetargetReport,
}

/// What was paired, scaled and kept.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RetargetReport {
    /// Names of bones of the source and of the target that they move.
    pub pairs: Vec<(String, String)>,
    /// Bones of the target that nothing moves: they follow the bone above.
    pub following: Vec<String>,
    /// Bones of the source that move nothing, although they move.
    pub unused: Vec<String>,
    /// How much larger the way of the hips is.
    pub scale: f64,
    /// How often a foot stands, over all feet.
    pub contacts: usize,
    /// The furthest that a foot that stands is from its place, because the leg does not reach it; the target's unit.
    pub missed: f64,
    /// What a motion has that is not carried over, in sentences.
    pub notes: Vec<String>,
}

/// Why a motion cannot be retargeted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RetargetError {
    /// Too few bones go together.
    #[error(
        "only {pairs} bones of the motion and of the character go together: {source_bones} of the one and {target_bones} of the other were recognised"
    )]
    TooFewPairs {
        /// Pairs found.
        pairs: usize,
        /// Bones recognised in the source.
        source_bones: usize,
        /// Bones recognised in the target.
        target_bones: usize,
    },
    /// A human's motion on a quadruped, or the like.
    #[error("the motion is that of a {motion}, and the character is a {character}")]
    OtherFigure {
        /// What moves.
        motion: Figure,
        /// What should.
        character: Figure,
    },
    /// The motion has no frames.
    #[error("the motion has no frames")]
    NoFrames,
    /// A scale that is no positive number.
    #[error("the way cannot be scaled by {0}; give a positive number")]
    BadScale(f64),
    /// Stopped by the caller.
    #[error("cancelled")]
    Cancelled,
    /// A number ran out of range.
    #[error(transparent)]
    Motion(#[from] MotionError),
}

/// Moves `target` as `source` moves: see the module's page. A motion on the very same skeleton comes back as it is.
///
/// `progress`: the stage and how far it is, 0 to 1; it can stop the work.
///
/// ```
/// use std::ops::ControlFlow;
/// use armature_rig::{Bone, Motion, RetargetSettings, Skeleton, Transform, retarget};
/// use glam::{Quat, Vec3};
///
/// // Two tails whose bones have one name each, of different lengths.
/// let tail = |length: f32| {
///     let bone = |(index, name): (usize, &&str)| Bone {
///         name: (*name).into(),
///         parent: index.checked_sub(1),
///         rest: Transform { translation: Vec3::new(0.0, 0.0, -length), ..Transform::IDENTITY },
///         tail: Vec3::new(0.0, 0.0, -length),
///     };
///     Skeleton::new(["tail_1", "tail_2", "tail_3"].iter().enumerate().map(bone).collect())
/// };
/// let mut pose = tail(1.0)?.rest_pose();
/// pose.parent_from_bone[1].rotation = Quat::from_rotation_x(0.5);
/// let motion = Motion::new(tail(1.0)?, 0.04, vec![pose])?;
/// let long = retarget(&motion, &tail(2.0)?, &RetargetSettings::default(), &mut |_, _| ControlFlow::Continue(()))?;
/// assert!(long.motion.frames[0].parent_from_bone[1].rotation.angle_between(Quat::from_rotation_x(0.5)) < 1e-3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn retarget(
    source: &Motion,
    target: &Skeleton,
    settings: &RetargetSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Retargeted, RetargetError> {
    if source.frames.is_empty() {
        return Err(RetargetError::NoFrames);
    }
    if let Some(scale) = settings.scale.filter(|scale| !(scale.is_finite() && *scale > 0.0)) {
        return Err(RetargetError::BadScale(scale));
    }
    let pairs = Pairs::new(&source.skeleton, target);
    let plan = Plan::new(source, target, pairs, settings)?;
    let mut poses = Vec::with_capacity(source.frames.len());
    let mut source_frames = Vec::with_capacity(source.frames.len());
    for (index, pose) in source.frames.iter().enumerate() {
        if progress("turning bones", TURNING * index as f64 / source.frames.len() as f64).is_break() {
            return Err(RetargetError::Cancelled);
        }
        let frames = frames(&source.skeleton, pose);
        poses.push(plan.pose(target, &frames));
        source_frames.push(frames);
    }
    let mut report = plan.report(source, target);
    if settings.contacts {
        let legs: Vec<Leg> = legs(&plan.pairs, &plan.source_rest, &plan.target_rest);
        let mut planted = Vec::with_capacity(legs.len());
        for leg in &legs {
            let way = |frame: &Vec<Frame>| plan.scale * (plan.facing * frame[leg.source_foot].head);
            planted.push(plant(leg, target, &source_frames, &way, source.frame_seconds, &poses));
        }
        report.contacts = planted.iter().map(|own| own.contacts).sum();
        let count = poses.len() as f64;
        for (index, pose) in poses.iter_mut().enumerate() {
            if progress("keeping feet in place", TURNING + (1.0 - TURNING) * index as f64 / count).is_break() {
                return Err(RetargetError::Cancelled);
            }
            let shift = shift(&planted, index);
            plan.carry(target, pose, shift);
            for own in &planted {
                report.missed = report.missed.max(settle(own, target, pose, index, shift));
            }
        }
    }
    Ok(Retargeted { motion: Motion::new(target.clone(), source.frame_seconds, poses)?, report })
}

/// What is the same in all frames.
struct Plan {
    pairs: Pairs,
    trunk: Vec<TrunkBone>,
    facing: DQuat,
    source_rest: Vec<Frame>,
    target_rest: Vec<Frame>,
    /// The target's rotations at rest with its limbs where the source's are.
    matched: Vec<DQuat>,
    scale: f64,
    /// The bone that is moved about, of both.
    carried: Option<[usize; 2]>,
    /// What is added to its scaled way.
    offset: DVec3,
}

impl Plan {
    fn new(
        source: &Motion,
        target: &Skeleton,
        pairs: Pairs,
        settings: &RetargetSettings,
    ) -> Result<Self, RetargetError> {
        let (source_rest, _) = rest_frames(&source.skeleton);
        let (target_rest, _) = rest_frames(target);
        let (motion, character) = (pairs.source.figure, pairs.target.figure);
        if motion != character && motion != Figure::Other && character != Figure::Other {
            return Err(RetargetError::OtherFigure { motion, character });
        }
        let trunk = trunk(&pairs);
        let count = pairs.of_target.iter().flatten().count() + trunk.len();
        let (source_bones, target_bones) = (pairs.source.count(), pairs.target.count());
        // A spider has two legs that are like a person's, but does not move like one.
        let is_other = motion != character && 2 * count < source_bones.max(target_bones);
        if is_other || count < LEAST_PAIRS.min(target.len()) {
            return Err(RetargetError::TooFewPairs { pairs: count, source_bones, target_bones });
        }
        let facing = facing(&pairs, &source_rest, &target_rest);
        let matched = matched_rest(&pairs, target, &source_rest, &target_rest, facing);
        let [own, wanted] = sizes(&pairs, &source_rest, &target_rest, facing);
        let scale = settings.scale.unwrap_or(if own > 0.0 && wanted > 0.0 { wanted / own } else { 1.0 });
        let hips = pairs.both(HumanoidBone { part: HumanoidPart::Hips, side: None });
        let root = || (0..target.len()).find_map(|bone| Some([pairs.of_target[bone]?, bone]));
        let mut plan = Self {
            carried: hips.or_else(root),
            trunk,
            facing,
            matched,
            scale,
            offset: DVec3::ZERO,
            pairs,
            source_rest,
            target_rest,
        };
        plan.offset = plan.offset_of_floor(source);
        Ok(plan)
    }

    /// What brings the scaled floor of the motion to the target's. Where both rest poses stand on the same floor (scaled),
    /// heights mean the same in both files; otherwise the motion's floor is where its feet are when they are lowest.
    fn offset_of_floor(&self, source: &Motion) -> DVec3 {
        let legs = legs(&self.pairs, &self.source_rest, &self.target_rest);
        let feet: Vec<usize> = legs.iter().map(|leg| leg.source_foot).collect();
        let Some([source_hips, target_hips]) = self.carried else { return DVec3::ZERO };
        let up = |place: DVec3| (self.facing * place).y;
        let lowest = |heights: &mut dyn Iterator<Item = f64>| heights.fold(f64::INFINITY, f64::min);
        if feet.is_empty() {
            let rest = self.facing * self.source_rest[source_hips].head;
            return self.target_rest[target_hips].head - self.scale * rest;
        }
        let source_rest = lowest(&mut feet.iter().map(|&foot| up(self.source_rest[foot].head)));
        let target_rest = lowest(&mut legs.iter().map(|leg| self.target_rest[leg.target_foot].head.y));
        let height = self.target_rest[target_hips].head.y - target_rest;
        if (target_rest - self.scale * source_rest).abs() < SAME_FLOOR * height.abs() {
            return DVec3::ZERO;
        }
        let of_frame = |pose: &Pose| {
            let frames = frames(&source.skeleton, pose);
            feet.iter().map(|&foot| up(frames[foot].head)).fold(f64::INFINITY, f64::min)
        };
        let mut heights: Vec<f64> = source.frames.iter().map(of_frame).collect();
        heights.sort_by(f64::total_cmp);
        // Not the very lowest: one frame of a stumble is no floor.
        let floor = heights[heights.len() / 50];
        DVec3::new(0.0, target_rest - self.scale * floor, 0.0)
    }

    /// The target's pose for a pose of the source.
    fn pose(&self, target: &Skeleton, source: &[Frame]) -> Pose {
        let back = self.facing.inverse();
        let turn = |bone: usize| {
            let turn = source[bone].rotation * self.source_rest[bone].rotation.inverse();
            (self.facing * turn * back).normalize()
        };
        let turns: Vec<DQuat> = (0..source.len()).map(turn).collect();
        let mut wanted: Vec<Option<DQuat>> =
            self.pairs.of_target.iter().map(|partner| partner.map(|bone| turns[bone])).collect();
        for own in &self.trunk {
            wanted[own.bone] = Some(own.turn(&turns));
        }
        let mut pose = target.rest_pose();
        let mut model: Vec<DQuat> = Vec::with_capacity(target.len());
        let mut turned: Vec<DQuat> = Vec::with_capacity(target.len());
        for (index, bone) in target.bones().iter().enumerate() {
            let above = bone.parent.map_or(DQuat::IDENTITY, |parent| model[parent]);
            let own = wanted[index].unwrap_or_else(|| bone.parent.map_or(DQuat::IDENTITY, |parent| turned[parent]));
            turned.push(own);
            model.push((own * self.matched[index]).normalize());
            pose.parent_from_bone[index].rotation = (above.inverse() * model[index]).normalize().as_quat().normalize();
        }
        if let Some([from, to]) = self.carried {
            let place = self.scale * (self.facing * source[from].head) + self.offset;
            let frames = frames(target, &pose);
            let local = target.bones()[to].parent.map_or(place, |parent| {
                let above = frames[parent];
                above.rotation.inverse() * (place - above.head)
            });
            pose.parent_from_bone[to].translation = local.as_vec3();
        }
        pose
    }

    /// Moves the whole figure, in model space.
    fn carry(&self, target: &Skeleton, pose: &mut Pose, by: DVec3) {
        if let Some([_, to]) = self.carried.filter(|_| by != DVec3::ZERO) {
            let above =
                target.bones()[to].parent.map_or(DQuat::IDENTITY, |parent| frames(target, pose)[parent].rotation);
            pose.parent_from_bone[to].translation += (above.inverse() * by).as_vec3();
        }
    }

    fn report(&self, source: &Motion, target: &Skeleton) -> RetargetReport {
        let name = |skeleton: &Skeleton, bone: usize| skeleton.bones()[bone].name.clone();
        let by_trunk = |bone: usize| self.trunk.iter().any(|own| own.bone == bone);
        let of = |(bone, partner): (usize, &Option<usize>)| {
            partner.map(|partner| (name(&source.skeleton, partner), name(target, bone)))
        };
        let mut used = vec![false; source.skeleton.len()];
        self.pairs.of_target.iter().flatten().for_each(|&bone| used[bone] = true);
        self.pairs.source.bones.iter().enumerate().for_each(|(bone, own)| {
            let is_trunk = own.is_some_and(|own| super::pairs::TRUNK.contains(&own.bone.part));
            used[bone] |= is_trunk && !self.trunk.is_empty();
        });
        let first = &source.frames[0].parent_from_bone;
        let turns = |bone: &usize| {
            source
                .frames
                .iter()
                .any(|pose| pose.parent_from_bone[*bone].rotation.angle_between(first[*bone].rotation) > 0.02)
        };
        let unused: Vec<usize> = (0..source.skeleton.len()).filter(|&bone| !used[bone]).filter(turns).collect();
        let following = (0..target.len()).filter(|&bone| self.pairs.of_target[bone].is_none() && !by_trunk(bone));
        let mut notes = Vec::new();
        let size = self.source_rest.iter().map(|frame| frame.head.length()).fold(0.0, f64::max);
        let carried = self.carried.map(|[from, _]| from);
        let strays = |bone: &usize| {
            let rest = source.skeleton.bones()[*bone].rest.translation;
            let off = |pose: &Pose| f64::from(pose.parent_from_bone[*bone].translation.distance(rest));
            source.skeleton.bones()[*bone].parent.is_some()
                && Some(*bone) != carried
                && source.frames.iter().any(|pose| off(pose) > WORTH_A_WORD * size)
        };
        let stray: Vec<String> =
            (0..source.skeleton.len()).filter(strays).map(|bone| name(&source.skeleton, bone)).collect();
        if !stray.is_empty() {
            notes.push(format!(
                "bones of the motion that move away from the bone above keep the character's lengths: {}",
                stray.join(", ")
            ));
        }
        RetargetReport {
            pairs: self.pairs.of_target.iter().enumerate().filter_map(of).collect(),
            following: following.map(|bone| name(target, bone)).collect(),
            unused: unused.into_iter().map(|bone| name(&source.skeleton, bone)).collect(),
            scale: self.scale,
            contacts: 0,
            missed: 0.0,
            notes,
        }
    }
}

/// How large both are: by their legs, else by all of their bones.
fn sizes(pairs: &Pairs, source: &[Frame], target: &[Frame], facing: DQuat) -> [f64; 2] {
    let legs = legs(pairs, source, target);
    if legs.is_empty() {
        let extent = |frames: &[Frame], turn: DQuat| {
            let places = || frames.iter().map(|frame| turn * frame.head);
            let low = places().fold(DVec3::INFINITY, DVec3::min);
            let high = places().fold(DVec3::NEG_INFINITY, DVec3::max);
            (high - low).length()
        };
        return [extent(source, facing), extent(target, DQuat::IDENTITY)];
    }
    [legs.iter().map(|leg| leg.source_length).sum(), legs.iter().map(|leg| leg.target_length).sum()]
}
