//! The skeleton of a file, whether it has a mesh or not.

use super::animation::read_motions;
use super::container::Document;
use super::nodes::Nodes;
use super::open::open;
use super::skin::Rig;
use crate::FormatError;
use crate::model::Resolver;
use crate::skeleton::SkeletonWithClips;

/// Reads the skeleton of all skins, with the same rest pose as [`read_model`](crate::read_model), from a glTF or GLB
/// file with or without a mesh. If there is no skin, the bones are the nodes of every tree that an animation moves, or
/// of all trees if there is neither animation nor mesh; cameras and meshes with nothing below them are not bones.
///
/// ```
/// use armature_formats::gltf::read_gltf_skeleton;
///
/// let text = r#"{"asset": {"version": "2.0"}, "nodes": [
///     {"name": "hips", "children": [1]}, {"name": "spine", "translation": [0, 0.5, 0]}]}"#;
/// let read = read_gltf_skeleton("walk.gltf", text.as_bytes(), &|name| Err(format!("there is no {name}")))?;
/// assert_eq!(read.skeleton.bones()[1].name, "spine");
/// # Ok::<(), armature_formats::FormatError>(())
/// ```
pub fn read_gltf_skeleton(file: &str, bytes: &[u8], resolver: Resolver) -> Result<SkeletonWithClips, FormatError> {
    let document = open(file, bytes, resolver)?;
    let nodes = Nodes::read(&document)?;
    let mut warnings = Vec::new();
    document.warn_of_extensions(&mut warnings);
    let rig = if let Some(rig) = Rig::read(&document, &nodes, &mut warnings)? {
        rig
    } else {
        let bones = bones(&document, &nodes)?;
        if bones.is_empty() {
            let remedy = "Export it with its armature, or choose a file with a skeleton";
            return Err(FormatError::whole(file, "there is no skeleton in this file", remedy));
        }
        Rig::of_nodes(&document, &nodes, bones, &mut warnings)?
    };
    let motions = read_motions(&document, &nodes, &rig, &mut warnings)?;
    Ok(SkeletonWithClips { skeleton: rig.skeleton, motions, has_mesh: has_mesh(&document, &nodes), warnings })
}

fn has_mesh(document: &Document, nodes: &Nodes) -> bool {
    document.root.nodes.iter().zip(&nodes.shown).any(|(node, shown)| *shown && node.mesh.is_some())
}

/// The nodes that are bones where there is no skin, parents first.
fn bones(document: &Document, nodes: &Nodes) -> Result<Vec<usize>, FormatError> {
    let root = &document.root;
    let mut animated = vec![false; root.nodes.len()];
    for channel in root.animations.iter().flat_map(|animation| &animation.channels) {
        document.get(&root.nodes, channel.target.node, "node")?;
        animated[channel.target.node.value()] = true;
    }
    // The root of every node's tree; trees that move are wanted.
    let mut top: Vec<usize> = (0..root.nodes.len()).collect();
    for &node in &nodes.order {
        top[node] = nodes.parent[node].map_or(node, |p| top[p]);
    }
    let mut wanted = vec![!animated.contains(&true) && !has_mesh(document, nodes); root.nodes.len()];
    for node in (0..root.nodes.len()).filter(|&n| animated[n]) {
        wanted[top[node]] = true;
    }
    let mut carries: Vec<bool> = root.nodes.iter().map(|n| n.mesh.is_none() && n.camera.is_none()).collect();
    for &node in nodes.order.iter().rev() {
        carries[node] |= animated[node];
        if let Some(parent) = nodes.parent[node].filter(|_| carries[node]) {
            carries[parent] = true;
        }
    }
    Ok(nodes.order.iter().copied().filter(|&n| nodes.shown[n] && wanted[top[n]] && carries[n]).collect())
}
