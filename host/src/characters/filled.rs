//! A model with holes closed: the new surface gets everything that its model has.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::Path;

use armature_fairing::holes::{FillSettings, Filled, Holes, fill_holes, find_holes};
use armature_formats::model::{MeshPart, Model, Split};
use armature_geometry::surface::{NormalWeighting, vertex_normals};
use glam::DVec3;

use crate::failure::Failure;

/// The holes that are filled unless others are asked for: all but those that seem to be meant.
pub fn by_default(holes: &Holes) -> Vec<usize> {
    (0..holes.holes.len()).filter(|&hole| holes.holes[hole].meant.is_none()).collect()
}

/// Closes the holes of a model that is to be bound, and says in sentences what was done.
pub fn fill_before_binding(
    model: &Model,
    path: &Path,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<(Model, Vec<String>), Failure> {
    let refused = |what: String, remedy: &str| Failure::input(format!("{}: {what}", path.display()), remedy);
    let holes = find_holes(&model.mesh).map_err(|e| refused(e.to_string(), "repair the mesh and export it again"))?;
    let which = by_default(&holes);
    let filled = fill_holes(&model.mesh, &holes, &which, &FillSettings::default(), progress)
        .map_err(|e| refused(e.to_string(), "`armature surface fill --list` lists the holes"))?;
    let done = filled.patches.iter().filter(|patch| patch.outcome.is_filled()).count();
    let mut notes = vec![format!("{done} of {} holes filled", holes.holes.len())];
    for (index, hole) in holes.holes.iter().enumerate() {
        if let Some(meant) = hole.meant {
            notes.push(format!("hole {} stays open, it may be meant: {meant}", index + 1));
        }
    }
    for patch in filled.patches.iter().filter(|patch| !patch.outcome.is_filled()) {
        notes.push(format!("hole {} could not be filled; `armature surface fill` says why", patch.holes[0] + 1));
    }
    Ok((with_patches(model, &filled), notes))
}

/// The model with the vertices and triangles of the patches. They are drawn like the surface beside them: each patch is a
/// part of its own with the material of one that it touches, and its texture and colour are those of the nearest place of
/// the rim.
pub fn with_patches(model: &Model, filled: &Filled) -> Model {
    let mut out = Model { mesh: filled.mesh.clone(), tetrahedra: None, ..model.clone() };
    let is_plain = model.normals.is_none() && model.texture_coordinates.is_none() && model.vertex_colors.is_none();
    if is_plain && model.split.is_none() && model.parts.is_empty() {
        return out;
    }
    let mut split = model.split.clone().unwrap_or_else(|| Split {
        mesh_vertex: (0..model.mesh.vertices.len() as u32).collect(),
        triangles: model.mesh.triangles.clone(),
    });
    let mut first_drawn: BTreeMap<u32, u32> = BTreeMap::new();
    split.mesh_vertex.iter().enumerate().for_each(|(drawn, &v)| {
        first_drawn.entry(v).or_insert(drawn as u32);
    });
    let normals = vertex_normals(&filled.mesh, NormalWeighting::Angle).unwrap_or_default();
    for patch in &filled.patches {
        let (vertex_start, triangle_start) = (split.mesh_vertex.len() as u32, split.triangles.len() as u32);
        let mut local: BTreeMap<u32, u32> = BTreeMap::new();
        for &triangle in &filled.mesh.triangles[patch.triangles.clone()] {
            let drawn = triangle.map(|v| {
                *local.entry(v).or_insert_with(|| {
                    split.mesh_vertex.push(v);
                    split.mesh_vertex.len() as u32 - 1
                })
            });
            split.triangles.push(drawn);
        }
        let rim: Vec<u32> = local.keys().copied().filter(|v| first_drawn.contains_key(v)).collect();
        let place = |v: u32| DVec3::from(filled.mesh.vertices[v as usize]);
        for &v in &split.mesh_vertex[vertex_start as usize..] {
            let near = rim
                .iter()
                .copied()
                .min_by(|&a, &b| place(a).distance_squared(place(v)).total_cmp(&place(b).distance_squared(place(v))));
            let beside = near.and_then(|near| first_drawn.get(&near)).map_or(0, |&drawn| drawn as usize);
            if let Some(list) = &mut out.texture_coordinates {
                let coordinate = list.get(beside).copied().unwrap_or_default();
                list.push(coordinate);
            }
            if let Some(list) = &mut out.vertex_colors {
                let color = list.get(beside).copied().unwrap_or([1.0; 4]);
                list.push(color);
            }
            if let Some(list) = &mut out.normals {
                list.push(normals.get(v as usize).map_or([0.0, 1.0, 0.0], |n| n.map(|c| c as f32)));
            }
        }
        if !model.parts.is_empty() {
            let beside = rim.first().and_then(|v| first_drawn.get(v)).copied().unwrap_or_default();
            let part = model.parts.iter().find(|part| part.vertices.contains(&beside)).or(model.parts.first());
            out.parts.push(MeshPart {
                name: "filled hole".into(),
                vertices: vertex_start..split.mesh_vertex.len() as u32,
                triangles: triangle_start..split.triangles.len() as u32,
                material: part.and_then(|part| part.material),
                skin: part.and_then(|part| part.skin),
            });
        }
    }
    out.split = Some(split);
    out
}
