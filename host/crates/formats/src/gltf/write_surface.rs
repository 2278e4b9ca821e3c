//! The parts of a surface as glTF meshes.

use std::ops::Range;

use armature_geometry::Influences;
use glam::DAffine3;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::Target;
use gltf_json::mesh::{Mesh, Mode, MorphTarget as GltfTarget, Primitive, Semantic};
use gltf_json::scene::Node;
use gltf_json::skin::Skin as GltfSkin;
use gltf_json::validation::Checked;
use gltf_json::{Index, extras::RawValue};

use super::buffer::Builder;
use super::scene::{GlbMesh, GlbScene, bad};
use super::write_material::write_materials;
use super::write_skin::{Attributes, rest_frames, write_influences, write_skin};
use crate::FormatError;
use crate::model::{Material, MeshPart, MorphTarget, check_parts};

/// A part and its morph targets.
struct Piece<'a> {
    part: MeshPart,
    targets: Vec<&'a MorphTarget>,
}

impl Piece<'_> {
    /// Whether both can be primitives of one mesh: these share name, skin and morph targets.
    fn goes_with(&self, other: &Self) -> bool {
        let shape = |target: &MorphTarget| (target.name.clone(), target.normals.is_empty(), target.default_weight);
        (&self.part.name, self.part.skin) == (&other.part.name, other.part.skin)
            && self.targets.iter().map(|t| shape(t)).eq(other.targets.iter().map(|t| shape(t)))
    }
}

/// One mesh node for neighbouring parts of one name, with one primitive per part.
pub(super) fn write_surface(
    builder: &mut Builder,
    scene: &GlbScene,
    surface: &GlbMesh,
    joints: &[Index<Node>],
) -> Result<Vec<Index<Node>>, FormatError> {
    surface.mesh.validate().map_err(|error| bad(error.to_string(), "Repair the mesh"))?;
    let vertex_of: Vec<u32> = match surface.split {
        Some(split) => split.mesh_vertex.clone(),
        None => (0..surface.mesh.vertices.len() as u32).collect(),
    };
    let triangles = surface.split.map_or(&surface.mesh.triangles, |split| &split.triangles);
    check_lengths(surface, &vertex_of, triangles)?;
    let pieces = pieces(surface, vertex_of.len(), triangles)?;
    let materials = write_materials(builder, surface.materials);
    let mut skins: Vec<(Option<u32>, Index<GltfSkin>)> = Vec::new();
    let mut nodes = Vec::new();
    for group in pieces.chunk_by(Piece::goes_with) {
        let mut primitives = Vec::with_capacity(group.len());
        for piece in group {
            let drawn = Drawn { surface, vertex_of: &vertex_of, triangles, bones: scene.skeleton.len() };
            let mut primitive = write_primitive(builder, &drawn, piece)?;
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
        nodes.push(Index::push(&mut builder.root.nodes, node));
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
    let index = match skin.and_then(|skin| surface.skins.get(skin as usize)) {
        None => write_skin(builder, scene.name, &rest_frames(scene.skeleton), joints),
        Some(own) => {
            let frames: Vec<DAffine3> = own
                .bound_model_from_bone
                .iter()
                .map(|frame| DAffine3 {
                    matrix3: glam::Mat3::from(frame.matrix3).as_dmat3(),
                    translation: glam::Vec3::from(frame.translation).as_dvec3(),
                })
                .collect();
            let usable = |frame: &DAffine3| frame.is_finite() && frame.inverse().is_finite();
            if frames.len() != joints.len() || !frames.iter().all(usable) {
                return Err(bad("a bind pose does not fit the skeleton", "Bind the character again"));
            }
            write_skin(builder, if own.name.is_empty() { scene.name } else { &own.name }, &frames, joints)
        }
    };
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

/// What all primitives are cut from.
struct Drawn<'a> {
    surface: &'a GlbMesh<'a>,
    vertex_of: &'a [u32],
    triangles: &'a [[u32; 3]],
    bones: usize,
}

fn write_primitive(builder: &mut Builder, drawn: &Drawn, piece: &Piece) -> Result<Primitive, FormatError> {
    let Drawn { surface, vertex_of, triangles, bones } = *drawn;
    let own = piece.part.vertices.start as usize..piece.part.vertices.end as usize;
    let vertex_data = Some(Target::ArrayBuffer);
    let mut attributes = Attributes::new();
    let positions = base_positions(surface, &vertex_of[own.clone()], &piece.targets);
    if !positions.iter().flatten().all(|c| c.is_finite()) {
        return Err(bad("a position is too large for single precision", "Scale the mesh"));
    }
    let index = builder.floats(&positions, Type::Vec3, vertex_data);
    attributes.insert(Checked::Valid(Semantic::Positions), index);
    if let Some(normals) = surface.normals {
        let normals = base_normals(&normals[own.clone()], &piece.targets);
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
    let triangles = &triangles[piece.part.triangles.start as usize..piece.part.triangles.end as usize];
    let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|corner| corner - first)).collect();
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

/// Positions without the morph targets, which are at their default weights in the surface.
fn base_positions(surface: &GlbMesh, vertex_of: &[u32], targets: &[&MorphTarget]) -> Vec<[f32; 3]> {
    let base = |(drawn, &vertex): (usize, &u32)| {
        let mut position = surface.mesh.vertices[vertex as usize];
        for target in targets.iter().filter(|target| target.default_weight != 0.0) {
            for (c, offset) in position.iter_mut().zip(target.positions[drawn]) {
                *c -= f64::from(target.default_weight) * f64::from(offset);
            }
        }
        position.map(|c| c as f32)
    };
    vertex_of.iter().enumerate().map(base).collect()
}

/// The same for normals.
fn base_normals(normals: &[[f32; 3]], targets: &[&MorphTarget]) -> Vec<[f32; 3]> {
    let base = |(drawn, normal): (usize, &[f32; 3])| {
        let mut normal = glam::DVec3::from(normal.map(f64::from));
        for target in targets.iter().filter(|target| target.default_weight != 0.0 && !target.normals.is_empty()) {
            normal -= f64::from(target.default_weight) * glam::DVec3::from(target.normals[drawn].map(f64::from));
        }
        normal.try_normalize().unwrap_or(glam::DVec3::Y).as_vec3().to_array()
    };
    normals.iter().enumerate().map(base).collect()
}

/// The parts that have triangles, or the whole surface as one.
fn pieces<'a>(surface: &GlbMesh<'a>, vertices: usize, triangles: &[[u32; 3]]) -> Result<Vec<Piece<'a>>, FormatError> {
    if !surface.materials.iter().all(Material::is_finite) {
        return Err(bad("a number of a material is not finite", "Repair the materials"));
    }
    if surface.parts.is_empty() {
        let (vertices, triangles) = (0..vertices as u32, 0..triangles.len() as u32);
        let part = MeshPart { vertices, triangles, material: Some(0), ..MeshPart::default() };
        return Ok(vec![Piece { part, targets: Vec::new() }]);
    }
    let counts = [surface.materials.len(), surface.skins.len()];
    check_parts(surface.parts, surface.morph_targets, vertices, triangles, counts)
        .map_err(|error| bad(error.to_string(), "Bind the character again"))?;
    let piece = |(number, part): (u32, &MeshPart)| Piece {
        part: part.clone(),
        targets: surface.morph_targets.iter().filter(|target| target.part == number).collect(),
    };
    let has_triangles = |(_, part): &(u32, &MeshPart)| !Range::is_empty(&part.triangles);
    Ok((0..).zip(surface.parts).filter(has_triangles).map(piece).collect())
}

fn check_lengths(surface: &GlbMesh, vertex_of: &[u32], triangles: &[[u32; 3]]) -> Result<(), FormatError> {
    let drawn = vertex_of.len();
    let lengths = [
        ("normals", surface.normals.map(<[_]>::len), drawn),
        ("texture coordinates", surface.texture_coordinates.map(<[_]>::len), drawn),
        ("colours", surface.vertex_colors.map(<[_]>::len), drawn),
        ("rows of weights", surface.influences.map(Influences::vertex_count), surface.mesh.vertices.len()),
    ];
    for (what, have, need) in lengths {
        if let Some(have) = have.filter(|&have| have != need) {
            return Err(bad(format!("there are {have} {what} for {need} vertices"), "Bind the character again"));
        }
    }
    let out_of_range = |index: &u32, count: usize| *index as usize >= count;
    if vertex_of.iter().any(|v| out_of_range(v, surface.mesh.vertices.len()))
        || triangles.iter().flatten().any(|v| out_of_range(v, drawn))
    {
        return Err(bad("the drawn vertices do not match the mesh", "Bind the character again"));
    }
    let finite = surface.normals.is_none_or(|n| n.iter().flatten().all(|c| c.is_finite()))
        && surface.texture_coordinates.is_none_or(|t| t.iter().flatten().all(|c| c.is_finite()))
        && surface.vertex_colors.is_none_or(|t| t.iter().flatten().all(|c| c.is_finite()));
    if !finite {
        return Err(bad("a normal, texture coordinate or colour is not finite", "Repair the mesh"));
    }
    Ok(())
}
