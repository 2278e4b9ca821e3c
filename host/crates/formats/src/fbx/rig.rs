//! The nodes that are bones, and where they rest.
//!
//! Bones are the nodes that skins follow and the file's limbs. A bone rests where the first skin that moves vertices
//! by it was bound; one that no skin has, in the file's bind pose, or else where its node is relative to its parent's.
//! Meshes are brought to this rest pose by their own skin. A scale that is the same along all axes of a bone is taken
//! out of it: exporters write characters in centimetres below a node that is scaled by 100.

use armature_rig::Skeleton;
use glam::{DAffine3, DVec3};
use ufbx::{Node, Scene};

use super::open::{affine, number, transform};
use crate::FormatError;
use crate::skeleton::frames::{NamedFrame, skeleton_from_frames};

/// Relative difference up to which the axes of a bone are scaled alike.
const SAME_SCALE: f64 = 1e-3;

/// The nodes of a scene, parents first, and the skeleton of all of them that are bones.
pub(super) struct Rig {
    /// Every node that the root leads to.
    pub(super) order: Vec<usize>,
    /// By node.
    pub(super) parent: Vec<Option<usize>>,
    pub(super) skeleton: Skeleton,
    pub(super) node_of_bone: Vec<usize>,
    pub(super) bone_of_node: Vec<Option<usize>>,
    /// `model_from_bone` at rest, with the file's scales.
    pub(super) rest: Vec<DAffine3>,
    /// The scale that was taken out of each bone.
    pub(super) scale: Vec<f64>,
}

impl Rig {
    /// All bones of a file; with `all_nodes`, every node that is not a mesh, a camera or a light counts as one.
    pub(super) fn read(
        file: &str,
        scene: &Scene,
        all_nodes: bool,
        warnings: &mut Vec<String>,
    ) -> Result<Self, FormatError> {
        let (order, parent) = order(scene);
        let bound = bind_frames(scene);
        let is_bone = |&node: &usize| {
            let found = &scene.nodes[node];
            let is_other = found.mesh.is_some() || found.camera.is_some() || found.light.is_some();
            let wanted = all_nodes && !is_other && !found.is_root;
            bound[node].is_some() || (found.bone.is_some() && !found.is_root) || wanted
        };
        let node_of_bone: Vec<usize> = order.iter().copied().filter(is_bone).collect();
        let mut bone_of_node = vec![None; scene.nodes.len()];
        for (bone, &node) in node_of_bone.iter().enumerate() {
            bone_of_node[node] = Some(bone);
        }
        let mut rest: Vec<DAffine3> = Vec::with_capacity(node_of_bone.len());
        let mut frames: Vec<NamedFrame> = Vec::with_capacity(node_of_bone.len());
        let mut scale = Vec::with_capacity(node_of_bone.len());
        for &node in &node_of_bone {
            let above = bone_above(&bone_of_node, &parent, parent[node]);
            let usable = |frame: &DAffine3| frame.is_finite() && frame.matrix3.determinant() != 0.0;
            let frame = bound[node].or_else(|| posed_frame(&scene.nodes[node])).filter(usable).unwrap_or_else(|| {
                let local = relative(scene, &parent, above.map(|bone| node_of_bone[bone]), node);
                above.map_or(local, |bone| rest[bone] * local)
            });
            if !frame.is_finite() {
                let what = format!("the transform of {:?} is not finite", scene.nodes[node].element.name.as_ref());
                return Err(FormatError::whole(file, what, "Repair the model or export it again"));
            }
            let size = even_scale(&frame).unwrap_or(1.0);
            scale.push(size);
            rest.push(frame);
            let unscaled = frame * DAffine3::from_scale(DVec3::splat(1.0 / size));
            let name = scene.nodes[node].element.name.to_string();
            frames.push(NamedFrame { name, parent: above, model_from_bone: unscaled });
        }
        let skeleton = skeleton_from_frames(&frames, warnings)
            .map_err(|what| FormatError::whole(file, what, "Repair the model or export it again"))?;
        Ok(Self { order, parent, skeleton, node_of_bone, bone_of_node, rest, scale })
    }

    /// The bone that a node is or is attached to.
    pub(super) fn bone_above(&self, node: usize) -> Option<usize> {
        bone_above(&self.bone_of_node, &self.parent, Some(node))
    }
}

/// Every node once, parents before children, and the parent of each.
fn order(scene: &Scene) -> (Vec<usize>, Vec<Option<usize>>) {
    let mut parent = vec![None; scene.nodes.len()];
    let mut seen = vec![false; scene.nodes.len()];
    let mut order = Vec::with_capacity(scene.nodes.len());
    let mut open = vec![number(&scene.root_node)];
    while let Some(node) = open.pop() {
        let Some(found) = scene.nodes.get(node).filter(|_| !seen[node]) else { continue };
        seen[node] = true;
        order.push(node);
        for child in found.children.iter().rev().map(|child| number(child)) {
            if let Some(slot) = parent.get_mut(child).filter(|_| !seen[child]) {
                *slot = Some(node);
                open.push(child);
            }
        }
    }
    (order, parent)
}

fn bone_above(bone_of_node: &[Option<usize>], parent: &[Option<usize>], node: Option<usize>) -> Option<usize> {
    std::iter::successors(node, |&n| parent[n]).find_map(|n| bone_of_node[n])
}

/// By node: where the first skin that moves vertices by it was bound, or else the first that has it.
fn bind_frames(scene: &Scene) -> Vec<Option<DAffine3>> {
    let mut bound = vec![None; scene.nodes.len()];
    let clusters = || scene.skin_deformers.iter().flat_map(|skin| skin.clusters.iter());
    for followed in [true, false] {
        for cluster in clusters().filter(|cluster| (cluster.num_weights > 0) == followed) {
            let node = cluster.bone_node.as_ref().map(|node| number(node));
            if let Some(slot) = node.and_then(|node| bound.get_mut(node)) {
                slot.get_or_insert_with(|| affine(&cluster.bind_to_world));
            }
        }
    }
    bound
}

/// Where the file's bind pose has a node.
fn posed_frame(node: &Node) -> Option<DAffine3> {
    let pose = node.bind_pose.as_ref()?;
    let own = pose.bone_poses.iter().find(|bone| number(&bone.bone_node) == number(node))?;
    Some(affine(&own.bone_to_world))
}

/// `ancestor_from_node` as the file shows both; `scene_from_node` without an ancestor.
fn relative(scene: &Scene, parent: &[Option<usize>], ancestor: Option<usize>, node: usize) -> DAffine3 {
    let mut out = DAffine3::IDENTITY;
    let mut at = Some(node);
    while let Some(node) = at.filter(|_| at != ancestor) {
        out = transform(&scene.nodes[node].local_transform) * out;
        at = parent[node];
    }
    out
}

/// The scale of a frame, if it is the same along all axes and nothing is mirrored.
fn even_scale(frame: &DAffine3) -> Option<f64> {
    let axes = [frame.matrix3.x_axis, frame.matrix3.y_axis, frame.matrix3.z_axis].map(DVec3::length);
    let size = frame.matrix3.determinant().cbrt();
    let even = axes.iter().all(|axis| (axis - size).abs() <= SAME_SCALE * size);
    (size > 0.0 && size.is_finite() && even).then_some(size)
}
