//! A puppet with a joint for every bone.

use super::joint_tree::{JointTree, JointTreeError, Part, PartKind, PartUid};
use crate::skeleton::{ChildOrder, Skeleton};

/// Outlets of the largest splitter.
const MOST_OUTLETS: usize = 5;

/// A puppet with one three-axis joint per bone, and the part of every bone.
///
/// There are splitters where a bone has several children, and at the root if there are several roots; children are
/// plugged in by [`ChildOrder`]; more than five children share a chain of splitters, each carrying the next in its last
/// outlet. `uid` numbers the parts in order of creation and must give each its own number.
pub fn skeleton_puppet(
    skeleton: &Skeleton,
    counts_per_turn: u32,
    mut uid: impl FnMut(usize) -> PartUid,
) -> Result<(JointTree, Vec<usize>), JointTreeError> {
    let order = ChildOrder::new(skeleton);
    let mut parts: Vec<Part> = Vec::new();
    let mut part_of_bone = vec![0; skeleton.len()];
    let mut todo = vec![(order.roots(), None, 0)];
    while let Some((bones, parent, outlet)) = todo.pop() {
        let index = parts.len();
        let (kind, next) = match *bones {
            [] => continue,
            [bone] => {
                part_of_bone[bone] = index;
                todo.push((order.children(bone), Some(index), 0));
                (PartKind::TwistBendTwist, &[][..])
            }
            _ => (PartKind::Splitter { outlets: bones.len().min(MOST_OUTLETS) as u8 }, bones),
        };
        parts.push(Part { uid: uid(index), kind, parent, outlet, counts_per_turn });
        let (own, further) = if next.len() > MOST_OUTLETS { next.split_at(MOST_OUTLETS - 1) } else { (next, &[][..]) };
        todo.push((further, Some(index), (MOST_OUTLETS - 1) as u8));
        todo.extend(own.chunks(1).enumerate().map(|(at, bone)| (bone, Some(index), at as u8)).rev());
    }
    Ok((JointTree::new(parts)?, part_of_bone))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::{Bone, Transform};

    #[test]
    fn many_children_share_a_chain_of_splitters() {
        let bone = |name: usize, parent| Bone {
            name: name.to_string(),
            parent,
            rest: Transform::IDENTITY,
            tail: glam::Vec3::new(-(name as f32), 1.0, 0.0),
        };
        let skeleton = Skeleton::new((0..12).map(|i| bone(i, (i > 0).then_some(0))).collect()).unwrap();
        let (tree, part_of_bone) = skeleton_puppet(&skeleton, 16384, |i| PartUid([i as u8; 12])).unwrap();
        let splitters = tree.parts().iter().filter(|p| matches!(p.kind, PartKind::Splitter { .. })).count();
        assert_eq!((tree.parts().len(), splitters), (12 + 3, 3));
        assert_eq!(tree.sensor_count(), 36);
        let first = tree.parts()[part_of_bone[1]].outlet;
        assert_eq!(first, 0, "the leftmost bone is in the first outlet");
        let empty = Skeleton::default();
        assert!(skeleton_puppet(&empty, 16384, |_| PartUid::default()).unwrap().0.parts().is_empty());
    }
}
