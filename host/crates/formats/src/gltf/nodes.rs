//! The node tree: parents, children and transforms.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf_json::scene::Node;

use super::container::Document;
use crate::FormatError;

/// Relative difference up to which a matrix is its translation, rotation and scale: what single precision loses.
const SAME_MATRIX: f64 = 1e-5;

/// Translation, rotation and scale in double precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
    /// The whole of a matrix that is not just these three, such as one with shear.
    pub(super) whole: Option<DAffine3>,
}

impl Local {
    pub(super) fn affine(&self) -> DAffine3 {
        if let Some(whole) = self.whole {
            return whole;
        }
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// All nodes of a file.
#[derive(Debug)]
pub(super) struct Nodes {
    pub(super) parent: Vec<Option<usize>>,
    /// Every node once, depth first, parents before children.
    pub(super) order: Vec<usize>,
    /// As posed in the file, without an animation.
    pub(super) local: Vec<Local>,
    /// `scene_from_node`, in the same pose.
    pub(super) world: Vec<DAffine3>,
    /// Whether a node belongs to the scene that is shown.
    pub(super) shown: Vec<bool>,
}

impl Nodes {
    pub(super) fn read(document: &Document) -> Result<Self, FormatError> {
        let nodes = &document.root.nodes;
        let mut parent: Vec<Option<usize>> = vec![None; nodes.len()];
        for (index, node) in nodes.iter().enumerate() {
            for child in node.children.iter().flatten() {
                document.get(nodes, *child, "node")?;
                if parent[child.value()].replace(index).is_some() {
                    return Err(document.error(format!("node {} has two parents", child.value())));
                }
            }
        }
        let mut order = Vec::with_capacity(nodes.len());
        let mut open: Vec<usize> = (0..nodes.len()).rev().filter(|&n| parent[n].is_none()).collect();
        while let Some(node) = open.pop() {
            order.push(node);
            open.extend(nodes[node].children.iter().flatten().rev().map(gltf_json::Index::value));
        }
        // Every node has at most one parent, so nodes that no root leads to form a cycle.
        if order.len() < nodes.len() {
            return Err(document.error("some nodes form a cycle"));
        }
        let local: Vec<Local> = nodes
            .iter()
            .enumerate()
            .map(|(index, node)| {
                local(node).ok_or_else(|| {
                    document.error(format!("the transform of node {index} is not finite, or its rotation is zero"))
                })
            })
            .collect::<Result<_, _>>()?;
        let world = worlds(&order, &parent, &local);
        let shown = shown(document, &order, &parent)?;
        Ok(Self { parent, order, local, world, shown })
    }
}

/// `scene_from_node` of every node.
pub(super) fn worlds(order: &[usize], parent: &[Option<usize>], local: &[Local]) -> Vec<DAffine3> {
    let mut world = vec![DAffine3::IDENTITY; local.len()];
    for &node in order {
        let own = local[node].affine();
        world[node] = parent[node].map_or(own, |p| world[p] * own);
    }
    world
}

fn local(node: &Node) -> Option<Local> {
    let local = if let Some(matrix) = &node.matrix {
        let matrix = DMat4::from_cols_array(&matrix.map(f64::from));
        if !matrix.is_finite() {
            return None;
        }
        let (scale, rotation, translation) = if matrix.determinant() == 0.0 {
            // What is scaled to nothing has no rotation to find.
            let columns = [matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|c| c.truncate().length());
            (DVec3::from(columns), DQuat::IDENTITY, matrix.w_axis.truncate())
        } else {
            matrix.to_scale_rotation_translation()
        };
        let plain = Local { translation, rotation, scale, whole: None };
        let whole = DAffine3::from_mat4(matrix);
        let off = (plain.affine().matrix3 - whole.matrix3).to_cols_array();
        let size = whole.matrix3.to_cols_array().iter().fold(0.0_f64, |size, c| size.max(c.abs()));
        let sheared = off.iter().any(|d| d.abs() > SAME_MATRIX * size);
        Local { whole: sheared.then_some(whole), ..plain }
    } else {
        let vector = |v: Option<[f32; 3]>, default| v.map_or(default, |v| DVec3::from(v.map(f64::from)));
        let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
        Local {
            translation: vector(node.translation, DVec3::ZERO),
            rotation: unit(rotation)?,
            scale: vector(node.scale, DVec3::ONE),
            whole: None,
        }
    };
    (local.translation.is_finite() && local.rotation.is_finite() && local.scale.is_finite()).then_some(local)
}

/// A unit quaternion, if it has a direction.
pub(super) fn unit(rotation: DQuat) -> Option<DQuat> {
    let length = rotation.length();
    (length.is_finite() && length > 1e-6).then(|| rotation / length)
}

/// The default scene, or the first; all nodes if there is no scene.
fn shown(document: &Document, order: &[usize], parent: &[Option<usize>]) -> Result<Vec<bool>, FormatError> {
    let root = &document.root;
    let scene = match root.scene {
        Some(index) => Some(document.get(&root.scenes, index, "scene")?),
        None => root.scenes.first(),
    };
    let Some(scene) = scene else { return Ok(vec![true; root.nodes.len()]) };
    let mut shown = vec![false; root.nodes.len()];
    for index in &scene.nodes {
        document.get(&root.nodes, *index, "node")?;
        shown[index.value()] = true;
    }
    for &node in order {
        shown[node] |= parent[node].is_some_and(|p| shown[p]);
    }
    Ok(shown)
}
