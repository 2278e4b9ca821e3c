//! Where a bone ends if the file only says where bones start.

use armature_rig::Bone;
use glam::Vec3;

/// How far a leaf bone extends, as a fraction of the distance from its parent's head to its own.
const LEAF_FRACTION: f32 = 0.5;

/// Sets every bone's tail: the one given in `known` (in the bone's own frame), otherwise the head of its only child,
/// otherwise the mean of the heads of the children with the largest subtrees; a leaf extends in its parent's direction.
/// Bones come parents first. A root without children stays without length.
pub(crate) fn set_tails(bones: &mut [Bone], known: &[Option<Vec3>]) {
    let mut subtree = vec![1_usize; bones.len()];
    for index in (0..bones.len()).rev() {
        if let Some(parent) = bones[index].parent {
            subtree[parent] += subtree[index];
        }
    }
    let mut largest = vec![0_usize; bones.len()];
    for (index, bone) in bones.iter().enumerate() {
        if let Some(parent) = bone.parent {
            largest[parent] = largest[parent].max(subtree[index]);
        }
    }
    let mut sums = vec![(Vec3::ZERO, 0_u16); bones.len()];
    for (index, bone) in bones.iter().enumerate() {
        if let Some(parent) = bone.parent.filter(|&p| subtree[index] == largest[p]) {
            sums[parent].0 += bone.rest.translation;
            sums[parent].1 = sums[parent].1.saturating_add(1);
        }
    }
    for (index, (sum, children)) in sums.into_iter().enumerate() {
        let given = known.get(index).copied().flatten();
        bones[index].tail = match (given, children) {
            (Some(tail), _) => tail,
            (None, 0) => leaf_tail(bones, index),
            (None, _) => sum / f32::from(children),
        };
    }
}

fn leaf_tail(bones: &[Bone], leaf: usize) -> Vec3 {
    let Some(parent) = bones[leaf].parent else { return Vec3::ZERO };
    let rest = bones[leaf].rest;
    // A leaf that starts where its parent starts has no direction of its own to extend along.
    let way = if rest.translation.length_squared() > 0.0 { rest.translation } else { bones[parent].tail };
    rest.rotation.inverse() * (way * LEAF_FRACTION) / rest.scale
}

#[cfg(test)]
mod tests {
    use armature_rig::Transform;

    use super::*;

    fn bone(parent: Option<usize>, at: [f32; 3]) -> Bone {
        Bone {
            name: String::new(),
            parent,
            rest: Transform { translation: at.into(), ..Transform::IDENTITY },
            tail: Vec3::ZERO,
        }
    }

    #[test]
    fn the_rule() {
        // 0 has the children 1 (with a child of its own), 2 (with a child) and 3 (a leaf).
        let mut bones = vec![
            bone(None, [5.0, 5.0, 5.0]),
            bone(Some(0), [1.0, 2.0, 0.0]),
            bone(Some(0), [-1.0, 2.0, 0.0]),
            bone(Some(0), [0.0, 0.0, 9.0]),
            bone(Some(1), [0.0, 4.0, 0.0]),
            bone(Some(2), [0.0, 4.0, 0.0]),
        ];
        set_tails(&mut bones, &[None, None, None, None, None, Some(Vec3::X)]);
        let tails: Vec<Vec3> = bones.iter().map(|b| b.tail).collect();
        let expected = [
            Vec3::new(0.0, 2.0, 0.0),
            Vec3::new(0.0, 4.0, 0.0),
            Vec3::new(0.0, 4.0, 0.0),
            Vec3::new(0.0, 0.0, 4.5),
            Vec3::new(0.0, 2.0, 0.0),
            Vec3::X,
        ];
        assert_eq!(tails, expected);
    }
}
