//! Skins to one skeleton.
//!
//! Model space is the scene's. A bone rests where the inverse bind matrices have it, `B · inverse(IBM)`, where `B`
//! carries the mesh's own frame into the scene: it is `scene_from_joint · IBM` where that is the same for all joints
//! (the file shows the bind pose), else the frame that the topmost joint hangs in. Meshes are brought to this rest
//! pose by their own skin, so that skinning with the rest pose changes nothing, even if skins disagree.

use std::collections::BTreeMap;

use armature_rig::{Bone, Skeleton, Transform};
use glam::{DAffine3, DMat4, DVec3, Vec3};
use gltf_json::skin::Skin;

use super::container::Document;
use super::nodes::Nodes;
use crate::FormatError;
use crate::names::UniqueNames;
use crate::tails::set_tails;

/// Relative difference below which two frames are the same.
const SAME_FRAME: f64 = 1e-4;

/// The skeleton that all skins of a file share.
#[derive(Debug)]
pub(super) struct Rig {
    pub(super) skeleton: Skeleton,
    /// For every bone its node.
    pub(super) node_of_bone: Vec<usize>,
    /// For every node its bone.
    pub(super) bone_of_node: Vec<Option<usize>>,
    /// `model_from_bone` at rest, in double precision.
    pub(super) rest: Vec<DAffine3>,
    /// For every skin its inverse bind matrices.
    pub(super) inverse_binds: Vec<Vec<DAffine3>>,
}

impl Rig {
    /// All skins of the file together; `None` if there is none with joints.
    pub(super) fn read(
        document: &Document,
        nodes: &Nodes,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Self>, FormatError> {
        let mut inverse_binds = Vec::new();
        let mut rest_of_node: BTreeMap<usize, DAffine3> = BTreeMap::new();
        for (index, skin) in document.root.skins.iter().enumerate() {
            for joint in &skin.joints {
                document.get(&document.root.nodes, *joint, "node")?;
            }
            let binds = read_inverse_binds(document, index, skin)?;
            let joints: Vec<usize> = skin.joints.iter().map(gltf_json::Index::value).collect();
            let frame = scene_from_bind(nodes, &joints, &binds);
            for (&joint, bind) in joints.iter().zip(&binds) {
                // Without matrices of its own a skin is bound where its nodes stand.
                let rest =
                    if skin.inverse_bind_matrices.is_some() { frame * bind.inverse() } else { nodes.world[joint] };
                rest_of_node.entry(joint).or_insert(rest);
            }
            inverse_binds.push(binds);
        }
        if rest_of_node.is_empty() {
            return Ok(None);
        }
        let node_of_bone: Vec<usize> = nodes.order.iter().copied().filter(|n| rest_of_node.contains_key(n)).collect();
        let mut bone_of_node = vec![None; nodes.parent.len()];
        for (bone, &node) in node_of_bone.iter().enumerate() {
            bone_of_node[node] = Some(bone);
        }
        let rest: Vec<DAffine3> = node_of_bone.iter().map(|node| rest_of_node[node]).collect();
        let skeleton = skeleton(document, nodes, &node_of_bone, &bone_of_node, &rest, warnings)?;
        Ok(Some(Self { skeleton, node_of_bone, bone_of_node, rest, inverse_binds }))
    }

    /// The bone a node is or hangs on.
    pub(super) fn bone_above(&self, nodes: &Nodes, node: usize) -> Option<usize> {
        std::iter::successors(Some(node), |&n| nodes.parent[n]).find_map(|n| self.bone_of_node[n])
    }
}

fn read_inverse_binds(document: &Document, index: usize, skin: &Skin) -> Result<Vec<DAffine3>, FormatError> {
    let Some(accessor) = skin.inverse_bind_matrices else {
        return Ok(vec![DAffine3::IDENTITY; skin.joints.len()]);
    };
    let matrices = document.floats::<16>(accessor)?;
    if matrices.len() < skin.joints.len() {
        let what = format!("skin {index} has {} joints and {} bind matrices", skin.joints.len(), matrices.len());
        return Err(document.error(what));
    }
    let affine = |(joint, m): (usize, &[f32; 16])| {
        let bind = DAffine3::from_mat4(DMat4::from_cols_array(&m.map(f64::from)));
        let inverse = bind.inverse();
        if inverse.is_finite() && bind.matrix3.determinant().abs() > 0.0 {
            return Ok(bind);
        }
        Err(document.error(format!("skin {index}: the bind matrix of joint {joint} cannot be inverted")))
    };
    matrices.iter().take(skin.joints.len()).enumerate().map(affine).collect()
}

/// `B` as the module says.
fn scene_from_bind(nodes: &Nodes, joints: &[usize], binds: &[DAffine3]) -> DAffine3 {
    let Some((&first, bind)) = joints.iter().zip(binds).next() else { return DAffine3::IDENTITY };
    let frame = nodes.world[first] * *bind;
    let same = joints.iter().zip(binds).all(|(&joint, bind)| is_same(nodes.world[joint] * *bind, frame, *bind));
    if same && frame.matrix3.determinant().abs() > 0.0 {
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

/// Equal up to rounding, which grows with how far the bind matrix reaches.
fn is_same(a: DAffine3, b: DAffine3, bind: DAffine3) -> bool {
    let size = b.matrix3.x_axis.length().max(b.matrix3.y_axis.length()).max(b.matrix3.z_axis.length());
    let reach = 1.0 + bind.inverse().translation.length();
    let turned = (a.matrix3 - b.matrix3).to_cols_array().iter().all(|d| d.abs() <= SAME_FRAME * size);
    turned && a.translation.distance(b.translation) <= SAME_FRAME * size * reach
}

fn skeleton(
    document: &Document,
    nodes: &Nodes,
    node_of_bone: &[usize],
    bone_of_node: &[Option<usize>],
    rest: &[DAffine3],
    warnings: &mut Vec<String>,
) -> Result<Skeleton, FormatError> {
    let mut names = UniqueNames::default();
    let mut bones: Vec<Bone> = Vec::with_capacity(node_of_bone.len());
    let mut made: Vec<DAffine3> = Vec::with_capacity(node_of_bone.len());
    let mut worst = 0.0_f64;
    for (index, &node) in node_of_bone.iter().enumerate() {
        let above = std::iter::successors(nodes.parent[node], |&n| nodes.parent[n]);
        let parent = above.into_iter().find_map(|n| bone_of_node[n]);
        let name = document.root.nodes[node].name.as_deref().unwrap_or_default();
        let local = parent.map_or(rest[index], |p| made[p].inverse() * rest[index]);
        let rest_transform = decompose(local);
        let own = affine(&rest_transform);
        made.push(parent.map_or(own, |p| made[p] * own));
        let size = rest[index].matrix3.determinant().abs().cbrt();
        let off = made[index].matrix3 - rest[index].matrix3;
        worst = off.to_cols_array().iter().fold(worst, |w, d| w.max(d.abs() / size));
        bones.push(Bone {
            name: names.give(name, &format!("bone_{}", index + 1)),
            parent,
            rest: rest_transform,
            tail: Vec3::ZERO,
        });
    }
    if worst > 1e-3 {
        warnings.push(
            "Some bones are sheared by the scales above them; their rest is the nearest without shear.".to_owned(),
        );
    }
    set_tails(&mut bones, &[]);
    Skeleton::new(bones).map_err(|error| document.error(error.to_string()))
}

/// The nearest translation, rotation and scale in single precision.
pub(super) fn decompose(affine: DAffine3) -> Transform {
    let (scale, rotation, translation) = affine.to_scale_rotation_translation();
    Transform {
        translation: translation.as_vec3(),
        rotation: rotation.normalize().as_quat().normalize(),
        scale: scale.as_vec3(),
    }
}

/// A single-precision transform in double precision.
pub(super) fn affine(transform: &Transform) -> DAffine3 {
    DAffine3::from_scale_rotation_translation(
        transform.scale.as_dvec3(),
        transform.rotation.as_dquat().normalize(),
        transform.translation.as_dvec3(),
    )
}

/// What carries a skinned vertex from its file's coordinates to the rest pose.
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
