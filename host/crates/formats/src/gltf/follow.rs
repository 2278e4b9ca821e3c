//! Which joints vertices follow.

use super::container::Document;
use super::nodes::Nodes;
use crate::FormatError;

/// For every skin and each of its joints: whether some vertex of a mesh that uses the skin follows it.
pub(super) fn followed_joints(document: &Document, nodes: &Nodes) -> Result<Vec<Vec<bool>>, FormatError> {
    let root = &document.root;
    let mut followed: Vec<Vec<bool>> = root.skins.iter().map(|skin| vec![false; skin.joints.len()]).collect();
    for (node, mesh, skin) in root.nodes.iter().enumerate().filter_map(|(n, node)| Some((n, node.mesh?, node.skin?))) {
        if !nodes.shown[node] {
            continue;
        }
        document.get(&root.skins, skin, "skin")?;
        for primitive in &document.get(&root.meshes, mesh, "mesh")?.primitives {
            for (joints, weights) in document.influence_sets(primitive)?.iter().flatten() {
                for (&joint, _) in joints.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
                    // A joint that the skin does not have is an error later, where the vertex is placed.
                    if let Some(slot) = followed[skin.value()].get_mut(joint as usize) {
                        *slot = true;
                    }
                }
            }
        }
    }
    Ok(followed)
}
