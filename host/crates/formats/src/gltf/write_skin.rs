//! Bind poses and influences to glTF.

use armature_geometry::Influences;
use armature_rig::Skeleton;
use glam::DAffine3;
use gltf_json::Index;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::Target;
use gltf_json::mesh::Semantic;
use gltf_json::scene::Node;
use gltf_json::skin::Skin;
use gltf_json::validation::Checked;

use super::buffer::Builder;
use super::scene::bad;
use crate::FormatError;
use crate::skeleton::frames::affine;

pub(super) type Attributes = std::collections::BTreeMap<Checked<Semantic>, Index<gltf_json::Accessor>>;

/// `model_from_bone` at rest, in double precision.
pub(crate) fn rest_frames(skeleton: &Skeleton) -> Vec<DAffine3> {
    let mut frames: Vec<DAffine3> = Vec::with_capacity(skeleton.len());
    for bone in skeleton.bones() {
        let local = affine(&bone.rest);
        frames.push(bone.parent.map_or(local, |parent| frames[parent] * local));
    }
    frames
}

/// Writes a skin bound where the bones have these frames.
pub(super) fn write_skin(
    builder: &mut Builder,
    name: &str,
    model_from_bone: &[DAffine3],
    joints: &[Index<Node>],
) -> Index<Skin> {
    let column = |c: glam::DVec3, w: f32| [c.x as f32, c.y as f32, c.z as f32, w];
    let binds: Vec<[f32; 16]> = model_from_bone
        .iter()
        .map(|frame| {
            let m = frame.inverse();
            let columns = [
                column(m.matrix3.x_axis, 0.0),
                column(m.matrix3.y_axis, 0.0),
                column(m.matrix3.z_axis, 0.0),
                column(m.translation, 1.0),
            ];
            std::array::from_fn(|k| columns[k / 4][k % 4])
        })
        .collect();
    let binds = builder.floats(&binds, Type::Mat4, None);
    let skin = Skin {
        extensions: None,
        extras: gltf_json::Extras::default(),
        inverse_bind_matrices: Some(binds),
        joints: joints.to_vec(),
        name: Some(name.to_owned()),
        skeleton: None,
    };
    Index::push(&mut builder.root.skins, skin)
}

/// Writes the influences of drawn vertices; `vertex_of` has the row of each.
pub(super) fn write_influences(
    builder: &mut Builder,
    influences: Option<&Influences>,
    vertex_of: &[u32],
    bone_count: usize,
    attributes: &mut Attributes,
) -> Result<(), FormatError> {
    let influences = influences.ok_or_else(|| bad("the mesh follows no bones", "Bind the character first"))?;
    if let Some(bone) = influences.bones().iter().find(|&&bone| usize::from(bone) >= bone_count) {
        return Err(bad(format!("a vertex follows bone {bone} of {bone_count}"), "Bind the character again"));
    }
    let kind = if bone_count <= 256 { ComponentType::U8 } else { ComponentType::U16 };
    let rows: Vec<Vec<(u16, f32)>> = vertex_of.iter().map(|&v| whole_row(influences, v as usize)).collect();
    for set in 0..influences.per_vertex().div_ceil(4) {
        let slot = |row: &Vec<(u16, f32)>, k: usize| row.get(4 * set + k).copied().unwrap_or((0, 0.0));
        let joints: Vec<[u32; 4]> = rows.iter().map(|row| std::array::from_fn(|k| u32::from(slot(row, k).0))).collect();
        let weights: Vec<[f32; 4]> = rows.iter().map(|row| std::array::from_fn(|k| slot(row, k).1)).collect();
        let set = set as u32;
        let joints = builder.integers(&joints, kind, Type::Vec4, Target::ArrayBuffer);
        attributes.insert(Checked::Valid(Semantic::Joints(set)), joints);
        let weights = builder.floats(&weights, Type::Vec4, Some(Target::ArrayBuffer));
        attributes.insert(Checked::Valid(Semantic::Weights(set)), weights);
    }
    Ok(())
}

/// The influences of a vertex, with weights that sum to one as exactly as single precision allows.
pub(crate) fn whole_row(influences: &Influences, vertex: usize) -> Vec<(u16, f32)> {
    let mut row: Vec<(u16, f32)> = Vec::with_capacity(influences.per_vertex());
    for (bone, weight) in influences.of_vertex(vertex) {
        match row.iter_mut().find(|(known, _)| *known == bone) {
            Some((_, sum)) => *sum += weight,
            None => row.push((bone, weight)),
        }
    }
    let rest: f64 = row.iter().skip(1).map(|(_, w)| f64::from(*w)).sum();
    if let Some(first) = row.first_mut() {
        first.1 = (1.0 - rest) as f32;
    }
    row
}
