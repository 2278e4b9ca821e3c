//! The parts of a surface as glTF meshes.

use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::Target;
use gltf_json::mesh::{Mesh, Mode, MorphTarget as GltfTarget, Primitive, Semantic};
use gltf_json::scene::Node;
use gltf_json::skin::Skin as GltfSkin;
use gltf_json::validation::Checked;
use gltf_json::{Index, extras::RawValue};

use super::buffer::Builder;
use super::pieces::{Cut, Piece, bound_frames};
use super::scene::{GlbMesh, GlbScene, bad};
use super::write_material::write_materials;
use super::write_skin::{Attributes, write_influences, write_skin};
use crate::FormatError;
use crate::model::{MeshPart, MorphTarget};

/// A mesh in the scene.
pub(super) struct MeshNode {
    pub(super) node: Index<Node>,
    /// Where its morph targets are in the surface's list.
    pub(super) targets: Vec<usize>,
}

/// One mesh node for neighbouring parts of one name, with one primitive per part.
pub(super) fn write_surface(
    builder: &mut Builder,
    scene: &GlbScene,
    surface: &GlbMesh,
    joints: &[Index<Node>],
) -> Result<Vec<MeshNode>, FormatError> {
    let cut = Cut::of(surface)?;
    let materials = write_materials(builder, surface.materials);
    let mut skins: Vec<(Option<u32>, Index<GltfSkin>)> = Vec::new();
    let mut nodes = Vec::new();
    for group in cut.pieces.chunk_by(Piece::goes_with) {
        let mut primitives = Vec::with_capacity(group.len());
        for piece in group {
            let mut primitive = write_primitive(builder, &cut, piece, scene.skeleton.len())?;
            primitive.material = piece.part.material.map(|material| materials[material as usize]);
            primitives.push(primitive);
        }
        let MeshPart { name, skin, .. } = &group[0].part;
        let name = if name.is_empty() { scene.name } else { name };
        let weights: Vec<f32> = group[0].targets.iter().map(|target| target.default_weight).collect();
        let mesh = Mesh {
            extensions: None,
            extras: target_names(&group[0].targets)?,
            name: Some(name.to_owned()),
            primitives,
            weights: (!weights.is_empty()).then_some(weights),
        };
        let mesh = Index::push(&mut builder.root.meshes, mesh);
        let skin =
            if joints.is_empty() { None } else { Some(skin_of(builder, scene, surface, joints, *skin, &mut skins)?) };
        let node = Node { name: Some(name.to_owned()), mesh: Some(mesh), skin, ..Node::default() };
        let targets = group[0].targets_in(surface);
        nodes.push(MeshNode { node: Index::push(&mut builder.root.nodes, node), targets });
    }
    Ok(nodes)
}

/// The skin of a part, written when it is first needed.
fn skin_of(
    builder: &mut Builder,
    scene: &GlbScene,
    surface: &GlbMesh,
    joints: &[Index<Node>],
    skin: Option<u32>,
    written: &mut Vec<(Option<u32>, Index<GltfSkin>)>,
) -> Result<Index<GltfSkin>, FormatError> {
    if let Some((_, index)) = written.iter().find(|(known, _)| *known == skin) {
        return Ok(*index);
    }
    let (frames, name) = bound_frames(surface, scene.skeleton, skin)?;
    let index = write_skin(builder, if name.is_empty() { scene.name } else { name }, &frames, joints);
    written.push((skin, index));
    Ok(index)
}

/// By the convention of exporters and importers.
fn target_names(targets: &[&MorphTarget]) -> Result<gltf_json::Extras, FormatError> {
    if targets.is_empty() {
        return Ok(None);
    }
    let names: Vec<&str> = targets.iter().map(|target| target.name.as_str()).collect();
    let text = serde_json::json!({ "targetNames": names }).to_string();
    RawValue::from_string(text).map(Some).map_err(|error| bad(error.to_string(), "Rename the morph targets"))
}

fn write_primitive(builder: &mut Builder, cut: &Cut, piece: &Piece, bones: usize) -> Result<Primitive, FormatError> {
    let Cut { surface, vertex_of, triangles, .. } = cut;
    let own = piece.drawn();
    let vertex_data = Some(Target::ArrayBuffer);
    let mut attributes = Attributes::new();
    let shown = vertex_of[own.clone()].iter().map(|&vertex| surface.mesh.vertices[vertex as usize]);
    let position = |(drawn, shown)| piece.base_position(shown, drawn).map(|c| c as f32);
    let positions: Vec<[f32; 3]> = shown.enumerate().map(position).collect();
    if !positions.iter().flatten().all(|c| c.is_finite()) {
        return Err(bad("a position is too large for single precision", "Scale the mesh"));
    }
    let index = builder.floats(&positions, Type::Vec3, vertex_data);
    attributes.insert(Checked::Valid(Semantic::Positions), index);
    if let Some(normals) = surface.normals {
        let normal = |(drawn, &shown)| piece.base_normal(shown, drawn);
        let normals: Vec<[f32; 3]> = normals[own.clone()].iter().enumerate().map(normal).collect();
        attributes.insert(Checked::Valid(Semantic::Normals), builder.floats(&normals, Type::Vec3, vertex_data));
    }
    if let Some(textures) = surface.texture_coordinates {
        let textures = builder.floats(&textures[own.clone()], Type::Vec2, vertex_data);
        attributes.insert(Checked::Valid(Semantic::TexCoords(0)), textures);
    }
    if let Some(colors) = surface.vertex_colors {
        let colors = builder.floats(&colors[own.clone()], Type::Vec4, vertex_data);
        attributes.insert(Checked::Valid(Semantic::Colors(0)), colors);
    }
    if bones > 0 {
        write_influences(builder, surface.influences, &vertex_of[own.clone()], bones, &mut attributes)?;
    }
    // The largest index of a type means "primitive restart" and must not be used.
    let kind = if u16::try_from(own.len()).is_ok() { ComponentType::U16 } else { ComponentType::U32 };
    let first = piece.part.vertices.start;
    let triangles: Vec<[u32; 3]> =
        triangles[piece.triangles()].iter().map(|t| t.map(|corner| corner - first)).collect();
    let indices = builder.integers(&triangles, kind, Type::Scalar, Target::ElementArrayBuffer);
    let targets: Vec<GltfTarget> = piece
        .targets
        .iter()
        .map(|target| GltfTarget {
            positions: Some(builder.offsets(&target.positions)),
            normals: (surface.normals.is_some() && !target.normals.is_empty())
                .then(|| builder.offsets(&target.normals)),
            tangents: None,
        })
        .collect();
    Ok(Primitive {
        attributes,
        extensions: None,
        extras: gltf_json::Extras::default(),
        indices: Some(indices),
        material: None,
        mode: Checked::Valid(Mode::Triangles),
        targets: (!targets.is_empty()).then_some(targets),
    })
}
