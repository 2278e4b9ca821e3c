//! Which bones a puppet drives, which are held, and which must be solved for.

use armature_rig::Skeleton;

use super::pinned_bone::PinHold;

/// What determines how a bone is turned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoneRole {
    /// A joint of the puppet.
    Driven,
    /// Nothing turns it: it is pinned, or it is the base that the puppet stands on.
    Held,
    /// Inverse kinematics: it is between bones that are driven or held.
    Solved,
    /// A target says how it is turned.
    Dragged,
    /// Its parent, which it follows rigidly: nothing driven or held hangs on it.
    Follows,
}

/// What targets ask of a bone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Dragged {
    /// Bones above it have to move for it.
    pub(super) reached: bool,
    /// Its orientation is given.
    pub(super) turned: bool,
}

/// Rigs often start with bones that mark the ground; the pelvis after them is as much a base as they are.
pub(super) fn bases(skeleton: &Skeleton, driven: &[bool], moves: &[bool]) -> Vec<bool> {
    let mut base: Vec<bool> = Vec::with_capacity(skeleton.len());
    for bone in skeleton.bones() {
        base.push(bone.parent.is_none_or(|p| base[p] && !moves[p] && !driven[p]));
    }
    base
}

/// The role of every bone, in the skeleton's order.
///
/// `driven`: whether a joint turns it; `pins`: what of it is held; `moves`: whether part of the shape follows it. A
/// bone that moves nothing cannot be solved from the shape and follows its parent. `dragged`: what targets ask for; a joint
/// has the last word. `free_roots`: roots of trees of which
/// nothing is asked are no base.
pub(super) fn bone_roles(
    skeleton: &Skeleton,
    driven: &[bool],
    pins: &[Option<PinHold>],
    moves: &[bool],
    dragged: &[Dragged],
    free_roots: bool,
) -> Vec<BoneRole> {
    let bones = skeleton.bones();
    let mut base = bases(skeleton, driven, moves);
    if free_roots {
        let asked = |bone: usize| driven[bone] || pins[bone].is_some() || dragged[bone] != Dragged::default();
        let mut is_asked: Vec<bool> = (0..bones.len()).map(asked).collect();
        for bone in (0..bones.len()).rev() {
            if let Some(parent) = bones[bone].parent {
                is_asked[parent] |= is_asked[bone];
            }
        }
        // Where nothing is asked of a tree, it may go with the shape.
        base.iter_mut().zip(is_asked).for_each(|(base, is_asked)| *base &= is_asked);
    }
    let given = |bone: usize| driven[bone] || pins[bone] == Some(PinHold::Fixed) || base[bone];
    // Anything held further down makes the bones above it move.
    let needs = |bone: usize| given(bone) || pins[bone].is_some() || dragged[bone] != Dragged::default();
    let mut leads = vec![false; bones.len()];
    for bone in (0..bones.len()).rev() {
        if let Some(parent) = bones[bone].parent {
            leads[parent] |= leads[bone] || needs(bone);
        }
    }
    (0..bones.len())
        .map(|bone| match given(bone) {
            true if driven[bone] => BoneRole::Driven,
            _ if dragged[bone].turned => BoneRole::Dragged,
            true => BoneRole::Held,
            false if (leads[bone] || pins[bone].is_some() || dragged[bone].reached) && moves[bone] => BoneRole::Solved,
            false => BoneRole::Follows,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use armature_rig::{Bone, Transform};

    use super::*;
    use BoneRole::{Driven, Follows, Held, Solved};

    /// ground → hips → (chest → arm → hand), (thigh → hub → shin → foot)
    const PARENTS: [Option<usize>; 9] = [None, Some(0), Some(1), Some(2), Some(3), Some(1), Some(5), Some(6), Some(7)];

    fn roles(driven: &[usize], pinned: &[usize]) -> Vec<BoneRole> {
        let bone = |(index, parent): (usize, &Option<usize>)| Bone {
            name: index.to_string(),
            parent: *parent,
            rest: Transform::IDENTITY,
            tail: glam::Vec3::Y,
        };
        let skeleton = Skeleton::new(PARENTS.iter().enumerate().map(bone).collect()).unwrap();
        let flags = |chosen: &[usize]| (0..9).map(|b| chosen.contains(&b)).collect::<Vec<_>>();
        let moves: Vec<bool> = (0..9).map(|b| b != 0 && b != 6).collect();
        let pins: Vec<Option<PinHold>> = flags(pinned).iter().map(|pinned| pinned.then_some(PinHold::Fixed)).collect();
        bone_roles(&skeleton, &flags(driven), &pins, &moves, &[Dragged::default(); 9], false)
    }

    #[test]
    fn what_lies_between_is_solved_and_what_hangs_free_goes_along() {
        let found = roles(&[3, 5], &[0]);
        assert_eq!(found, [Held, Held, Solved, Driven, Follows, Driven, Follows, Follows, Follows]);
    }

    #[test]
    fn a_pinned_foot_makes_the_shin_solved_but_not_the_hub() {
        let found = roles(&[3, 5], &[8]);
        assert_eq!(found, [Held, Held, Solved, Driven, Follows, Driven, Follows, Solved, Held]);
    }

    #[test]
    fn a_driven_base_is_driven() {
        assert_eq!(roles(&[1], &[0])[..3], [Held, Driven, Follows]);
    }
}
