//! From motion to BVH.

use std::fmt::Write as _;

use armature_rig::{Motion, Pose, Skeleton};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::FormatError;
use crate::text::names::UniqueNames;

/// A translation that differs from rest by less than this fraction of the skeleton's size counts as rest.
const REST_TOLERANCE: f64 = 1e-6;

/// How to write BVH.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BvhSettings {
    /// The order of the channels of rotations: the axes (x = 0), from the one that is turned about last.
    pub order: [usize; 3],
    /// What lengths are multiplied by: 100 for centimetres of a character in metres.
    pub scale: f64,
}

impl Default for BvhSettings {
    fn default() -> Self {
        Self { order: [2, 0, 1], scale: 1.0 }
    }
}

/// Writes a motion as BVH with [`BvhSettings::default`]; see [`write_bvh_as`].
/// ```
/// use armature_formats::motion::write_bvh;
/// use armature_rig::{Bone, Motion, Skeleton, Transform};
///
/// let rest = Transform { translation: [0.0, 1.0, 0.0].into(), ..Transform::IDENTITY };
/// let hips = Bone { name: "hips".into(), parent: None, rest, tail: [0.0, 0.2, 0.0].into() };
/// let skeleton = Skeleton::new(vec![hips]).unwrap();
/// let frames = vec![skeleton.rest_pose(); 2];
/// let text = write_bvh(&Motion::new(skeleton, 0.04, frames).unwrap())?;
/// assert!(text.contains("ROOT hips") && text.contains("Frames: 2"));
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn write_bvh(motion: &Motion) -> Result<String, FormatError> {
    write_bvh_as(motion, &BvhSettings::default())
}

/// Writes a motion as BVH: the root with six channels, the other joints with three, or every joint with six if any
/// frame moves a bone away from its rest translation or a bone is scaled.
///
/// BVH has neither rest rotations nor scales. Here joints rest without rotation, at the rest positions of the bones'
/// heads, and rotate by what takes each bone from its rest to its pose in model space: joint positions and limb
/// directions are those of the motion at every frame. Joints come depth first, one per bone; blanks and braces in names
/// become underscores.
pub fn write_bvh_as(motion: &Motion, settings: &BvhSettings) -> Result<String, FormatError> {
    let BvhSettings { order: axes, scale } = *settings;
    let is_order = (0..3).all(|axis| axes.contains(&axis));
    if !(is_order && scale.is_finite() && scale > 0.0) {
        let what = format!("{axes:?} is no order of axes, or {scale} no scale");
        return Err(FormatError::whole("BVH", what, "Name each axis once, and a positive factor"));
    }
    let skeleton = &motion.skeleton;
    if skeleton.is_empty() {
        return Err(FormatError::whole("BVH", "a skeleton without bones cannot be written", "Export with a skeleton"));
    }
    let rest = model_from_bone(skeleton, &skeleton.rest_pose());
    let heads: Vec<DVec3> = rest.iter().map(|frame| frame.translation).collect();
    let offset = |bone: usize| skeleton.bones()[bone].parent.map_or(heads[bone], |parent| heads[bone] - heads[parent]);
    let offsets: Vec<DVec3> = (0..skeleton.len()).map(offset).collect();
    let rest_inverse: Vec<DMat3> = rest.iter().map(|frame| frame.matrix3.inverse()).collect();
    let frames: Vec<Vec<Joint>> = motion.frames.iter().map(|pose| joints(skeleton, &rest_inverse, pose)).collect();

    let tolerance = REST_TOLERANCE * extent(&heads);
    let moves = |joint: &Joint, offset: &DVec3| !(joint.position - *offset).abs().cmple(DVec3::splat(tolerance)).all();
    let all_move = frames.iter().any(|joints| {
        let inner = joints.iter().zip(&offsets).zip(skeleton.bones()).filter(|(_, bone)| bone.parent.is_some());
        inner.into_iter().any(|((joint, offset), _)| moves(joint, offset))
    });

    let mut out = String::from("HIERARCHY\n");
    let hierarchy = Hierarchy { skeleton, rest: &rest, offsets: &offsets, all_move, settings };
    let order = write_hierarchy(&mut out, &hierarchy);
    let _ = writeln!(out, "MOTION\nFrames: {}\nFrame Time: {}", frames.len(), motion.frame_seconds);
    let mut previous = vec![[0.0; 3]; skeleton.len()];
    for joints in &frames {
        for (column, &bone) in order.iter().enumerate() {
            let joint = &joints[bone];
            if column > 0 {
                out.push(' ');
            }
            if all_move || skeleton.bones()[bone].parent.is_none() {
                let [x, y, z] = (scale * joint.position).to_array().map(Length);
                let _ = write!(out, "{x} {y} {z} ");
            }
            previous[bone] = nearest_angles(joint.rotation, axes, previous[bone]);
            let [a, b, c] = previous[bone].map(Angle);
            let _ = write!(out, "{a} {b} {c}");
        }
        out.push('\n');
    }
    Ok(out)
}

/// One joint at one frame, relative to its parent.
struct Joint {
    position: DVec3,
    rotation: DMat3,
}

/// A length with all the digits of single precision.
struct Length(f64);

impl std::fmt::Display for Length {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        // Adding zero turns -0 into 0.
        write!(f, "{}", self.0 as f32 + 0.0)
    }
}

/// Degrees, to a millionth.
struct Angle(f64);

impl std::fmt::Display for Angle {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let millionths = libm::round(self.0.to_degrees() * 1e6) + 0.0;
        write!(f, "{:.6}", millionths / 1e6)
    }
}

/// Forward kinematics in double precision.
fn model_from_bone(skeleton: &Skeleton, pose: &Pose) -> Vec<DAffine3> {
    let mut out: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for (bone, local) in skeleton.bones().iter().zip(&pose.parent_from_bone) {
        let local = DAffine3::from_scale_rotation_translation(
            local.scale.as_dvec3(),
            local.rotation.as_dquat().normalize(),
            local.translation.as_dvec3(),
        );
        out.push(bone.parent.map_or(local, |parent| out[parent] * local));
    }
    out
}

fn joints(skeleton: &Skeleton, rest_inverse: &[DMat3], pose: &Pose) -> Vec<Joint> {
    let frames = model_from_bone(skeleton, pose);
    // What takes the bone's rest directions to its posed ones, in model space.
    let turns: Vec<DMat3> =
        frames.iter().zip(rest_inverse).map(|(frame, inverse)| rotation_part(frame.matrix3 * *inverse)).collect();
    let relative = |(index, bone): (usize, &armature_rig::Bone)| match bone.parent {
        None => Joint { position: frames[index].translation, rotation: turns[index] },
        Some(parent) => {
            let back = turns[parent].transpose();
            Joint {
                position: back * (frames[index].translation - frames[parent].translation),
                rotation: back * turns[index],
            }
        }
    };
    skeleton.bones().iter().enumerate().map(relative).collect()
}

/// The rotation of a matrix that may also scale; the identity if nothing of it is left.
fn rotation_part(m: DMat3) -> DMat3 {
    let x = m.x_axis.try_normalize();
    let y = x.and_then(|x| (m.y_axis - x * x.dot(m.y_axis)).try_normalize());
    match (x, y) {
        (Some(x), Some(y)) => DMat3::from_quat(DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize()),
        _ => DMat3::IDENTITY,
    }
}

fn extent(points: &[DVec3]) -> f64 {
    let low = points.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = points.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    (high - low).length()
}

/// Angles about three axes with R₁·R₂·R₃ = `r`: of the two solutions and their full turns, the one nearest to the last
/// frame's, so that curves do not jump.
fn nearest_angles(r: DMat3, [i, j, k]: [usize; 3], last: [f64; 3]) -> [f64; 3] {
    use std::f64::consts::PI;
    // Orders that are no rotation of X, Y, Z are their mirror images, in which angles change their signs.
    let sign = if (i + 1) % 3 == j { 1.0 } else { -1.0 };
    let at = |row: usize, column: usize| r.col(column)[row];
    let (sin, cos) = (sign * at(i, k), at(j, k).hypot(at(k, k)));
    let second = libm::atan2(sin, cos);
    let (first, third) = if cos > 1e-9 {
        (libm::atan2(-sign * at(j, k), at(k, k)), libm::atan2(-sign * at(i, j), at(i, i)))
    } else {
        // Only the sum (or difference) of the outer angles is determined: keep the last frame's third.
        let sum = libm::atan2(sign * at(k, j), at(j, j));
        (sum - sign * sin.signum() * last[2], last[2])
    };
    let near = |angles: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|k| angles[k] + 2.0 * PI * libm::round((last[k] - angles[k]) / (2.0 * PI)))
    };
    let distance = |angles: &[f64; 3]| -> f64 { (0..3).map(|k| (angles[k] - last[k]).abs()).sum() };
    let (a, b) = (near([first, second, third]), near([first + PI, PI - second, third + PI]));
    if distance(&b) < distance(&a) { b } else { a }
}

/// The joints, and how they are written.
struct Hierarchy<'a> {
    skeleton: &'a Skeleton,
    rest: &'a [DAffine3],
    offsets: &'a [DVec3],
    all_move: bool,
    settings: &'a BvhSettings,
}

/// Writes all joints depth first and returns the bones in that order.
fn write_hierarchy(out: &mut String, hierarchy: &Hierarchy) -> Vec<usize> {
    let Hierarchy { skeleton, rest, offsets, all_move, settings } = *hierarchy;
    let turns = settings.order.map(|axis| format!("{}rotation", ["X", "Y", "Z"][axis])).join(" ");
    let mut children = vec![Vec::new(); skeleton.len()];
    let mut roots = Vec::new();
    for (index, bone) in skeleton.bones().iter().enumerate() {
        bone.parent.map_or(&mut roots, |parent| &mut children[parent]).push(index);
    }
    let mut names = UniqueNames::default();
    let mut order = Vec::with_capacity(skeleton.len());
    let mut open: Vec<std::vec::IntoIter<usize>> = vec![roots.into_iter()];
    while let Some(siblings) = open.last_mut() {
        let Some(bone) = siblings.next() else {
            open.pop();
            if !open.is_empty() {
                let _ = writeln!(out, "{}}}", "\t".repeat(open.len() - 1));
            }
            continue;
        };
        let tabs = "\t".repeat(open.len() - 1);
        let root = open.len() == 1;
        let kind = if root { "ROOT" } else { "JOINT" };
        let name = names.give(&plain_name(&skeleton.bones()[bone].name), &format!("bone_{}", bone + 1));
        let [x, y, z] = (settings.scale * offsets[bone]).to_array().map(Length);
        let channels =
            if root || all_move { format!("6 Xposition Yposition Zposition {turns}") } else { format!("3 {turns}") };
        let _ = writeln!(out, "{tabs}{kind} {name}\n{tabs}{{\n{tabs}\tOFFSET {x} {y} {z}\n{tabs}\tCHANNELS {channels}");
        if children[bone].is_empty() {
            let tail = rest[bone].transform_vector3(skeleton.bones()[bone].tail.as_dvec3());
            let [x, y, z] = (settings.scale * tail).to_array().map(Length);
            let _ = writeln!(out, "{tabs}\tEnd Site\n{tabs}\t{{\n{tabs}\t\tOFFSET {x} {y} {z}\n{tabs}\t}}");
        }
        order.push(bone);
        open.push(std::mem::take(&mut children[bone]).into_iter());
    }
    order
}

fn plain_name(name: &str) -> String {
    name.chars().map(|c| if c.is_whitespace() || c.is_control() || c == '{' || c == '}' { '_' } else { c }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_of_every_order_give_the_turn_back() {
        let about = |axis: usize, angle: f64| DMat3::from_axis_angle(DVec3::AXES[axis], angle);
        for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
            for step in 0..60 {
                let quarter = std::f64::consts::FRAC_PI_2;
                // Every tenth is at a pole.
                let second =
                    if step % 10 == 0 { quarter * f64::from(step / 10 % 2 * 2 - 1) } else { 0.4 * f64::from(step) };
                let given = [0.7 * f64::from(step), second, -1.1 * f64::from(step)];
                let turn = |angles: [f64; 3]| (0..3).fold(DMat3::IDENTITY, |all, k| all * about(order[k], angles[k]));
                let found = nearest_angles(turn(given), order, [0.3, -0.2, 0.5]);
                let off = turn(found) - turn(given);
                assert!(off.to_cols_array().iter().all(|c| c.abs() < 1e-7), "{order:?} {given:?} gives {found:?}");
            }
        }
    }
}
