//! Checks and cleans a model before it is bound.

use armature_formats::model::{Model, Skin, check_parts};
use armature_geometry::MeshError;

use super::error::BindError;
use super::settings::{BindSettings, MOST_INFLUENCES};

/// Conditions that every later step relies on.
pub(super) fn check(model: &Model, settings: &BindSettings) -> Result<(), BindError> {
    for count in [Some(settings.max_influences), settings.limit_painted].into_iter().flatten() {
        if !(1..=MOST_INFLUENCES).contains(&count) {
            return Err(BindError::InfluenceCount(count));
        }
    }
    model.mesh.validate().map_err(|error| match error {
        MeshError::Empty => {
            BindError::NoSurface { vertices: model.mesh.vertices.len(), faces: model.mesh.triangles.len() }
        }
        other => BindError::Mesh(other),
    })?;
    let (vertices, drawn) = (model.mesh.vertices.len(), model.drawn_vertex_count());
    let belongs = |what, yes: bool| if yes { Ok(()) } else { Err(BindError::Inconsistent { what }) };
    if let Some(split) = &model.split {
        belongs("drawn vertices", split.mesh_vertex.iter().all(|&v| (v as usize) < vertices))?;
        belongs("drawn triangles", split.triangles.iter().flatten().all(|&v| (v as usize) < drawn))?;
        belongs("drawn triangles", split.triangles.len() == model.mesh.triangles.len())?;
    }
    belongs("normals", model.normals.as_ref().is_none_or(|n| n.len() == drawn))?;
    belongs("texture coordinates", model.texture_coordinates.as_ref().is_none_or(|t| t.len() == drawn))?;
    belongs("vertex colours", model.vertex_colors.as_ref().is_none_or(|c| c.len() == drawn))?;
    let skins = model.rig.as_ref().map_or(&[][..], |rig| rig.skins.as_slice());
    if !(model.parts.is_empty() && model.morph_targets.is_empty()) {
        let counts = [model.materials.len(), skins.len()];
        check_parts(&model.parts, &model.morph_targets, drawn, model.drawn_triangles(), counts)?;
    }
    if let Some(rig) = &model.rig {
        let whole = |skin: &Skin| skin.bound_model_from_bone.len() == rig.skeleton.len();
        belongs("skins", skins.iter().all(whole))?;
        belongs("weights", rig.influences.vertex_count() == vertices)?;
        let bones = rig.skeleton.len();
        let mut followed = (0..vertices).flat_map(|v| rig.influences.of_vertex(v));
        belongs("bones", followed.all(|(bone, _)| usize::from(bone) < bones))?;
        belongs("vertices without weights", rig.unbound.iter().all(|&vertex| (vertex as usize) < vertices))?;
    }
    Ok(())
}

/// The inner points of a volume, and points in no face, would be moved but never seen.
pub(super) fn drop_loose_vertices(model: &mut Model) {
    let mut used = vec![false; model.mesh.vertices.len()];
    model.mesh.triangles.iter().flatten().for_each(|&v| used[v as usize] = true);
    if model.split.is_some() || used.iter().all(|&u| u) {
        return;
    }
    let loose = used.iter().filter(|&&u| !u).count();
    if model.tetrahedra.is_none() {
        model.warnings.push(format!("{loose} vertices belong to no face and were ignored"));
    }
    let mut renumbered = Vec::with_capacity(used.len());
    let mut next = 0_u32;
    for &u in &used {
        renumbered.push(next);
        next += u32::from(u);
    }
    model.tetrahedra = None;
    model.mesh.triangles.iter_mut().flatten().for_each(|v| *v = renumbered[*v as usize]);
    keep(&mut model.mesh.vertices, &used);
    if let Some(normals) = &mut model.normals {
        keep(normals, &used);
    }
    if let Some(coordinates) = &mut model.texture_coordinates {
        keep(coordinates, &used);
    }
    if let Some(colors) = &mut model.vertex_colors {
        keep(colors, &used);
    }
    for target in &mut model.morph_targets {
        let part = &model.parts[target.part as usize].vertices;
        let used = &used[part.start as usize..part.end as usize];
        keep(&mut target.positions, used);
        if !target.normals.is_empty() {
            keep(&mut target.normals, used);
        }
    }
    renumbered.push(next);
    for part in &mut model.parts {
        part.vertices = renumbered[part.vertices.start as usize]..renumbered[part.vertices.end as usize];
    }
}

fn keep<T>(values: &mut Vec<T>, used: &[bool]) {
    let mut used = used.iter();
    values.retain(|_| used.next().copied().unwrap_or(false));
}
