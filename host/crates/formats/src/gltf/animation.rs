//! From animations to motion at a constant rate.

use armature_rig::{Motion, Pose, Transform};
use glam::{DAffine3, DQuat, DVec3, DVec4};
use gltf_json::animation::{Animation, Interpolation, Property};
use gltf_json::validation::Checked;

use super::accessor::MAX_ELEMENTS;
use super::container::Document;
use super::nodes::{Local, Nodes, unit, worlds};
use super::skin::Rig;
use crate::FormatError;
use crate::skeleton::frames::decompose;
use crate::text::names::UniqueNames;

/// Frames are at most this far apart, so that rotations between distant keys keep their path.
const LONGEST_FRAME_SECONDS: f64 = 1.0 / 24.0;
/// Frames are at least this far apart, however close two keys are.
const SHORTEST_FRAME_SECONDS: f64 = 1.0 / 240.0;

/// The keys of one node's translation, rotation or scale.
#[derive(Debug)]
struct Track {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    times: Vec<f64>,
    /// One value per key, or in-tangent, value, out-tangent for cubic splines.
    values: Vec<DVec4>,
}

/// All animations that move the rig, with unique names; one that cannot be used becomes a warning.
///
/// A motion starts at the animation's first key. Its frame spacing is that of the animation's closest keys, or an even
/// fraction of it, so that evenly spaced keys fall on frames; the last key is the last frame.
pub(super) fn read_motions(
    document: &Document,
    nodes: &Nodes,
    rig: &Rig,
    warnings: &mut Vec<String>,
) -> Result<Vec<(String, Motion)>, FormatError> {
    let mut names = UniqueNames::default();
    let mut motions = Vec::new();
    for (index, animation) in document.root.animations.iter().enumerate() {
        let name = names.give(animation.name.as_deref().unwrap_or_default(), &format!("animation_{}", index + 1));
        let tracks = tracks(document, animation, warnings)?;
        if tracks.is_empty() {
            warnings.push(format!("The animation {name} moves no bone and is ignored."));
            continue;
        }
        match resample(nodes, rig, &tracks) {
            Ok(motion) => motions.push((name, motion)),
            Err(why) => warnings.push(format!("The animation {name} is ignored: {why}.")),
        }
    }
    Ok(motions)
}

fn tracks(document: &Document, animation: &Animation, warnings: &mut Vec<String>) -> Result<Vec<Track>, FormatError> {
    let mut out = Vec::new();
    let mut morphs = false;
    for channel in &animation.channels {
        let sampler = document.get(&animation.samplers, channel.sampler, "animation sampler")?;
        document.get(&document.root.nodes, channel.target.node, "node")?;
        let (Checked::Valid(property), Checked::Valid(interpolation)) = (channel.target.path, sampler.interpolation)
        else {
            return Err(document.error("an animation channel has no valid path or interpolation"));
        };
        let values: Vec<DVec4> = match property {
            Property::MorphTargetWeights => {
                morphs = true;
                continue;
            }
            Property::Rotation => {
                document.floats::<4>(sampler.output)?.into_iter().map(|v| DVec4::from(v.map(f64::from))).collect()
            }
            Property::Translation | Property::Scale => document
                .floats::<3>(sampler.output)?
                .into_iter()
                .map(|v| DVec3::from(v.map(f64::from)).extend(0.0))
                .collect(),
        };
        let times: Vec<f64> = document.floats::<1>(sampler.input)?.into_iter().map(|[t]| f64::from(t)).collect();
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if times.is_empty() || values.len() != times.len() * per_key {
            let what = format!("an animation has {} keys but {} values", times.len(), values.len());
            return Err(document.error(what));
        }
        if times.windows(2).any(|w| w[1] <= w[0]) {
            return Err(document.error("the keys of an animation are not in time order"));
        }
        out.push(Track { node: channel.target.node.value(), property, interpolation, times, values });
    }
    if morphs {
        warnings.push("Morph targets are not animated.".to_owned());
    }
    Ok(out)
}

fn resample(nodes: &Nodes, rig: &Rig, tracks: &[Track]) -> Result<Motion, String> {
    let start = tracks.iter().map(|t| t.times[0]).fold(f64::INFINITY, f64::min);
    let end = tracks.iter().filter_map(|t| t.times.last().copied()).fold(f64::NEG_INFINITY, f64::max);
    let gaps = tracks.iter().flat_map(|t| t.times.windows(2)).map(|w| w[1] - w[0]);
    let gap = gaps.fold(f64::INFINITY, f64::min).clamp(SHORTEST_FRAME_SECONDS, (end - start).max(1.0));
    let step = gap / libm::ceil(gap / LONGEST_FRAME_SECONDS - 1e-6).max(1.0);
    let steps = libm::round((end - start) / step);
    if (steps + 1.0) * rig.skeleton.len() as f64 > MAX_ELEMENTS as f64 {
        return Err(format!("it lasts {} s", end - start));
    }
    // Rounding the number of frames instead of their length keeps the last key on the last frame.
    let step = if steps > 0.0 { (end - start) / steps } else { step };
    let frames: Vec<Pose> =
        (0..=steps as usize).map(|frame| pose(nodes, rig, tracks, start + frame as f64 * step)).collect();
    Motion::new(rig.skeleton.clone(), step, frames).map_err(|error| error.to_string())
}

fn pose(nodes: &Nodes, rig: &Rig, tracks: &[Track], time: f64) -> Pose {
    let mut local: Vec<Local> = nodes.local.clone();
    for track in tracks {
        let value = sample(track, time);
        // What is animated is no longer the matrix that the file gives.
        local[track.node].whole = None;
        match track.property {
            Property::Translation => local[track.node].translation = value.truncate(),
            Property::Scale => local[track.node].scale = value.truncate(),
            Property::Rotation => {
                let rotation = DQuat::from_vec4(value);
                local[track.node].rotation = unit(rotation).unwrap_or(local[track.node].rotation);
            }
            Property::MorphTargetWeights => {}
        }
    }
    let world = worlds(&nodes.order, &nodes.parent, &local);
    let mut parent_from_bone: Vec<Transform> = Vec::with_capacity(rig.node_of_bone.len());
    for (bone, &node) in rig.node_of_bone.iter().enumerate() {
        let parent_bone = rig.skeleton.bones()[bone].parent;
        let parent_node = parent_bone.map(|p| rig.node_of_bone[p]);
        parent_from_bone.push(if parent_node == nodes.parent[node] && local[node].whole.is_none() {
            // Nothing in between: the file's own numbers.
            Transform {
                translation: local[node].translation.as_vec3(),
                rotation: local[node].rotation.as_quat(),
                scale: local[node].scale.as_vec3(),
            }
        } else {
            decompose(parent_node.map_or(world[node], |p| relative_to(&world, p, node, nodes, &local)))
        });
    }
    Pose { parent_from_bone }
}

/// `parent_from_node`, also where the parent is scaled to nothing.
fn relative_to(world: &[DAffine3], parent: usize, node: usize, nodes: &Nodes, local: &[Local]) -> DAffine3 {
    if world[parent].matrix3.determinant() != 0.0 {
        return world[parent].inverse() * world[node];
    }
    let mut out = DAffine3::IDENTITY;
    let mut at = Some(node);
    while let Some(node) = at.filter(|&n| n != parent) {
        out = local[node].affine() * out;
        at = nodes.parent[node];
    }
    out
}

fn sample(track: &Track, time: f64) -> DVec4 {
    let last = track.times.len() - 1;
    let cubic = track.interpolation == Interpolation::CubicSpline;
    let value = |key: usize| track.values[if cubic { 3 * key + 1 } else { key }];
    let next = track.times.partition_point(|&t| t <= time);
    let Some(key) = next.checked_sub(1) else { return value(0) };
    if key == last {
        return value(last);
    }
    let span = track.times[key + 1] - track.times[key];
    let s = (time - track.times[key]) / span;
    match (track.interpolation, track.property) {
        (Interpolation::Step, _) => value(key),
        (Interpolation::Linear, Property::Rotation) => {
            let ends = [value(key), value(key + 1)].map(|v| unit(DQuat::from_vec4(v)).unwrap_or(DQuat::IDENTITY));
            DVec4::from(ends[0].slerp(ends[1], s))
        }
        (Interpolation::Linear, _) => value(key).lerp(value(key + 1), s),
        (Interpolation::CubicSpline, _) => {
            let (out_tangent, in_tangent) = (track.values[3 * key + 2] * span, track.values[3 * key + 3] * span);
            let (s2, s3) = (s * s, s * s * s);
            value(key) * (2.0 * s3 - 3.0 * s2 + 1.0)
                + out_tangent * (s3 - 2.0 * s2 + s)
                + value(key + 1) * (3.0 * s2 - 2.0 * s3)
                + in_tangent * (s3 - s2)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, property: Property, times: &[f64], values: &[DVec4]) -> Track {
        Track { node: 0, property, interpolation, times: times.to_vec(), values: values.to_vec() }
    }

    #[test]
    fn the_three_interpolations() {
        let x = |v: f64| DVec4::new(v, 0.0, 0.0, 0.0);
        let times = [1.0, 3.0];
        let linear = track(Interpolation::Linear, Property::Translation, &times, &[x(2.0), x(6.0)]);
        let got: Vec<f64> = [0.0, 1.0, 2.0, 3.0, 4.0].iter().map(|&t| sample(&linear, t).x).collect();
        assert_eq!(got, [2.0, 2.0, 4.0, 6.0, 6.0]);
        let step = track(Interpolation::Step, Property::Translation, &times, &[x(2.0), x(6.0)]);
        assert_eq!([sample(&step, 2.999).x, sample(&step, 3.0).x], [2.0, 6.0]);
        // A cubic with the values and slopes of t³ at 1 and 3 is t³.
        let values = [x(0.0), x(1.0), x(3.0), x(27.0), x(27.0), x(0.0)];
        let cubic = track(Interpolation::CubicSpline, Property::Translation, &times, &values);
        for t in [1.0, 1.3, 2.0, 2.9, 3.0] {
            assert!((sample(&cubic, t).x - t * t * t).abs() < 1e-12);
        }
    }

    #[test]
    fn turns_take_the_short_way() {
        let turn = |degrees: f64| DVec4::from(DQuat::from_rotation_z(degrees.to_radians()));
        let keys = [turn(170.0), -turn(190.0)];
        let track = track(Interpolation::Linear, Property::Rotation, &[0.0, 1.0], &keys);
        let half = DQuat::from_vec4(sample(&track, 0.5));
        assert!(half.angle_between(DQuat::from_rotation_z(std::f64::consts::PI)) < 1e-6);
    }
}
