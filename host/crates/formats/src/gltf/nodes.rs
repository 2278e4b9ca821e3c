//! The node tree: who hangs on whom, and where.

use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf_json::scene::Node;

use super::container::Document;
use crate::FormatError;

/// Translation, rotation and scale in double precision.
#[derive(Clone, Copy, Debug)]
pub(super) struct Local {
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
}

impl Local {
    pub(super) fn affine(&self) -> DAffine3 {
        DAffine3::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// All nodes of a file.
#[derive(Debug)]
pub(super) struct Nodes {
    pub(super) parent: Vec<Option<usize>>,
    /// Every node once, depth first, parents before children.
    pub(super) order: Vec<usize>,
    /// As the file poses them without an animation.
    pub(super) local: Vec<Local>,
    /// `scene_from_node`, likewise.
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
                    return Err(document.error(format!("node {} hangs on two others", child.value())));
                }
            }
        }
        let mut order = Vec::with_capacity(nodes.len());
        let mut open: Vec<usize> = (0..nodes.len()).rev().filter(|&n| parent[n].is_none()).collect();
        while let Some(node) = open.pop() {
            order.push(node);
            open.extend(nodes[node].children.iter().flatten().rev().map(gltf_json::Index::value));
        }
        // With one parent at most each, what no root leads to goes round in a circle.
        if order.len() < nodes.len() {
            return Err(document.error("some nodes hang on each other in a circle"));
        }
        let local: Vec<Local> = nodes
            .iter()
            .enumerate()
            .map(|(index, node)| {
                local(node).ok_or_else(|| {
                    document.error(format!("the transform of node {index} is not finite, or its rotation is none"))
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
        let (scale, rotation, translation) = matrix.is_finite().then(|| matrix.to_scale_rotation_translation())?;
        Local { translation, rotation, scale }
    } else {
        let vector = |v: Option<[f32; 3]>, default| v.map_or(default, |v| DVec3::from(v.map(f64::from)));
        let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
        Local {
            translation: vector(node.translation, DVec3::ZERO),
            rotation: unit(rotation)?,
            scale: vector(node.scale, DVec3::ONE),
        }
    };
    (local.translation.is_finite() && local.rotation.is_finite() && local.scale.is_finite()).then_some(local)
}

/// A quaternion of length one, if there is a direction in it.
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
