//! From glTF to a model.

use super::animation::read_motions;
use super::gather::Gathered;
use super::nodes::Nodes;
use super::open::open;
use super::read_material::read_materials;
use super::skin::Rig;
use super::turn::turn_around;
use super::vrm::{OLD_VRM, read_avatar};
use crate::FormatError;
use crate::model::{Model, Resolver};
use crate::text::counted;

/// Reads all meshes of the shown scene, one after the other, in the scene's frame, with the skeleton of all skins, the
/// materials, the morph targets, and the animations that move the skeleton.
///
/// Vertices at the same place with the same skinning become one vertex of the mesh.
pub(crate) fn read_gltf(file: &str, bytes: &[u8], resolver: Resolver) -> Result<Model, FormatError> {
    let document = open(file, bytes, resolver)?;
    let nodes = Nodes::read(&document)?;
    let mut model = Model::default();
    document.warn_of_extensions(&mut model.warnings);
    let rig = Rig::read(&document, &nodes, &mut model.warnings)?;
    let mut gathered = Gathered::new(rig.as_ref());
    for &node in nodes.order.iter().filter(|&&n| nodes.shown[n]) {
        gathered.add_node(&document, &nodes, node)?;
    }
    gathered.warn(&mut model.warnings);
    if let [name] = gathered.mesh_names.as_slice() {
        name.clone_into(&mut model.name);
    }
    model.materials = read_materials(&document, resolver, &gathered.materials, &mut model.warnings)?;
    model.avatar = rig.as_ref().and_then(|rig| read_avatar(&document, &nodes, rig, &gathered.target_sources));
    gathered.finish(&mut model, &document)?;
    if let Some(rig) = &rig {
        model.motions = read_motions(&document, &nodes, rig, &mut model.warnings)?;
    } else if !document.root.animations.is_empty() {
        let animations = counted(document.root.animations.len(), ["animation", "animations"]);
        model.warnings.push(format!("{animations} of nodes without a skin: ignored."));
    }
    if model.avatar.as_ref().is_some_and(|avatar| avatar.version == OLD_VRM) {
        turn_around(&mut model).map_err(|what| document.error(what))?;
    }
    Ok(model)
}
