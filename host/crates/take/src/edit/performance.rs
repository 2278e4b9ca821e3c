//! Poses with their times while they are edited.

use armature_rig::{Pose, Skeleton, Transform};

use crate::shapes::ShapeTrack;
use crate::time::between;

/// Seconds to microseconds, as far as they go.
pub(super) fn micros(seconds: f64) -> i64 {
    libm::round(seconds.clamp(-1e12, 1e12) * 1e6) as i64
}

/// Poses in time order, and what is noted beside them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Performance {
    /// Microseconds, increasing, and the pose there.
    pub(super) poses: Vec<(i64, Pose)>,
    /// Notes and their times, microseconds.
    pub(super) markers: Vec<(i64, String)>,
    /// Named parts, microseconds.
    pub(super) segments: Vec<(String, i64, i64)>,
    /// Weights of blend shapes, where the take has any.
    shapes: Option<ShapeTrack>,
}

impl Performance {
    /// Poses and nothing beside them.
    pub(super) fn of(poses: Vec<(i64, Pose)>) -> Self {
        Self { poses, ..Self::default() }
    }

    /// With these weights of blend shapes.
    pub(super) fn with_shapes(self, shapes: Option<ShapeTrack>) -> Self {
        Self { shapes, ..self }
    }

    /// The weights of blend shapes, if there are any.
    pub(super) fn shapes_mut(&mut self) -> Option<&mut ShapeTrack> {
        self.shapes.as_mut()
    }

    /// The same, taken out.
    pub(super) fn take_shapes(&mut self) -> Option<ShapeTrack> {
        self.shapes.take()
    }

    /// First and last time.
    pub(super) fn span(&self) -> Option<(i64, i64)> {
        Some((self.poses.first()?.0, self.poses.last()?.0))
    }

    /// The pose at a time: between its neighbours, or the first or last one beyond them.
    pub(super) fn at(&self, micros: i64) -> Option<Pose> {
        let after = self.poses.partition_point(|(time, _)| *time <= micros);
        let Some((time, before)) = after.checked_sub(1).map(|index| &self.poses[index]) else {
            return self.poses.first().map(|(_, pose)| pose.clone());
        };
        Some(match self.poses.get(after) {
            Some((next, pose)) if *time < micros => blend(before, pose, (micros - time) as f64 / (next - time) as f64),
            _ => before.clone(),
        })
    }
}

/// Each bone the fraction `part` of the way from one pose to another.
pub(super) fn blend(a: &Pose, b: &Pose, part: f64) -> Pose {
    let bones = a.parent_from_bone.iter().zip(&b.parent_from_bone);
    Pose { parent_from_bone: bones.map(|(a, b)| towards(a, b, part)).collect() }
}

/// The ends themselves have their own bits.
fn towards(a: &Transform, b: &Transform, part: f64) -> Transform {
    if part >= 1.0 { *b } else { between(a, b, part) }
}

/// Blends only the bones that are `chosen`.
pub(super) fn blend_some(a: &Pose, b: &Pose, part: f64, chosen: &[bool]) -> Pose {
    let bones = a.parent_from_bone.iter().zip(&b.parent_from_bone).zip(chosen);
    Pose { parent_from_bone: bones.map(|((a, b), chosen)| if *chosen { towards(a, b, part) } else { *a }).collect() }
}

/// From 0 to 1 without a jump in speed.
pub(super) fn ease(part: f64) -> f64 {
    let part = part.clamp(0.0, 1.0);
    part * part * (3.0 - 2.0 * part)
}

/// How much counts at a time of what holds from one time to another, and comes and goes over `fade` inside of them.
pub(super) fn inside(time: i64, from: i64, to: i64, fade: i64) -> f64 {
    if !(from..=to).contains(&time) {
        return 0.0;
    }
    if fade <= 0 {
        return 1.0;
    }
    let fade = fade as f64;
    ease((time - from) as f64 / fade).min(ease((to - time) as f64 / fade))
}

/// The bones of these names and everything below them; an unknown name is returned.
pub(super) fn chosen(skeleton: &Skeleton, names: &[String]) -> Result<Vec<bool>, String> {
    let mut chosen = vec![false; skeleton.len()];
    for name in names {
        let bone = skeleton.find(name).ok_or_else(|| name.clone())?;
        chosen[bone] = true;
    }
    for (bone, own) in skeleton.bones().iter().enumerate() {
        chosen[bone] |= own.parent.is_some_and(|parent| chosen[parent]);
    }
    Ok(chosen)
}

/// Like [`chosen`], but no names are all bones.
pub(super) fn chosen_or_all(skeleton: &Skeleton, names: &[String]) -> Result<Vec<bool>, String> {
    if names.is_empty() { Ok(vec![true; skeleton.len()]) } else { chosen(skeleton, names) }
}
