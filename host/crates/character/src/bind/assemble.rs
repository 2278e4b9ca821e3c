//! A bound model put together as a character.

use std::sync::Arc;

use armature_formats::model::{Material, Model, ModelRig};
use armature_geometry::surface::{NormalWeighting, vertex_normals};

use super::error::BindError;
use crate::character::{Character, Provenance, Surface};
use crate::skin_kind::SkinKind;

/// The default look of a model without materials: light grey clay.
const PLAIN: [f32; 4] = [0.6, 0.58, 0.55, 1.0];

/// All arrays have the same length.
pub(super) fn assemble(model: Model, provenance: Provenance) -> Result<Character, BindError> {
    let model = if model.split.is_some() { model.split_at_seams() } else { model };
    let ModelRig { skeleton, influences, skins, .. } = model.rig.ok_or(BindError::NoSkeleton)?;
    if influences.vertex_count() != model.mesh.vertices.len() {
        return Err(BindError::Inconsistent { what: "weights" });
    }
    let mut warnings = model.warnings;
    let usable = |n: &Vec<[f32; 3]>| n.iter().flatten().all(|c| c.is_finite());
    if model.normals.as_ref().is_some_and(|n| !usable(n)) {
        warnings.push("the model's normals are not finite and were recomputed".to_owned());
    }
    let computed = || -> Result<Vec<[f32; 3]>, BindError> {
        let normals = vertex_normals(&model.mesh, NormalWeighting::Angle).map_err(BindError::Mesh)?;
        Ok(normals.iter().map(|n| n.map(|c| c as f32)).collect())
    };
    let normals = model.normals.filter(usable).map_or_else(computed, Ok)?;
    let coordinates = model.texture_coordinates.map(|mut all| {
        let bad = all.iter().filter(|t| !t.iter().all(|c| c.is_finite())).count();
        if bad > 0 {
            warnings.push(format!("{bad} texture coordinates are not finite and were set to zero"));
            all.iter_mut().filter(|t| !t.iter().all(|c| c.is_finite())).for_each(|t| *t = [0.0; 2]);
        }
        all
    });
    let colors = model.vertex_colors.filter(|colors| colors.iter().flatten().all(|c| c.is_finite()));
    let parts = if model.parts.is_empty() { vec![Surface::one_part(&model.mesh)] } else { model.parts };
    let mut materials = model.materials;
    if materials.is_empty() {
        materials.push(Material::default());
    }
    for material in &mut materials {
        material.base_color = Some(material.base_color.filter(|c| c.iter().all(|x| x.is_finite())).unwrap_or(PLAIN));
        if !material.is_finite() {
            warnings.push(format!(
                "the material {:?} has a number that is not finite, so only its base colour is used",
                material.name
            ));
            let Material { name, base_color, base_color_map, .. } = std::mem::take(material);
            *material = Material { name, base_color, base_color_map, ..Material::default() };
        }
    }
    let character = Character {
        name: model.name,
        surface: Arc::new(Surface {
            mesh: model.mesh,
            normals,
            texture_coordinates: coordinates,
            vertex_colors: colors,
            influences,
            endpoints: None,
            parts,
            morph_targets: model.morph_targets,
        }),
        materials,
        skeleton,
        skins,
        avatar: model.avatar,
        skin: SkinKind::Linear,
        provenance,
        warnings,
    };
    character.check_parts()?;
    Ok(character)
}
