//! One clip as a glTF animation.

use armature_rig::{Skeleton, Transform};
use glam::Quat;
use gltf_json::accessor::{Accessor, Type};
use gltf_json::animation::{Animation, Channel, Interpolation, Property, Sampler, Target};
use gltf_json::scene::Node;
use gltf_json::validation::Checked;
use gltf_json::{Extras, Index};

use super::buffer::Builder;
use super::scene::{GlbClip, GlbMesh, GlbTimes, bad};
use super::write_surface::MeshNode;
use crate::FormatError;

/// Adds the clip; bones that stay at rest throughout get no channel.
#[expect(clippy::float_cmp, reason = "a bone that was never touched is at rest bit for bit")]
pub(super) fn write_clip(
    builder: &mut Builder,
    skeleton: &Skeleton,
    clip: &GlbClip,
    joints: &[Index<Node>],
    meshes: &[MeshNode],
    surface: Option<&GlbMesh>,
) -> Result<(), FormatError> {
    let times = key_times(clip)?;
    check_poses(skeleton, clip)?;
    check_weights(surface, clip)?;
    let input = builder.floats(&times, Type::Scalar, None);
    let mut animation = Animation {
        extensions: None,
        extras: Extras::default(),
        channels: Vec::new(),
        name: Some(clip.name.to_owned()),
        samplers: Vec::new(),
    };
    for (bone, joint) in skeleton.bones().iter().enumerate().map(|(i, bone)| ((i, bone.rest), joints[i])) {
        let (index, rest) = bone;
        let track = || clip.poses.iter().map(move |pose| pose.parent_from_bone[index]);
        let moves = |part: fn(&Transform) -> [f32; 4]| track().any(|t| part(&t) != part(&rest));
        let mut channel = |property, output| add(&mut animation, input, joint, property, output);
        if moves(|t| t.translation.extend(0.0).to_array()) {
            let values: Vec<[f32; 3]> = track().map(|t| t.translation.to_array()).collect();
            channel(Property::Translation, builder.floats(&values, Type::Vec3, None));
        }
        // An animation needs a channel, even if nothing moves.
        if !clip.poses.is_empty() && (index == 0 || moves(|t| t.rotation.to_array())) {
            let values = continuous(track().map(|t| t.rotation));
            channel(Property::Rotation, builder.floats(&values, Type::Vec4, None));
        }
        if moves(|t| t.scale.extend(0.0).to_array()) {
            let values: Vec<[f32; 3]> = track().map(|t| t.scale.to_array()).collect();
            channel(Property::Scale, builder.floats(&values, Type::Vec3, None));
        }
    }
    for MeshNode { node, targets } in meshes.iter().filter(|mesh| !mesh.targets.is_empty()) {
        let rest = |target: usize| surface.map_or(0.0, |surface| surface.morph_targets[target].default_weight);
        if clip.weights.iter().any(|row| targets.iter().any(|&target| row[target] != rest(target))) {
            let rows = clip.weights.iter().flat_map(|row| targets.iter().map(|&target| [row[target]]));
            let values: Vec<[f32; 1]> = rows.collect();
            let output = builder.floats(&values, Type::Scalar, None);
            add(&mut animation, input, *node, Property::MorphTargetWeights, output);
        }
    }
    if animation.channels.is_empty() {
        return Ok(());
    }
    builder.root.animations.push(animation);
    Ok(())
}

fn add(
    animation: &mut Animation,
    input: Index<Accessor>,
    joint: Index<Node>,
    property: Property,
    output: Index<Accessor>,
) {
    let sampler = Sampler {
        extensions: None,
        extras: Extras::default(),
        input,
        interpolation: Checked::Valid(Interpolation::Linear),
        output,
    };
    let sampler = Index::push(&mut animation.samplers, sampler);
    let target = Target { extensions: None, extras: Extras::default(), node: joint, path: Checked::Valid(property) };
    animation.channels.push(Channel { sampler, target, extensions: None, extras: Extras::default() });
}

/// Whether every pose of a clip can be written.
pub(crate) fn check_poses(skeleton: &Skeleton, clip: &GlbClip) -> Result<(), FormatError> {
    let remedy = "Record the clip again";
    if skeleton.is_empty() || clip.keys() == 0 {
        return Err(bad(format!("the clip {:?} has no poses or moves no bones", clip.name), "Leave the clip out"));
    }
    for (index, pose) in clip.poses.iter().enumerate() {
        if pose.parent_from_bone.len() != skeleton.len() {
            let (have, need) = (pose.parent_from_bone.len(), skeleton.len());
            let what = format!("pose {index} of {:?} moves {have} bones, but the skeleton has {need}", clip.name);
            return Err(bad(what, remedy));
        }
        let usable = |t: &Transform| t.is_finite() && t.rotation.length_squared() > 0.25;
        if !pose.parent_from_bone.iter().all(usable) {
            return Err(bad(format!("pose {index} of {:?} is not finite", clip.name), remedy));
        }
    }
    Ok(())
}

/// Whether the weights of a clip's morph targets can be written with this surface.
pub(crate) fn check_weights(surface: Option<&GlbMesh>, clip: &GlbClip) -> Result<(), FormatError> {
    if clip.weights.is_empty() {
        return Ok(());
    }
    let wrong = |what: String| Err(bad(format!("the clip {:?} {what}", clip.name), "Record the clip again"));
    let targets = surface.map_or(0, |surface| surface.morph_targets.len());
    if clip.weights.len() != clip.keys() {
        return wrong(format!("has {} poses and weights for {}", clip.keys(), clip.weights.len()));
    }
    for (key, row) in clip.weights.iter().enumerate() {
        if row.len() != targets {
            return wrong(format!("has {} weights at pose {key}, but the mesh has {targets} morph targets", row.len()));
        }
        if !row.iter().all(|weight| weight.is_finite()) {
            return wrong(format!("has a weight at pose {key} that is not finite"));
        }
    }
    Ok(())
}

/// The time of every pose in seconds, strictly increasing.
pub(crate) fn clip_seconds(clip: &GlbClip) -> Result<Vec<f64>, FormatError> {
    let wrong = |what: &str| bad(format!("the clip {:?} {what}", clip.name), "Record the clip again");
    let seconds: Vec<f64> = match clip.times {
        GlbTimes::EverySeconds(step) if step.is_finite() && step > 0.0 => {
            (0..clip.keys()).map(|k| k as f64 * step).collect()
        }
        GlbTimes::EverySeconds(_) => return Err(wrong("has frames of zero length")),
        GlbTimes::At(times) if times.len() == clip.keys() => times.to_vec(),
        GlbTimes::At(_) => return Err(wrong("has different numbers of times and poses")),
    };
    if !seconds.iter().all(|s| s.is_finite() && (*s as f32).is_finite() && *s >= 0.0) {
        return Err(wrong("has a time that is negative or not finite"));
    }
    if seconds.windows(2).any(|w| w[1] <= w[0]) {
        return Err(wrong("has times that do not increase"));
    }
    Ok(seconds)
}

/// The same in single precision.
fn key_times(clip: &GlbClip) -> Result<Vec<[f32; 1]>, FormatError> {
    let seconds = clip_seconds(clip)?;
    let mut out: Vec<[f32; 1]> = Vec::with_capacity(seconds.len());
    for second in seconds {
        // Late in a long take, two times may round to the same number.
        let after = out.last().map_or(0.0, |[last]| last.next_up());
        out.push([(second as f32).max(after)]);
    }
    Ok(out)
}

/// Unit quaternions, each with the sign closer to the one before.
pub(crate) fn continuous(rotations: impl Iterator<Item = Quat>) -> Vec<[f32; 4]> {
    let mut last = Quat::IDENTITY;
    let mut out = Vec::new();
    for rotation in rotations {
        let unit = rotation.normalize();
        last = if unit.dot(last) < 0.0 { -unit } else { unit };
        out.push(last.to_array());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_rise_even_where_they_round_to_one() {
        let poses = vec![armature_rig::Pose::default(); 3];
        let times = [1e6, 1e6 + 1e-4, 1e6 + 2e-4];
        let clip = GlbClip { name: "long", times: GlbTimes::At(&times), poses: &poses, weights: &[] };
        let keys = key_times(&clip).unwrap();
        assert!(keys.windows(2).all(|w| w[0][0] < w[1][0]), "{keys:?}");
        for bad in [[0.0, 0.0, 1.0], [0.0, 2.0, 1.0], [-1.0, 0.0, 1.0], [0.0, f64::NAN, 1.0]] {
            assert!(key_times(&GlbClip { times: GlbTimes::At(&bad), ..clip }).is_err());
        }
        assert!(key_times(&GlbClip { times: GlbTimes::EverySeconds(0.0), ..clip }).is_err());
    }

    #[test]
    fn turns_keep_to_one_side() {
        let turns = [Quat::from_rotation_x(0.1), -Quat::from_rotation_x(0.2), Quat::from_rotation_x(0.3)];
        let out = continuous(turns.into_iter());
        assert!(out.windows(2).all(|w| w[0].iter().zip(w[1]).map(|(a, b)| a * b).sum::<f32>() > 0.9));
    }
}
