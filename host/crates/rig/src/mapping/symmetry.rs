//! Branches of a puppet with the same shape drive limbs that are each other's mirror image.

use super::alignment::Tree;
use crate::recognise::body_plan::BoneTraits;

/// What has to be known to judge a mapping.
pub(super) struct Judge<'a, T> {
    pub(super) joints: &'a Tree<T>,
    pub(super) bone_parents: &'a [Option<usize>],
    pub(super) traits: &'a [BoneTraits],
    pub(super) pairs: &'a [(Vec<usize>, Vec<usize>)],
    /// The price of a joint on a bone, row by row one joint.
    pub(super) extra: &'a [f64],
    /// The price of a bone without a joint.
    pub(super) importance: &'a [f64],
    /// The price of a joint without a bone.
    pub(super) unused: f64,
}

impl<T> Judge<'_, T> {
    /// The mapping, or a more symmetric one that costs no more: one side of the puppet does as the other does.
    pub(super) fn symmetric(&self, found: Vec<Option<usize>>) -> Vec<Option<usize>> {
        if self.pairs.iter().all(|pair| self.is_mirrored(pair, &found)) {
            return found;
        }
        let best = self.cost(&found);
        let mut sides = [false, true].map(|second_leads| self.mirrored(&found, second_leads)).to_vec();
        sides.extend(sides.clone().iter().map(|mapping| self.arms_in_front(mapping)));
        let candidates = sides.into_iter().filter(|mapping| self.is_possible(mapping));
        let cheapest = candidates.map(|mapping| (self.cost(&mapping), mapping)).min_by(|a, b| a.0.total_cmp(&b.0));
        match cheapest {
            Some((cost, mapping)) if cost <= best + 1e-9 => mapping,
            _ => found,
        }
    }

    /// Each pair's one branch mapped as the mirror image of its other one.
    fn mirrored(&self, found: &[Option<usize>], second_leads: bool) -> Vec<Option<usize>> {
        let mut mapping = found.to_vec();
        for (first, second) in self.pairs {
            let (leads, follows) = if second_leads { (second, first) } else { (first, second) };
            for (&leader, &follower) in leads.iter().zip(follows) {
                mapping[follower] = found[leader].map(|bone| self.traits[bone].mirror.unwrap_or(bone));
            }
        }
        mapping
    }

    /// The same with arms and legs of each side exchanged where a leg comes before an arm.
    fn arms_in_front(&self, mapping: &[Option<usize>]) -> Vec<Option<usize>> {
        let mut better = mapping.to_vec();
        for side in self.pairs.iter().flat_map(|(first, second)| [first, second]) {
            let begins = |&joint: &usize| self.joints.parent[joint].is_none_or(|parent| !side.contains(&parent));
            let limbs: Vec<usize> =
                side.iter().copied().filter(begins).filter(|&joint| mapping[joint].is_some()).collect();
            let is_arm = |joint: usize| mapping[joint].is_some_and(|bone| self.traits[bone].arm);
            if let [front, back] = limbs[..]
                && !is_arm(front)
                && is_arm(back)
            {
                let below = |above: usize| -> Vec<usize> {
                    let is_below = |joint: usize| {
                        std::iter::successors(Some(joint), |&j| self.joints.parent[j]).any(|j| j == above)
                    };
                    side.iter().copied().filter(|&joint| is_below(joint)).collect()
                };
                for (a, b) in below(front).into_iter().zip(below(back)) {
                    (better[a], better[b]) = (mapping[b], mapping[a]);
                }
            }
        }
        better
    }

    fn is_mirrored(&self, (first, second): &(Vec<usize>, Vec<usize>), found: &[Option<usize>]) -> bool {
        first.iter().zip(second).all(|(&a, &b)| match (found[a], found[b]) {
            (Some(a), Some(b)) => self.traits[a].mirror == Some(b),
            (None, None) => true,
            _ => false,
        })
    }

    /// Whether who is below whom stays so, and only joints in a row share a bone.
    fn is_possible(&self, mapping: &[Option<usize>]) -> bool {
        let bone_is_below = |bone: usize, above: usize| {
            std::iter::successors(Some(bone), |&b| self.bone_parents[b]).any(|b| b == above)
        };
        let joint_above = |joint: usize| {
            let mut above = self.joints.parent[joint];
            while let Some(joint) = above.filter(|&joint| mapping[joint].is_none()) {
                above = self.joints.parent[joint];
            }
            above
        };
        let in_order = (0..mapping.len()).all(|joint| match (mapping[joint], joint_above(joint)) {
            (Some(bone), Some(above)) => mapping[above].is_none_or(|higher| bone_is_below(bone, higher)),
            _ => true,
        });
        let joint_is_below = |joint: usize, above: usize| {
            std::iter::successors(Some(joint), |&j| self.joints.parent[j]).any(|j| j == above)
        };
        let alone = (0..mapping.len()).all(|a| {
            let shared = (0..a).filter(|&b| mapping[a].is_some() && mapping[a] == mapping[b]);
            shared.into_iter().all(|b| joint_is_below(a, b) || joint_is_below(b, a))
        });
        in_order && alone
    }

    /// What the mapping costs, without the order of siblings and the sharing of bones.
    fn cost(&self, mapping: &[Option<usize>]) -> f64 {
        /// Two branches of the same shape do not mirror each other.
        const LOPSIDED: f64 = 0.5;
        const ARM_AFTER_LEG: f64 = 0.05;
        let bones = self.importance.len();
        let mut driven = vec![false; bones];
        let mut cost = 0.0;
        for (joint, bone) in mapping.iter().enumerate() {
            match bone {
                Some(bone) => {
                    driven[*bone] = true;
                    cost += self.extra[joint * bones + bone];
                }
                None => cost += self.unused,
            }
        }
        // Outlets run from the front to the back of a side, and from an arm to a leg.
        for (first, _) in self.pairs {
            let limbs = first.iter().filter_map(|&joint| Some((joint, mapping[joint]?)));
            let begun: Vec<bool> = limbs
                .filter(|&(joint, _)| self.joints.parent[joint].is_none_or(|parent| !first.contains(&parent)))
                .map(|(_, bone)| self.traits[bone].arm)
                .collect();
            cost += begun.windows(2).filter(|two| !two[0] && two[1]).count() as f64 * ARM_AFTER_LEG;
        }
        let undriven = driven.iter().zip(self.importance).filter(|(driven, _)| !**driven);
        cost += undriven.map(|(_, importance)| importance).sum::<f64>();
        cost + LOPSIDED * self.pairs.iter().filter(|pair| !self.is_mirrored(pair, mapping)).count() as f64
    }
}
