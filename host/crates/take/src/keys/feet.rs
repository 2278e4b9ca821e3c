//! Feet stay where they were: the bounds of the bones above them are tightened until they do.

use std::ops::ControlFlow;

use armature_rig::{Motion, Pose, Skeleton};
use glam::{DAffine3, DVec3};

use super::{HALVINGS, KeyError, ReducedBone, read_pose};

/// What is no higher above the lowest point than this share of the skeleton's height is on the ground.
const ON_THE_GROUND: f64 = 0.1;

/// The skeleton's size in its rest pose.
pub(super) fn size(skeleton: &Skeleton) -> f64 {
    let points = ends(skeleton, &skeleton.rest_pose());
    let (low, high) = bounds(points.iter().flatten());
    let size = (high - low).length();
    if size.is_finite() && size > 0.0 { size } else { 1.0 }
}

/// Bones at the ends of chains whose end is on the ground in the rest pose.
pub(super) fn feet(skeleton: &Skeleton) -> Vec<usize> {
    let points = ends(skeleton, &skeleton.rest_pose());
    let (low, high) = bounds(points.iter().flatten());
    let ground = low.y + ON_THE_GROUND * (high.y - low.y);
    let has_child = |bone: usize| skeleton.bones().iter().any(|other| other.parent == Some(bone));
    let stands = |bone: &usize| !has_child(*bone) && points[*bone].iter().any(|point| point.y <= ground);
    (0..skeleton.len()).filter(stands).collect()
}

fn bounds<'a>(points: impl Iterator<Item = &'a DVec3>) -> (DVec3, DVec3) {
    points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), point| (low.min(*point), high.max(*point)))
}

/// Head and tail of each bone in model space.
fn ends(skeleton: &Skeleton, pose: &Pose) -> Vec<[DVec3; 2]> {
    let mut frames: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for (bone, local) in skeleton.bones().iter().zip(&pose.parent_from_bone) {
        let local = DAffine3::from_scale_rotation_translation(
            local.scale.as_dvec3(),
            local.rotation.as_dquat().normalize(),
            local.translation.as_dvec3(),
        );
        frames.push(bone.parent.map_or(local, |parent| frames[parent] * local));
    }
    let bones = skeleton.bones().iter().zip(frames);
    bones.map(|(bone, frame)| [frame.translation, frame.transform_point3(bone.tail.as_dvec3())]).collect()
}

/// Reduces the bones above a foot again, with tighter bounds, until no frame moves it by more than the bound. Returns by
/// how much one is moved in the end; `None` if the skeleton has no feet.
pub(super) fn keep_feet(
    motion: &Motion,
    bound: f64,
    bones: &mut [ReducedBone],
    again: &dyn Fn(usize, f64) -> ReducedBone,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Option<(f64, String)>, KeyError> {
    let skeleton = &motion.skeleton;
    let feet = feet(skeleton);
    let right: Vec<Vec<[DVec3; 2]>> = motion.frames.iter().map(|pose| ends(skeleton, pose)).collect();
    let mut halvings = vec![0; skeleton.len()];
    loop {
        let moved = moved(&feet, &right, bones, skeleton);
        let Some((worst, foot)) = moved.iter().copied().max_by(|a, b| a.0.total_cmp(&b.0)) else { return Ok(None) };
        if worst <= bound {
            return Ok(Some((worst, skeleton.bones()[foot].name.clone())));
        }
        let mut above = vec![false; skeleton.len()];
        for (_, foot) in moved.into_iter().filter(|(by, _)| *by > bound) {
            let mut at = Some(foot);
            while let Some(bone) = at {
                above[bone] = true;
                at = skeleton.bones()[bone].parent;
            }
        }
        let tighter: Vec<usize> =
            (0..skeleton.len()).filter(|&bone| above[bone] && halvings[bone] < HALVINGS).collect();
        if tighter.is_empty() {
            return Err(KeyError::FeetTooStrict { bound, bone: skeleton.bones()[foot].name.clone(), moved: worst });
        }
        for bone in tighter {
            halvings[bone] += 1;
            let share = if halvings[bone] < HALVINGS { 0.5_f64.powi(halvings[bone] as i32) } else { 0.0 };
            bones[bone] = again(bone, share);
        }
        let most = halvings.iter().copied().max().unwrap_or(0);
        if progress("keeping the feet in place", f64::from(most) / f64::from(HALVINGS)).is_break() {
            return Err(KeyError::Cancelled);
        }
    }
}

/// By how much each foot is moved at most.
fn moved(feet: &[usize], right: &[Vec<[DVec3; 2]>], bones: &[ReducedBone], skeleton: &Skeleton) -> Vec<(f64, usize)> {
    let mut moved: Vec<(f64, usize)> = feet.iter().map(|&foot| (0.0, foot)).collect();
    for (frame, right) in right.iter().enumerate() {
        let read = ends(skeleton, &read_pose(bones, frame, skeleton));
        for (most, foot) in &mut moved {
            let off = (0..2).map(|end| read[*foot][end].distance(right[*foot][end])).fold(0.0, f64::max);
            *most = f64::max(*most, off);
        }
    }
    moved
}
