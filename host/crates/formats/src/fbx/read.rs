//! From FBX to a model, or to a skeleton alone.

use ufbx::Scene;

use super::clips::read_motions;
use super::materials::Materials;
use super::meshes::Gathered;
use super::open::open;
use super::rig::Rig;
use crate::FormatError;
use crate::model::{Model, Resolver};
use crate::skeleton::SkeletonWithClips;
use crate::text::quoted;

/// Reads all meshes, one after the other, in the rest pose, with the skeleton, the materials, the blend shapes and the
/// animations that move bones; +Y up, in metres.
pub(crate) fn read_fbx(file: &str, bytes: &[u8], resolver: Resolver) -> Result<Model, FormatError> {
    let scene = open(file, bytes)?;
    let mut model = Model::default();
    warn_of_repairs(&scene, &mut model.warnings);
    let rig = Rig::read(file, &scene, false, &mut model.warnings)?;
    let mut materials = Materials::new(resolver);
    let mut gathered = Gathered::new(file, &scene, &rig);
    for &node in &rig.order {
        gathered.add_node(&scene.nodes[node], &mut materials)?;
    }
    gathered.warn(&mut model.warnings);
    if let [name] = gathered.mesh_names.as_slice() {
        name.clone_into(&mut model.name);
    }
    (model.materials, model.grey_maps) = (materials.read, materials.grey_maps);
    model.warnings.append(&mut materials.warnings);
    let skeleton = Some(&rig.skeleton).filter(|skeleton| !skeleton.is_empty());
    let remedy = "Repair the model or export it again";
    gathered.collected.finish(skeleton, &mut model).map_err(|what| FormatError::whole(file, what, remedy))?;
    if skeleton.is_some() {
        model.motions = read_motions(&scene, &rig, &mut model.warnings);
    }
    Ok(model)
}

/// Reads the skeleton, with the same rest pose as [`read_model`](crate::read_model), from an FBX file with or without a
/// mesh. If the file has neither skins nor limbs, its bones are all nodes but meshes, cameras and lights.
pub fn read_fbx_skeleton(file: &str, bytes: &[u8]) -> Result<SkeletonWithClips, FormatError> {
    let scene = open(file, bytes)?;
    let mut warnings = Vec::new();
    warn_of_repairs(&scene, &mut warnings);
    let mut rig = Rig::read(file, &scene, false, &mut warnings)?;
    if rig.skeleton.is_empty() {
        rig = Rig::read(file, &scene, true, &mut warnings)?;
    }
    if rig.skeleton.is_empty() {
        let remedy = "Export it with its armature, or choose a file with a skeleton";
        return Err(FormatError::whole(file, "there is no skeleton in this file", remedy));
    }
    let motions = read_motions(&scene, &rig, &mut warnings);
    let has_mesh = scene.meshes.iter().any(|mesh| mesh.num_triangles > 0);
    Ok(SkeletonWithClips { skeleton: rig.skeleton, motions, has_mesh, warnings })
}

/// What the library found unusual in the file.
fn warn_of_repairs(scene: &Scene, warnings: &mut Vec<String>) {
    for warning in &scene.metadata.warnings {
        if warning.type_ != ufbx::WarningType::MissingExternalFile {
            warnings.push(format!("The file is unusual: {}.", quoted(&warning.description)));
        }
    }
}
