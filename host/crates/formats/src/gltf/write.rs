//! Skinned mesh, skeleton and clips to GLB.

use std::borrow::Cow;

use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Motion, Pose, Skeleton};
use glam::DAffine3;
use gltf_json::accessor::{ComponentType, Type};
use gltf_json::buffer::{Buffer, Target};
use gltf_json::material::{Material, PbrBaseColorFactor, PbrMetallicRoughness, StrengthFactor};
use gltf_json::mesh::{Mesh, Mode, Primitive, Semantic};
use gltf_json::scene::{Node, UnitQuaternion};
use gltf_json::skin::Skin;
use gltf_json::validation::{Checked, USize64};
use gltf_json::{Index, Scene, image, texture};

use super::buffer::Builder;
use super::skin::affine;
use super::write_clip::write_clip;
use crate::{FormatError, Model, Split, Texture};

/// What goes into a GLB file. All of it is borrowed.
#[derive(Clone, Debug)]
pub struct GlbScene<'a> {
    /// Name of the character.
    pub name: &'a str,
    /// Bones; may be empty for a mesh that does not move.
    pub skeleton: &'a Skeleton,
    /// The surface. Without one, programs show the bones as plain nodes.
    pub mesh: Option<GlbMesh<'a>>,
    /// Animations on the skeleton.
    pub clips: Vec<GlbClip<'a>>,
}

/// The surface of a [`GlbScene`].
#[derive(Clone, Copy, Debug)]
pub struct GlbMesh<'a> {
    /// Geometry in model space, the skeleton's rest frame.
    pub mesh: &'a TriangleMesh,
    /// Drawn vertices along seams, as in [`Model`].
    pub split: Option<&'a Split>,
    /// Normals of the drawn vertices; any length but zero.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Texture coordinates of the drawn vertices.
    pub texture_coordinates: Option<&'a [[f32; 2]]>,
    /// How the mesh's vertices follow the bones; `None` only for a skeleton without bones.
    pub influences: Option<&'a Influences>,
    /// Linear red, green, blue, opacity.
    pub base_color: Option<[f32; 4]>,
    /// Base colour image.
    pub texture: Option<&'a Texture>,
}

/// When the poses of a clip are.
#[derive(Clone, Copy, Debug)]
pub enum GlbTimes<'a> {
    /// Evenly, the first at zero.
    EverySeconds(f64),
    /// At these seconds, one a pose, not negative and rising.
    At(&'a [f64]),
}

/// One animation of a [`GlbScene`].
#[derive(Clone, Copy, Debug)]
pub struct GlbClip<'a> {
    /// Its name.
    pub name: &'a str,
    /// When its poses are.
    pub times: GlbTimes<'a>,
    /// One pose a key, on the scene's skeleton; turns between keys are shortest.
    pub poses: &'a [Pose],
}

impl<'a> GlbMesh<'a> {
    /// The surface of a model, with the weights of its own rig.
    pub fn of_model(model: &'a Model) -> Self {
        Self {
            mesh: &model.mesh,
            split: model.split.as_ref(),
            normals: model.normals.as_deref(),
            texture_coordinates: model.texture_coordinates.as_deref(),
            influences: model.rig.as_ref().map(|rig| &rig.influences),
            base_color: model.base_color,
            texture: model.texture.as_ref(),
        }
    }
}

impl<'a> GlbClip<'a> {
    /// A clip of a motion at its own rate.
    pub fn of_motion(name: &'a str, motion: &'a Motion) -> Self {
        Self { name, times: GlbTimes::EverySeconds(motion.frame_seconds), poses: &motion.frames }
    }
}

/// Writes a GLB: one skinned mesh, one skin, the bones as nodes below a node called like the character, every clip as
/// an animation that holds only what moves. Positions are single precision.
pub fn write_glb(scene: &GlbScene) -> Result<Vec<u8>, FormatError> {
    let mut builder = Builder::default();
    builder.root.asset.generator = Some(concat!("Armature ", env!("CARGO_PKG_VERSION")).to_owned());
    let (armature, joints) = write_skeleton(&mut builder, scene);
    let mut roots: Vec<Index<Node>> = armature.into_iter().collect();
    if let Some(mesh) = &scene.mesh {
        roots.push(write_mesh_node(&mut builder, scene, mesh, &joints)?);
    }
    for clip in &scene.clips {
        write_clip(&mut builder, scene.skeleton, clip, &joints)?;
    }
    if roots.is_empty() {
        return Err(bad("there is neither a mesh nor a skeleton to write", "Export a character"));
    }
    let default = Index::push(
        &mut builder.root.scenes,
        Scene { extensions: None, extras: gltf_json::Extras::default(), name: None, nodes: roots },
    );
    builder.root.scene = Some(default);
    finish(builder)
}

pub(super) fn bad(what: impl Into<String>, remedy: &str) -> FormatError {
    FormatError::whole("GLB", what, remedy)
}

fn finish(mut builder: Builder) -> Result<Vec<u8>, FormatError> {
    let remedy = "Export fewer or shorter clips";
    if !builder.binary.is_empty() {
        builder.root.buffers.push(Buffer {
            byte_length: USize64::from(builder.binary.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: gltf_json::Extras::default(),
        });
    }
    let json = builder.root.to_vec().map_err(|error| bad(error.to_string(), remedy))?;
    let length = json.len() + builder.binary.len() + 64;
    let length = u32::try_from(length).map_err(|_| bad("the file would be longer than 4 GB", remedy))?;
    let glb = gltf::binary::Glb {
        header: gltf::binary::Header { magic: *b"glTF", version: 2, length },
        json: Cow::Owned(json),
        bin: (!builder.binary.is_empty()).then_some(Cow::Owned(builder.binary)),
    };
    glb.to_vec().map_err(|error| bad(error.to_string(), remedy))
}

/// The node that carries the bones, and the bones' nodes.
fn write_skeleton(builder: &mut Builder, scene: &GlbScene) -> (Option<Index<Node>>, Vec<Index<Node>>) {
    let bones = scene.skeleton.bones();
    if bones.is_empty() {
        return (None, Vec::new());
    }
    let joints: Vec<Index<Node>> = bones
        .iter()
        .map(|bone| {
            let rest = &bone.rest;
            let node = Node {
                name: Some(bone.name.clone()),
                translation: (rest.translation != glam::Vec3::ZERO).then(|| rest.translation.to_array()),
                rotation: (rest.rotation != glam::Quat::IDENTITY)
                    .then(|| UnitQuaternion(rest.rotation.normalize().to_array())),
                scale: (rest.scale != glam::Vec3::ONE).then(|| rest.scale.to_array()),
                ..Node::default()
            };
            Index::push(&mut builder.root.nodes, node)
        })
        .collect();
    let mut roots = Vec::new();
    for (bone, &joint) in bones.iter().zip(&joints) {
        match bone.parent {
            None => roots.push(joint),
            Some(parent) => {
                builder.root.nodes[joints[parent].value()].children.get_or_insert_default().push(joint);
            }
        }
    }
    let carrier = Node { name: Some(format!("{}_skeleton", scene.name)), children: Some(roots), ..Node::default() };
    (Some(Index::push(&mut builder.root.nodes, carrier)), joints)
}

fn write_mesh_node(
    builder: &mut Builder,
    scene: &GlbScene,
    surface: &GlbMesh,
    joints: &[Index<Node>],
) -> Result<Index<Node>, FormatError> {
    let primitive = write_primitive(builder, surface, scene.skeleton.len())?;
    let mesh = Mesh {
        extensions: None,
        extras: gltf_json::Extras::default(),
        name: Some(scene.name.to_owned()),
        primitives: vec![primitive],
        weights: None,
    };
    let mesh = Index::push(&mut builder.root.meshes, mesh);
    let skin = (!joints.is_empty()).then(|| write_skin(builder, scene, joints));
    let node = Node { name: Some(scene.name.to_owned()), mesh: Some(mesh), skin, ..Node::default() };
    Ok(Index::push(&mut builder.root.nodes, node))
}

fn write_skin(builder: &mut Builder, scene: &GlbScene, joints: &[Index<Node>]) -> Index<Skin> {
    let mut world: Vec<DAffine3> = Vec::with_capacity(joints.len());
    for bone in scene.skeleton.bones() {
        let local = affine(&bone.rest);
        world.push(bone.parent.map_or(local, |parent| world[parent] * local));
    }
    let column = |c: glam::DVec3, w: f32| [c.x as f32, c.y as f32, c.z as f32, w];
    let binds: Vec<[f32; 16]> = world
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
        name: Some(scene.name.to_owned()),
        skeleton: None,
    };
    Index::push(&mut builder.root.skins, skin)
}

fn write_primitive(builder: &mut Builder, surface: &GlbMesh, bone_count: usize) -> Result<Primitive, FormatError> {
    surface.mesh.validate().map_err(|error| bad(error.to_string(), "Repair the mesh"))?;
    let vertex_of: Vec<u32> = match surface.split {
        Some(split) => split.mesh_vertex.clone(),
        None => (0..surface.mesh.vertices.len() as u32).collect(),
    };
    let triangles = surface.split.map_or(&surface.mesh.triangles, |split| &split.triangles);
    check_lengths(surface, &vertex_of, triangles)?;
    let vertex_data = Some(Target::ArrayBuffer);
    let mut attributes = std::collections::BTreeMap::new();
    let positions: Vec<[f32; 3]> =
        vertex_of.iter().map(|&v| surface.mesh.vertices[v as usize].map(|c| c as f32)).collect();
    if !positions.iter().flatten().all(|c| c.is_finite()) {
        return Err(bad("a position is too large for single precision", "Scale the mesh"));
    }
    let index = builder.floats(&positions, Type::Vec3, vertex_data);
    attributes.insert(Checked::Valid(Semantic::Positions), index);
    if let Some(normals) = surface.normals {
        let unit = |n: &[f32; 3]| {
            let n = glam::DVec3::from(n.map(f64::from)).try_normalize().unwrap_or(glam::DVec3::Y);
            n.as_vec3().to_array()
        };
        let normals: Vec<[f32; 3]> = normals.iter().map(unit).collect();
        attributes.insert(Checked::Valid(Semantic::Normals), builder.floats(&normals, Type::Vec3, vertex_data));
    }
    if let Some(textures) = surface.texture_coordinates {
        attributes.insert(Checked::Valid(Semantic::TexCoords(0)), builder.floats(textures, Type::Vec2, vertex_data));
    }
    if bone_count > 0 {
        write_influences(builder, surface, &vertex_of, bone_count, &mut attributes)?;
    }
    // The largest index of a type means "start anew" and may not be used.
    let kind = if u16::try_from(vertex_of.len()).is_ok() { ComponentType::U16 } else { ComponentType::U32 };
    let indices = builder.integers(triangles, kind, Type::Scalar, Target::ElementArrayBuffer);
    Ok(Primitive {
        attributes,
        extensions: None,
        extras: gltf_json::Extras::default(),
        indices: Some(indices),
        material: Some(write_material(builder, surface)),
        mode: Checked::Valid(Mode::Triangles),
        targets: None,
    })
}

fn check_lengths(surface: &GlbMesh, vertex_of: &[u32], triangles: &[[u32; 3]]) -> Result<(), FormatError> {
    let drawn = vertex_of.len();
    let lengths = [
        ("normals", surface.normals.map(<[_]>::len), drawn),
        ("texture coordinates", surface.texture_coordinates.map(<[_]>::len), drawn),
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
        return Err(bad("the drawn vertices do not fit the mesh", "Bind the character again"));
    }
    let finite = surface.normals.is_none_or(|n| n.iter().flatten().all(|c| c.is_finite()))
        && surface.texture_coordinates.is_none_or(|t| t.iter().flatten().all(|c| c.is_finite()));
    if !finite {
        return Err(bad("a normal or texture coordinate is not finite", "Repair the mesh"));
    }
    Ok(())
}

type Attributes = std::collections::BTreeMap<Checked<Semantic>, Index<gltf_json::Accessor>>;

fn write_influences(
    builder: &mut Builder,
    surface: &GlbMesh,
    vertex_of: &[u32],
    bone_count: usize,
    attributes: &mut Attributes,
) -> Result<(), FormatError> {
    let influences = surface.influences.ok_or_else(|| bad("the mesh follows no bones", "Bind the character first"))?;
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

/// The influences of a vertex with weights that sum to one as exactly as single precision can.
fn whole_row(influences: &Influences, vertex: usize) -> Vec<(u16, f32)> {
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

fn write_material(builder: &mut Builder, surface: &GlbMesh) -> Index<Material> {
    let base_color_texture = surface.texture.map(|texture| {
        let view = builder.view(&texture.bytes, None);
        let image = image::Image {
            buffer_view: Some(view),
            mime_type: Some(image::MimeType(texture.mime.clone())),
            name: None,
            uri: None,
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        let source = Index::push(&mut builder.root.images, image);
        let sampler = Index::push(&mut builder.root.samplers, texture::Sampler::default());
        let texture = texture::Texture {
            name: None,
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        let index = Index::push(&mut builder.root.textures, texture);
        texture::Info { index, tex_coord: 0, extensions: None, extras: gltf_json::Extras::default() }
    });
    let material = Material {
        name: Some("skin".to_owned()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor(surface.base_color.unwrap_or([1.0; 4]).map(|c| c.clamp(0.0, 1.0))),
            base_color_texture,
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.8),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    };
    Index::push(&mut builder.root.materials, material)
}
