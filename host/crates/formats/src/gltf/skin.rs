//! From skins to one skeleton.
//!
//! Model space is the scene's. A bone's rest frame is given by the inverse bind matrices, `B · inverse(IBM)`, where `B`
//! takes the mesh's own frame to the scene: it is `scene_from_joint · IBM` if that is the same for all joints (the file
//! shows the bind pose), otherwise the frame of the topmost joint's parent. Meshes are brought to this rest pose by
//! their own skin, so that skinning with the rest pose changes nothing, even if skins disagree. [`super::rest`] handles
//! bones with useless bind matrices and bones that the file shows at another length or size.

use armature_rig::Skeleton;
use glam::{DAffine3, DMat4, DVec3};
use gltf_json::skin::Skin;

use super::container::Document;
use super::follow::followed_joints;
use super::nodes::Nodes;
use super::rest::{Joint, Rest, settle};
use crate::FormatError;
use crate::skeleton::frames::{NamedFrame, skeleton_from_frames};
use crate::text::counted;

/// Relative difference below which two frames are the same.
const SAME_FRAME: f64 = 1e-4;

/// The skeleton that all skins of a file share.
#[derive(Debug)]
pub(super) struct Rig {
    pub(super) skeleton: Skeleton,
    /// The node of every bone.
    pub(super) node_of_bone: Vec<usize>,
    /// The bone of every node.
    pub(super) bone_of_node: Vec<Option<usize>>,
    /// `model_from_bone` at rest, in double precision; singular if the file scales a part to nothing.
    pub(super) rest: Vec<DAffine3>,
    /// The inverse bind matrices of every skin; zero for a joint without a usable one, which no vertex follows.
    pub(super) inverse_binds: Vec<Vec<DAffine3>>,
}

/// The most names in a warning.
const NAMED: usize = 5;

impl Rig {
    /// All skins of the file together; `None` if there is none with joints.
    pub(super) fn read(
        document: &Document,
        nodes: &Nodes,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Self>, FormatError> {
        let followed = followed_joints(document, nodes)?;
        let mut inverse_binds = Vec::new();
        // By node: its bind frame, and whether vertices follow it there. The first skin with such vertices wins.
        let mut bound: Vec<Option<(Option<DAffine3>, bool)>> = vec![None; nodes.parent.len()];
        for (index, skin) in document.root.skins.iter().enumerate() {
            for joint in &skin.joints {
                document.get(&document.root.nodes, *joint, "node")?;
            }
            let followed = &followed[index];
            let binds = read_inverse_binds(document, index, skin, followed)?;
            let joints: Vec<usize> = skin.joints.iter().map(gltf_json::Index::value).collect();
            let frame = scene_from_bind(nodes, &joints, &binds, followed);
            for ((&joint, bind), &followed) in joints.iter().zip(&binds).zip(followed) {
                // A skin without matrices is bound in the current position of its nodes.
                let rest = match bind {
                    Some(bind) if skin.inverse_bind_matrices.is_some() => Some(frame * bind.inverse()),
                    Some(_) => Some(nodes.world[joint]),
                    None => None,
                };
                let better = |(rest_there, followed_there): (Option<DAffine3>, bool)| {
                    (followed && !followed_there) || (rest_there.is_none() && rest.is_some())
                };
                if bound[joint].is_none_or(better) {
                    bound[joint] = Some((rest, followed));
                }
            }
            let zero = DAffine3 { matrix3: glam::DMat3::ZERO, translation: DVec3::ZERO };
            inverse_binds.push(binds.into_iter().map(|bind| bind.unwrap_or(zero)).collect());
        }
        let node_of_bone: Vec<usize> = nodes.order.iter().copied().filter(|&n| bound[n].is_some()).collect();
        if node_of_bone.is_empty() {
            return Ok(None);
        }
        let bone_of_node = bones_of_nodes(&node_of_bone, nodes.parent.len());
        let joint = |&node: &usize| {
            let (bind, followed) = bound[node].unwrap_or_default();
            Joint { node, parent: bone_strictly_above(nodes, &bone_of_node, node), bind, followed }
        };
        let joints: Vec<Joint> = node_of_bone.iter().map(joint).collect();
        let rest = settle(nodes, &joints);
        let skeleton = skeleton(document, &joints, &rest.of_bone, warnings)?;
        warn(&skeleton, &rest, warnings);
        Ok(Some(Self { skeleton, node_of_bone, bone_of_node, rest: rest.of_mesh, inverse_binds }))
    }

    /// One bone per node (parents first), at rest as the file poses it; for files that animate nodes without a skin.
    pub(super) fn of_nodes(
        document: &Document,
        nodes: &Nodes,
        node_of_bone: Vec<usize>,
        warnings: &mut Vec<String>,
    ) -> Result<Self, FormatError> {
        let bone_of_node = bones_of_nodes(&node_of_bone, nodes.parent.len());
        let joint = |&node: &usize| Joint {
            node,
            parent: bone_strictly_above(nodes, &bone_of_node, node),
            bind: None,
            followed: false,
        };
        let joints: Vec<Joint> = node_of_bone.iter().map(joint).collect();
        let rest = settle(nodes, &joints);
        let skeleton = skeleton(document, &joints, &rest.of_bone, warnings)?;
        Ok(Self { skeleton, node_of_bone, bone_of_node, rest: rest.of_mesh, inverse_binds: Vec::new() })
    }

    /// The bone that a node is or is attached to.
    pub(super) fn bone_above(&self, nodes: &Nodes, node: usize) -> Option<usize> {
        std::iter::successors(Some(node), |&n| nodes.parent[n]).find_map(|n| self.bone_of_node[n])
    }
}

/// The bone of every node.
fn bones_of_nodes(node_of_bone: &[usize], node_count: usize) -> Vec<Option<usize>> {
    let mut bone_of_node = vec![None; node_count];
    for (bone, &node) in node_of_bone.iter().enumerate() {
        bone_of_node[node] = Some(bone);
    }
    bone_of_node
}

fn bone_strictly_above(nodes: &Nodes, bone_of_node: &[Option<usize>], node: usize) -> Option<usize> {
    std::iter::successors(nodes.parent[node], |&n| nodes.parent[n]).find_map(|n| bone_of_node[n])
}

/// Reports the bones whose rest is not that of their bind matrix.
fn warn(skeleton: &Skeleton, rest: &Rest, warnings: &mut Vec<String>) {
    let named = |bones: &[usize]| {
        let names: Vec<&str> = bones.iter().take(NAMED).map(|&bone| skeleton.bones()[bone].name.as_str()).collect();
        format!("{}{}", names.join(", "), if bones.len() > NAMED { ", …" } else { "" })
    };
    if !rest.strays.is_empty() {
        warnings.push(format!(
            "{} no vertex follows and whose bind matrix does not fit its node: placed where the node is ({}).",
            counted(rest.strays.len(), ["joint that", "joints that"]),
            named(&rest.strays)
        ));
    }
    if !rest.reshaped.is_empty() {
        warnings.push(format!(
            "{} another length or scale than the mesh was bound with: used as the file has it ({}).",
            counted(rest.reshaped.len(), ["bone has", "bones have"]),
            named(&rest.reshaped)
        ));
    }
}

/// `None` for a joint that no vertex follows and whose matrix cannot be inverted.
fn read_inverse_binds(
    document: &Document,
    index: usize,
    skin: &Skin,
    followed: &[bool],
) -> Result<Vec<Option<DAffine3>>, FormatError> {
    let Some(accessor) = skin.inverse_bind_matrices else {
        return Ok(vec![Some(DAffine3::IDENTITY); skin.joints.len()]);
    };
    let matrices = document.any_floats::<16>(accessor)?;
    if matrices.len() < skin.joints.len() {
        let what = format!("skin {index} has {} joints but {} bind matrices", skin.joints.len(), matrices.len());
        return Err(document.error(what));
    }
    let affine = |(joint, m): (usize, &[f32; 16])| {
        let bind = DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from)));
        if bind.is_finite() && bind.inverse().is_finite() && bind.matrix3.determinant().abs() > 0.0 {
            return Ok(Some(bind));
        }
        if !followed[joint] {
            return Ok(None);
        }
        Err(document.error(format!("skin {index}: the bind matrix of joint {joint} cannot be inverted")))
    };
    matrices.iter().take(skin.joints.len()).enumerate().map(affine).collect()
}

/// `B` as defined in the module documentation. Joints that no vertex follows are ignored if all others agree.
fn scene_from_bind(nodes: &Nodes, joints: &[usize], binds: &[Option<DAffine3>], followed: &[bool]) -> DAffine3 {
    let all = joints.iter().zip(binds).filter_map(|(&joint, bind)| Some((joint, (*bind)?)));
    let heavy = joints.iter().zip(binds).zip(followed).filter(|(_, followed)| **followed);
    let heavy = heavy.filter_map(|((&joint, bind), _)| Some((joint, (*bind)?)));
    if let Some(frame) = common_frame(nodes, all).or_else(|| common_frame(nodes, heavy)) {
        return frame;
    }
    let mut is_joint = vec![false; nodes.parent.len()];
    for &joint in joints {
        is_joint[joint] = true;
    }
    let top = nodes.order.iter().copied().find(|&n| is_joint[n]);
    let above = top.and_then(|n| nodes.parent[n]).map_or(DAffine3::IDENTITY, |p| nodes.world[p]);
    if above.matrix3.determinant().abs() > 0.0 { above } else { DAffine3::IDENTITY }
}

/// `scene_from_joint · IBM`, if it is the same for all.
fn common_frame(nodes: &Nodes, mut joints: impl Iterator<Item = (usize, DAffine3)>) -> Option<DAffine3> {
    let (first, bind) = joints.next()?;
    let frame = nodes.world[first] * bind;
    let same = joints.all(|(joint, bind)| is_same(nodes.world[joint] * bind, frame, bind));
    (same && frame.matrix3.determinant().abs() > 0.0).then_some(frame)
}

/// Equal up to rounding, which grows with how far the bind matrix reaches.
fn is_same(a: DAffine3, b: DAffine3, bind: DAffine3) -> bool {
    let size = b.matrix3.x_axis.length().max(b.matrix3.y_axis.length()).max(b.matrix3.z_axis.length());
    let reach = 1.0 + bind.inverse().translation.length();
    let turned = (a.matrix3 - b.matrix3).to_cols_array().iter().all(|d| d.abs() <= SAME_FRAME * size);
    turned && a.translation.distance(b.translation) <= SAME_FRAME * size * reach
}

fn skeleton(
    document: &Document,
    joints: &[Joint],
    rest: &[DAffine3],
    warnings: &mut Vec<String>,
) -> Result<Skeleton, FormatError> {
    let frame = |(&Joint { node, parent, .. }, &model_from_bone): (&Joint, &DAffine3)| {
        let name = document.root.nodes[node].name.clone().unwrap_or_default();
        NamedFrame { name, parent, model_from_bone }
    };
    let frames: Vec<NamedFrame> = joints.iter().zip(rest).map(frame).collect();
    skeleton_from_frames(&frames, warnings).map_err(|what| document.error(what))
}

/// The transform that takes a skinned vertex from the file's coordinates to the rest pose.
pub(super) fn blend(frames: &[DAffine3], influences: &[(usize, f32)]) -> DAffine3 {
    let total: f64 = influences.iter().map(|(_, w)| f64::from(*w)).sum();
    let mut out = DAffine3 { matrix3: glam::DMat3::ZERO, translation: DVec3::ZERO };
    for &(joint, weight) in influences {
        let share = f64::from(weight) / total;
        out.matrix3 += frames[joint].matrix3 * share;
        out.translation += frames[joint].translation * share;
    }
    out
}
