//! The pose in which a puppet is zeroed, and what the character's rest pose is turned to.

use std::str::FromStr;

use armature_rig::{JointTree, Mapping, PuppetHints, RestMatch, RestPose, RestTurn, Skeleton};

/// The pose in which the puppet is zeroed, and so what the character's rest pose is turned to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum PuppetRest {
    /// As the mapping that was chosen says; without one, what is known of the puppet.
    #[default]
    Mapping,
    /// What is known of the puppet, unless the mapping that was chosen turns bones itself.
    Puppet,
    /// This one, unless the mapping that was chosen turns bones itself.
    Pose(RestPose),
    /// The character's own rest pose, whatever the mapping says.
    Character,
}

impl FromStr for PuppetRest {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "character" => Ok(Self::Character),
            "puppet" => Ok(Self::Puppet),
            pose => pose.parse().map(Self::Pose).map_err(|_| format!("{text:?} is none of t, a, puppet and character")),
        }
    }
}

/// How the character's rest pose becomes the puppet's; like a proposed mapping, it holds while parts are unplugged.
#[derive(Debug, Default)]
pub(super) struct RestMatcher {
    wanted: PuppetRest,
    /// What was found, and the puppet for which.
    found: Option<(JointTree, RestMatch)>,
}

impl RestMatcher {
    pub(super) fn new(wanted: PuppetRest) -> Self {
        Self { wanted, found: None }
    }

    /// Whether it goes before what a chosen mapping leaves open.
    pub(super) fn is_asked_for(&self) -> bool {
        self.wanted != PuppetRest::Mapping
    }

    /// How bones are turned.
    pub(super) fn turns(
        &mut self,
        tree: &JointTree,
        mapping: &Mapping,
        skeleton: &Skeleton,
        hints: &PuppetHints,
    ) -> Vec<RestTurn> {
        if self.wanted == PuppetRest::Character {
            return Vec::new();
        }
        // Those of a chosen mapping.
        if !mapping.rest.is_empty() {
            return mapping.rest.clone();
        }
        if let Some((_, found)) = self.found.as_ref().filter(|(whole, _)| is_part_of(tree, whole)) {
            return found.turns.clone();
        }
        let found = if let PuppetRest::Pose(pose) = self.wanted {
            let driven = mapping.driven_bones(skeleton);
            let is_driven = |bone: usize| driven[bone];
            armature_rig::match_rest_pose(pose, skeleton, &is_driven)
        } else {
            armature_rig::match_rest(tree, mapping, skeleton, hints)
        };
        let turns = found.turns.clone();
        self.found = Some((tree.clone(), found));
        turns
    }

    /// Why nothing was turned, where something might be expected.
    pub(super) fn note(&self) -> Option<&str> {
        self.found.as_ref().and_then(|(_, found)| found.note.as_deref())
    }

    /// Another puppet comes.
    pub(super) fn forget(&mut self) {
        self.found = None;
    }
}

/// Whether every joint of a tree hangs on the same joint in a larger one. Splitters between them do not count: one that
/// is swapped for another, or plugged together in another order, leaves the joints the bones they had.
pub(super) fn is_part_of(tree: &JointTree, whole: &JointTree) -> bool {
    let joint_above = |tree: &JointTree, part: usize| {
        let mut above = tree.parts()[part].parent;
        while let Some(index) = above.filter(|&index| tree.parts()[index].kind.axes().is_empty()) {
            above = tree.parts()[index].parent;
        }
        above.map(|index| tree.parts()[index].uid)
    };
    let joints = tree.parts().iter().enumerate().filter(|(_, part)| !part.kind.axes().is_empty());
    joints.into_iter().all(|(index, part)| {
        whole.find(part.uid).is_some_and(|same| {
            whole.parts()[same].kind == part.kind && joint_above(whole, same) == joint_above(tree, index)
        })
    })
}
