//! Where bones rest.
//!
//! A bone rests where its bind matrix puts it, with two exceptions:
//!
//! - A bone that no vertex follows needs no bind matrix, and exporters leave zeros, identities or stale numbers there.
//!   If these disagree with the nodes, the bone rests where its node is relative to its parent's.
//! - A bone whose node has another length or scale than it was bound with (a character whose proportions were edited by
//!   its bones) takes length and scale from the node, and keeps the rotation it was bound with. Rotations are poses, not
//!   proportions, and so is the position of the whole body.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::nodes::Nodes;

/// Relative difference above which lengths or scales differ.
const OTHER_SHAPE: f64 = 1e-3;
/// A scale below this fraction of the bound one makes a part vanish.
const COLLAPSED: f64 = 1e-6;

/// What a file says of a bone, parents first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Joint {
    pub(super) node: usize,
    pub(super) parent: Option<usize>,
    /// `model_from_bone` by the bind matrix; `None` where that cannot be inverted.
    pub(super) bind: Option<DAffine3>,
    /// Whether some vertex follows it.
    pub(super) followed: bool,
}

/// `model_from_bone` at rest.
#[derive(Debug, Default)]
pub(super) struct Rest {
    /// For the mesh: parts that the file scales to nothing vanish.
    pub(super) of_mesh: Vec<DAffine3>,
    /// For the skeleton: the same positions, and never scaled to nothing.
    pub(super) of_bone: Vec<DAffine3>,
    /// Bones that rest where their nodes are, because their bind matrices are useless.
    pub(super) strays: Vec<usize>,
    /// Bones whose length or scale is that of their nodes.
    pub(super) reshaped: Vec<usize>,
}

/// What is known of a bone once it is placed.
#[derive(Clone, Copy)]
struct Placed {
    /// The nearest bone, this one included, whose bind matrix is used.
    anchor: Option<usize>,
    /// By the nodes, from this bone to its anchor.
    anchor_from_bone: DAffine3,
    /// Whether it or a bone above it is followed.
    carries: bool,
    /// Whether it or a bone above it does not rest as bound.
    moved: bool,
    /// Whether it or a bone above it is scaled to nothing.
    collapsed: bool,
}

/// Decides where all bones rest.
pub(super) fn settle(nodes: &Nodes, joints: &[Joint]) -> Rest {
    let reach = reach(joints);
    let mut rest = Rest::default();
    let mut placed: Vec<Placed> = Vec::with_capacity(joints.len());
    for (index, joint) in joints.iter().enumerate() {
        let above = joint.parent.map(|p| placed[p]);
        let from_parent = relative(nodes, joint.parent.map(|p| joints[p].node), joint.node);
        let anchor = above.and_then(|a| Some((a.anchor?, joints[a.anchor?].bind?)));
        let anchor_from_bone = above.map_or(DAffine3::IDENTITY, |a| a.anchor_from_bone) * from_parent;
        let direct = anchor.is_some_and(|(a, _)| nodes.parent[joint.node] == Some(joints[a].node));
        let difference = anchor.zip(joint.bind).map(|((_, anchor), bind)| {
            Difference::between(nodes, joint.node, direct, anchor, bind, anchor_from_bone, reach)
        });
        let differs = difference.as_ref().is_some_and(|d| d.differs);
        let is_stray = joint.bind.is_none() || (!joint.followed && differs);
        let reshape = !is_stray && direct && differs && above.is_some_and(|a| a.carries);
        let (shown, collapses) = match (joint.bind, difference) {
            (Some(bind), Some(d)) if !is_stray => {
                let (anchor_rest, moved) = anchor.map_or((bind, false), |(a, _)| (rest.of_mesh[a], placed[a].moved));
                if reshape {
                    (anchor_rest * d.reshaped(), d.collapses())
                } else if moved {
                    (anchor_rest * d.bound, false)
                } else {
                    (bind, false)
                }
            }
            (Some(bind), _) if !is_stray => (bind, false),
            _ => {
                let parent = joint.parent.map_or(DAffine3::IDENTITY, |p| rest.of_mesh[p]);
                (parent * from_parent, from_parent.matrix3.determinant() == 0.0)
            }
        };
        let collapsed = collapses || above.is_some_and(|a| a.collapsed);
        let bone = if collapsed {
            let parent = joint.parent.map_or(DMat3::IDENTITY, |p| rest.of_bone[p].matrix3);
            let own = difference
                .filter(|_| !is_stray)
                .map_or_else(|| upright(nodes, joint.node, from_parent), |d| d.bound.matrix3);
            DAffine3 { matrix3: parent * own, translation: shown.translation }
        } else {
            shown
        };
        rest.of_mesh.push(shown);
        rest.of_bone.push(bone);
        if is_stray {
            rest.strays.push(index);
        } else if reshape {
            rest.reshaped.push(index);
        }
        placed.push(Placed {
            anchor: if is_stray { above.and_then(|a| a.anchor) } else { Some(index) },
            anchor_from_bone: if is_stray { anchor_from_bone } else { DAffine3::IDENTITY },
            carries: joint.followed || above.is_some_and(|a| a.carries),
            moved: reshape || above.is_some_and(|a| a.moved),
            collapsed,
        });
    }
    rest
}

/// How a bone is bound and how it is shown, both relative to its anchor.
#[derive(Clone, Copy)]
struct Difference {
    bound: DAffine3,
    bound_scale: DVec3,
    bound_rotation: DQuat,
    shown_scale: DVec3,
    shown_translation: DVec3,
    differs: bool,
}

impl Difference {
    fn between(
        nodes: &Nodes,
        node: usize,
        direct: bool,
        anchor: DAffine3,
        bind: DAffine3,
        anchor_from_bone: DAffine3,
        reach: f64,
    ) -> Self {
        let bound = anchor.inverse() * bind;
        let (bound_scale, bound_rotation, bound_translation) = bound.to_scale_rotation_translation();
        let local = nodes.local[node];
        let (shown_scale, shown_translation) = if anchor_from_bone.matrix3.determinant() == 0.0 {
            (local.scale, anchor_from_bone.translation)
        } else {
            let (scale, _, translation) = anchor_from_bone.to_scale_rotation_translation();
            (scale, translation)
        };
        // Nodes in between that are not joints may be posed: then only the length can be compared.
        let off = if direct {
            (anchor.matrix3 * (shown_translation - bound_translation)).length()
        } else {
            let length = |v: DVec3| (anchor.matrix3 * v).length();
            (length(shown_translation) - length(bound_translation)).abs()
        };
        let other_size = (shown_scale - bound_scale).abs().cmpgt(bound_scale.abs() * OTHER_SHAPE).any();
        let differs = off > OTHER_SHAPE * reach || (direct && other_size);
        Self { bound, bound_scale, bound_rotation, shown_scale, shown_translation, differs }
    }

    fn reshaped(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.shown_scale, self.bound_rotation, self.shown_translation)
    }

    fn collapses(&self) -> bool {
        self.shown_scale.abs().cmple(self.bound_scale.abs() * COLLAPSED).any()
    }
}

/// The rotation of a node that is scaled to nothing.
fn upright(nodes: &Nodes, node: usize, from_parent: DAffine3) -> DMat3 {
    if from_parent.matrix3.determinant() == 0.0 {
        DMat3::from_quat(nodes.local[node].rotation)
    } else {
        from_parent.matrix3
    }
}

/// `ancestor_from_node`, as the file poses both; `scene_from_node` without an ancestor.
pub(super) fn relative(nodes: &Nodes, ancestor: Option<usize>, node: usize) -> DAffine3 {
    let mut out = DAffine3::IDENTITY;
    let mut at = Some(node);
    while let Some(node) = at.filter(|_| at != ancestor) {
        out = nodes.local[node].affine() * out;
        at = nodes.parent[node];
    }
    out
}

/// The extent of the bones that vertices follow; of all bones if vertices follow none.
fn reach(joints: &[Joint]) -> f64 {
    let heads = |followed: bool| {
        let joints = joints.iter().filter(move |j| j.followed || !followed);
        joints.filter_map(|j| j.bind).map(|bind| bind.translation)
    };
    let of = |heads: &mut dyn Iterator<Item = DVec3>| {
        let (low, high) =
            heads.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
        (high - low).max(DVec3::ZERO).length()
    };
    let followed = of(&mut heads(true));
    if followed > 0.0 { followed } else { of(&mut heads(false)) }
}
