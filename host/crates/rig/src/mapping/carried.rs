//! Joints that drive no bone of their own still turn what hangs below them.

use std::collections::{BTreeMap, BTreeSet};

use glam::{Affine3A, Quat};

use super::entries::{Mapping, MappingEntry};
use crate::puppet::{JointTree, PartUid};
use crate::skeleton::Skeleton;

/// What goes into [`Mapping::carried`] for this puppet: every joint that `mapping` leaves without a bone turns the bones of
/// the next joints below it that have one.
///
/// `likely`: the bones that such joints would drive by their place in the puppet ([`propose`](super::propose())). A joint
/// lies in the rest pose as that bone does, or, if it is in none of them, as the bone that it turns.
pub fn carried(tree: &JointTree, mapping: &Mapping, likely: &Mapping, skeleton: &Skeleton) -> Vec<MappingEntry> {
    let by_part = |mapping: &'_ Mapping| -> BTreeMap<PartUid, usize> {
        let bone = |entry: &MappingEntry| Some((entry.part, skeleton.find(&entry.bone)?));
        mapping.entries.iter().filter_map(bone).collect()
    };
    let (driven, likely) = (by_part(mapping), by_part(likely));
    let model_from_bone = skeleton.rest_model_from_bone();
    let parts = tree.parts();
    let mut turned: BTreeSet<(usize, usize)> = BTreeSet::new();
    for part in parts {
        let Some(&bone) = driven.get(&part.uid) else { continue };
        let mut above = part.parent;
        while let Some(index) = above.filter(|&index| !driven.contains_key(&parts[index].uid)) {
            if !parts[index].kind.axes().is_empty() {
                turned.insert((index, bone));
            }
            above = parts[index].parent;
        }
    }
    let entry = |(index, bone): (usize, usize)| {
        let part = parts[index].uid;
        let own = likely.get(&part).copied().unwrap_or(bone);
        let [model_from_driven, model_from_own] =
            [bone, own].map(|bone| model_from_joint(skeleton, bone, &model_from_bone));
        let mounting =
            if own == bone { Quat::IDENTITY } else { (model_from_driven.inverse() * model_from_own).normalize() };
        MappingEntry { part, bone: skeleton.bones()[bone].name.clone(), mounting }
    };
    turned.into_iter().map(entry).collect()
}

fn model_from_joint(skeleton: &Skeleton, bone: usize, model_from_bone: &[Affine3A]) -> Quat {
    let (_, model_rotation, _) = model_from_bone[bone].to_scale_rotation_translation();
    model_rotation * skeleton.bone_from_joint(bone, model_from_bone)
}
