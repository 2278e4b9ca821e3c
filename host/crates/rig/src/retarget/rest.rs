//! The target's rest pose with its limbs where the source's are at rest.

use glam::{DMat3, DQuat, DVec3};

use super::frames::{Frame, shortest};
use super::pairs::Pairs;
use crate::recognise::{HumanoidBone, HumanoidPart, Recognition, Side};
use crate::skeleton::Skeleton;

/// Rotations of the target's bones at rest, in model space, limb by limb turned to where the source's point.
pub(super) fn matched_rest(
    pairs: &Pairs,
    target: &Skeleton,
    source_rest: &[Frame],
    target_rest: &[Frame],
    facing: DQuat,
) -> Vec<DQuat> {
    let mut turned: Vec<DQuat> = Vec::with_capacity(target.len());
    for (index, bone) in target.bones().iter().enumerate() {
        let above = bone.parent.map_or(DQuat::IDENTITY, |parent| turned[parent]);
        let limb = pairs.of_target[index].zip(pairs.next(target, index));
        let turn = limb.map(|(source, [source_end, target_end])| {
            let own = above * (target_rest[target_end].head - target_rest[index].head);
            let theirs = facing * (source_rest[source_end].head - source_rest[source].head);
            shortest(own, theirs)
        });
        turned.push(turn.map_or(above, |turn| (turn * above).normalize()));
    }
    turned.iter().zip(target_rest).map(|(turn, frame)| (*turn * frame.rotation).normalize()).collect()
}

/// The turn, in quarters, that makes the source look where the target does and stand as it does.
pub(super) fn facing(pairs: &Pairs, source_rest: &[Frame], target_rest: &[Frame]) -> DQuat {
    let (Some(own), Some(wanted)) = (axes(&pairs.source, source_rest), axes(&pairs.target, target_rest)) else {
        return DQuat::IDENTITY;
    };
    let turn = wanted * own.transpose();
    let columns = [turn.x_axis, turn.y_axis, turn.z_axis].map(|column| {
        let axis = column.abs().max_position();
        let mut whole = DVec3::ZERO;
        whole[axis] = column[axis].signum();
        whole
    });
    let whole = DMat3::from_cols(columns[0], columns[1], columns[2]);
    if (whole.determinant() - 1.0).abs() < 1e-9 { DQuat::from_mat3(&whole).normalize() } else { DQuat::IDENTITY }
}

/// Left, up and front of a figure at rest.
fn axes(recognition: &Recognition, rest: &[Frame]) -> Option<DMat3> {
    let head = |part, side| Some(rest[recognition.find(HumanoidBone { part, side: Some(side) })?].head);
    let both = |part| Some([head(part, Side::Left)?, head(part, Side::Right)?]);
    let [leg_left, leg_right] = both(HumanoidPart::UpperLeg)?;
    let [arm_left, arm_right] = both(HumanoidPart::UpperArm)?;
    let up = (0.5 * (arm_left + arm_right) - 0.5 * (leg_left + leg_right)).try_normalize()?;
    let across = leg_left - leg_right;
    let left = (across - across.dot(up) * up).try_normalize()?;
    Some(DMat3::from_cols(left, up, left.cross(up)))
}
