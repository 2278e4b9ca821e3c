//! Animation stacks as motions at the file's frame rate.

use armature_rig::{Motion, Pose, Transform};
use glam::{DAffine3, DVec3};
use ufbx::{AnimStack, Scene};

use super::open::transform;
use super::rig::Rig;
use crate::skeleton::frames::decompose;
use crate::text::names::UniqueNames;

/// Where the file does not say how many frames a second has.
const USUAL_RATE: f64 = 30.0;
/// The lowest and the highest rate of frames that are taken from a file.
const RATES: [f64; 2] = [24.0, 240.0];
/// Poses of all bones in one motion.
const MOST_TRANSFORMS: f64 = (1 << 24) as f64;

/// All animation stacks that move a bone, with unique names; one that cannot be used becomes a warning.
pub(super) fn read_motions(scene: &Scene, rig: &Rig, warnings: &mut Vec<String>) -> Vec<(String, Motion)> {
    let mut names = UniqueNames::default();
    let mut motions = Vec::new();
    for (index, stack) in scene.anim_stacks.iter().enumerate() {
        let name = names.give(&stack.element.name, &format!("animation_{}", index + 1));
        match motion(scene, rig, stack) {
            Ok(Some(motion)) => motions.push((name, motion)),
            Ok(None) => warnings.push(format!("The animation {name} moves no bone and is ignored.")),
            Err(why) => warnings.push(format!("The animation {name} is ignored: {why}.")),
        }
    }
    let moves_shapes = |stack: &AnimStack| {
        let values = stack.layers.iter().flat_map(|layer| layer.anim_props.iter());
        values.into_iter().any(|prop| prop.prop_name.as_ref() == "DeformPercent")
    };
    if scene.anim_stacks.iter().any(|stack| moves_shapes(stack)) {
        warnings.push("Blend shapes are not animated.".to_owned());
    }
    motions
}

/// `None` if no bone moves.
fn motion(scene: &Scene, rig: &Rig, stack: &AnimStack) -> Result<Option<Motion>, String> {
    let rate = scene.settings.frames_per_second;
    let rate = if rate.is_finite() && rate > 0.0 { rate.clamp(RATES[0], RATES[1]) } else { USUAL_RATE };
    let [begin, end] = times(stack);
    let seconds = end - begin;
    if !(seconds.is_finite() && seconds >= 0.0) {
        return Err("its times are not numbers".to_owned());
    }
    let steps = libm::round(seconds * rate);
    if (steps + 1.0) * rig.skeleton.len() as f64 > MOST_TRANSFORMS {
        return Err(format!("it lasts {seconds} s"));
    }
    // Only bones and what they hang on.
    let mut needed = vec![false; scene.nodes.len()];
    for &node in &rig.node_of_bone {
        let mut at = Some(node);
        while let Some(node) = at.filter(|&n| !needed[n]) {
            needed[node] = true;
            at = rig.parent[node];
        }
    }
    let needed: Vec<usize> = rig.order.iter().copied().filter(|&node| needed[node]).collect();
    let mut world = vec![DAffine3::IDENTITY; scene.nodes.len()];
    let mut frames: Vec<Pose> = Vec::with_capacity(steps as usize + 1);
    let mut moves = false;
    for frame in 0..=steps as usize {
        let time = begin + if steps > 0.0 { seconds * frame as f64 / steps } else { 0.0 };
        for &node in &needed {
            let found = &scene.nodes[node];
            let local = ufbx::evaluate_transform(&stack.anim, found, time);
            moves |= !same(&local, &found.local_transform);
            let local = transform(&local);
            world[node] = rig.parent[node].map_or(local, |parent| world[parent] * local);
        }
        frames.push(pose(rig, &world));
    }
    if !moves {
        return Ok(None);
    }
    let step = if steps > 0.0 { seconds / steps } else { 1.0 / rate };
    Motion::new(rig.skeleton.clone(), step, frames).map(Some).map_err(|error| error.to_string())
}

/// From when to when a stack lasts: as it says, or else from its first to its last key.
fn times(stack: &AnimStack) -> [f64; 2] {
    if stack.time_end > stack.time_begin {
        return [stack.time_begin, stack.time_end];
    }
    let values = stack.layers.iter().flat_map(|layer| layer.anim_values.iter());
    let curves = values.flat_map(|value| value.curves.iter().flatten());
    let keys = curves.flat_map(|curve| curve.keyframes.iter().map(|key| key.time)).filter(|time| time.is_finite());
    let [begin, end] =
        keys.fold([f64::INFINITY, f64::NEG_INFINITY], |[begin, end], time| [begin.min(time), end.max(time)]);
    if begin <= end { [begin, end] } else { [stack.time_begin, stack.time_begin] }
}

fn same(a: &ufbx::Transform, b: &ufbx::Transform) -> bool {
    let numbers = |t: &ufbx::Transform| {
        let ufbx::Transform { translation: p, rotation: q, scale: s } = t;
        [p.x, p.y, p.z, q.x, q.y, q.z, q.w, s.x, s.y, s.z]
    };
    numbers(a).iter().zip(numbers(b)).all(|(a, b)| (a - b).abs() < 1e-9)
}

/// The pose of all bones, without the scales that were taken out of them.
fn pose(rig: &Rig, world: &[DAffine3]) -> Pose {
    let frame = |bone: usize| {
        let unscaled = DVec3::splat(1.0 / rig.scale[bone]);
        world[rig.node_of_bone[bone]] * DAffine3::from_scale(unscaled)
    };
    let local = |(index, bone): (usize, &armature_rig::Bone)| -> Transform {
        let own = frame(index);
        let Some(parent) = bone.parent else { return decompose(own) };
        let above = frame(parent);
        if above.matrix3.determinant() == 0.0 {
            return bone.rest;
        }
        decompose(above.inverse() * own)
    };
    Pose { parent_from_bone: rig.skeleton.bones().iter().enumerate().map(local).collect() }
}
