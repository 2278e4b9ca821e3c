//! The parts of a surface as meshes with skins and blend shapes.
//!
//! A vertex of the file is one of [`Points`]; normals, texture coordinates and colours belong to corners.

use glam::{DAffine3, DVec3};

use super::write_document::{Document, Id, Node, SCENE, Value, enum_property, number_property, properties};
use super::write_material::{UV_SET, write_materials, write_plain_material};
use super::write_skeleton::{matrix, model};
use crate::FormatError;
use crate::gltf::GlbScene;
use crate::gltf::pieces::{Cut, Piece, bound_frames};
use crate::gltf::points::Points;
use crate::gltf::scene::bad;
use crate::gltf::write_skin::whole_row;

/// The channel of a blend shape.
pub(super) struct ShapeChannel {
    pub(super) id: Id,
    /// Its morph target's place in the surface's list.
    pub(super) target: usize,
}

/// The meshes of a scene, and what moves them.
#[derive(Default)]
pub(super) struct WrittenSurface {
    /// Where the meshes are, for the bind pose.
    pub(super) models: Vec<(Id, DAffine3)>,
    pub(super) channels: Vec<ShapeChannel>,
}

/// Writes the surface of a scene.
pub(super) fn write_surface(
    document: &mut Document,
    scene: &GlbScene,
    limbs: &[Id],
    left_out: &mut Vec<String>,
) -> Result<WrittenSurface, FormatError> {
    let Some(surface) = &scene.mesh else { return Ok(WrittenSurface::default()) };
    let cut = Cut::of(surface)?;
    let materials = write_materials(document, surface.materials, scene.name, left_out);
    let mut written = WrittenSurface::default();
    for group in cut.pieces.chunk_by(Piece::goes_with) {
        let part = &group[0].part;
        let name = if part.name.is_empty() { scene.name } else { &part.name };
        let points = Points::of(&cut, group);
        let slots = Slots::of(group, &materials);
        let geometry = write_geometry(document, name, &cut, group, &points, &slots)?;
        let own = document.add("Model", [name, "Model"], "Mesh", model(vec![enum_property("InheritType", 1)]));
        document.connect(own, SCENE);
        document.connect(geometry, own);
        for material in slots.materials {
            let material = material.unwrap_or_else(|| write_plain_material(document));
            document.connect(material, own);
        }
        let channels = write_shapes(document, name, geometry, group, &points);
        let targets = group[0].targets_in(surface);
        written.channels.extend(channels.into_iter().zip(targets).map(|(id, target)| ShapeChannel { id, target }));
        if !limbs.is_empty() {
            let (frames, _) = bound_frames(surface, scene.skeleton, part.skin)?;
            write_skin(document, name, geometry, &Skinned { scene, cut: &cut, limbs, frames: &frames }, &points)?;
        }
        written.models.push((own, DAffine3::IDENTITY));
    }
    Ok(written)
}

/// Which material each piece is drawn with, by its place in the mesh's list.
struct Slots {
    materials: Vec<Option<Id>>,
    of_piece: Vec<i32>,
}

impl Slots {
    fn of(group: &[Piece], materials: &[Id]) -> Self {
        let mut slots = Self { materials: Vec::new(), of_piece: Vec::new() };
        let of = |piece: &Piece| piece.part.material.and_then(|material| materials.get(material as usize).copied());
        if group.iter().all(|piece| of(piece).is_none()) {
            slots.of_piece = vec![0; group.len()];
            return slots;
        }
        for piece in group {
            let material = of(piece);
            let slot = slots.materials.iter().position(|known| *known == material).unwrap_or_else(|| {
                slots.materials.push(material);
                slots.materials.len() - 1
            });
            slots.of_piece.push(slot as i32);
        }
        slots
    }
}

fn write_geometry(
    document: &mut Document,
    name: &str,
    cut: &Cut,
    group: &[Piece],
    points: &Points,
    slots: &Slots,
) -> Result<Id, FormatError> {
    let surface = cut.surface;
    let mut corners = Vec::new();
    // Corners name drawn vertices, counted over all pieces of the group.
    let mut drawn_corners = Vec::new();
    let mut first_drawn = 0_u32;
    let mut faces = Vec::new();
    for (piece, of_drawn) in group.iter().zip(&points.of_drawn) {
        let first = piece.part.vertices.start;
        for triangle in &cut.triangles[piece.triangles()] {
            let local = triangle.map(|corner| corner - first);
            let [a, b, c] = local.map(|corner| of_drawn[corner as usize] as i32);
            corners.extend([a, b, -c - 1]);
            drawn_corners.extend(local.map(|corner| (first_drawn + corner) as i32));
        }
        first_drawn += of_drawn.len() as u32;
        faces.push(piece.triangles().len());
    }
    if i32::try_from(first_drawn).is_err() {
        return Err(bad("a mesh has too many vertices", "Simplify it"));
    }
    let mut children = vec![
        properties(Vec::new()),
        Node::of("GeometryVersion", 124),
        Node::of("Vertices", Value::Reals(points.position.as_flattened().to_vec())),
        Node::of("PolygonVertexIndex", Value::Ints(corners)),
    ];
    let mut elements = Vec::new();
    let indices = || Value::Ints(drawn_corners.clone());
    let by_corner = |name: &str| {
        let reference = Node::of("ReferenceInformationType", "IndexToDirect");
        vec![
            Node::of("Version", 101),
            Node::of("Name", name),
            Node::of("MappingInformationType", "ByPolygonVertex"),
            reference,
        ]
    };
    let layer = |children: &mut Vec<Node>, name, head: Vec<Node>, rest: Vec<Node>| {
        children.push(Node::with(name, vec![0.into()], [head, rest].concat()));
    };
    if let Some(normals) = surface.normals {
        let base = group.iter().flat_map(|piece| {
            let of_piece = normals[piece.drawn()].iter().enumerate();
            of_piece.flat_map(|(k, normal)| piece.base_normal(*normal, k).map(f64::from))
        });
        let values = Value::Reals(base.collect());
        let rest = vec![Node::of("Normals", values), Node::of("NormalsIndex", indices())];
        layer(&mut children, "LayerElementNormal", by_corner(""), rest);
        elements.push("LayerElementNormal");
    }
    if let Some(textures) = surface.texture_coordinates {
        let all = group.iter().flat_map(|piece| &textures[piece.drawn()]);
        let values = Value::Reals(all.flat_map(|[u, v]| [f64::from(*u), 1.0 - f64::from(*v)]).collect());
        let rest = vec![Node::of("UV", values), Node::of("UVIndex", indices())];
        layer(&mut children, "LayerElementUV", by_corner(UV_SET), rest);
        elements.push("LayerElementUV");
    }
    if let Some(colors) = surface.vertex_colors {
        let all = group.iter().flat_map(|piece| &colors[piece.drawn()]);
        let values = all.flat_map(|[r, g, b, a]| [displayed(*r), displayed(*g), displayed(*b), f64::from(*a)]);
        let rest = vec![Node::of("Colors", Value::Reals(values.collect())), Node::of("ColorIndex", indices())];
        layer(&mut children, "LayerElementColor", by_corner("Col"), rest);
        elements.push("LayerElementColor");
    }
    let slots: Vec<i32> =
        slots.of_piece.iter().zip(&faces).flat_map(|(slot, count)| std::iter::repeat_n(*slot, *count)).collect();
    let same = slots.iter().all(|slot| *slot == 0);
    let rest = vec![
        Node::of("Version", 101),
        Node::of("Name", ""),
        Node::of("MappingInformationType", if same { "AllSame" } else { "ByPolygon" }),
        Node::of("ReferenceInformationType", "IndexToDirect"),
        Node::of("Materials", Value::Ints(if same { vec![0] } else { slots })),
    ];
    layer(&mut children, "LayerElementMaterial", Vec::new(), rest);
    elements.push("LayerElementMaterial");
    let element = |kind: &&'static str| {
        let children = vec![Node::of("Type", *kind), Node::of("TypedIndex", 0)];
        Node::with("LayerElement", Vec::new(), children)
    };
    let mut list = vec![Node::of("Version", 100)];
    list.extend(elements.iter().map(element));
    children.push(Node::with("Layer", vec![0.into()], list));
    Ok(document.add("Geometry", [name, "Geometry"], "Mesh", children))
}

/// Colours of vertices are stored as they are displayed.
fn displayed(linear: f32) -> f64 {
    let c = f64::from(linear.clamp(0.0, 1.0));
    if c <= 0.003_130_8 { c * 12.92 } else { 1.055 * libm::pow(c, 1.0 / 2.4) - 0.055 }
}

/// A channel for each morph target of the group.
/// Returns the channel of each morph target.
fn write_shapes(document: &mut Document, name: &str, geometry: Id, group: &[Piece], points: &Points) -> Vec<Id> {
    let targets = &group[0].targets;
    let mut channels = Vec::with_capacity(targets.len());
    if targets.is_empty() {
        return channels;
    }
    let version = || Node::of("Version", 100);
    let blend = document.add("Deformer", [name, "Deformer"], "BlendShape", vec![version()]);
    document.connect(blend, geometry);
    for (k, target) in targets.iter().enumerate() {
        let moved = points.moved_by(group, k);
        let is_moved =
            |(offset, normal): &&([f32; 3], DVec3)| offset.iter().any(|c| *c != 0.0) || *normal != DVec3::ZERO;
        let mut indices: Vec<i32> = (0..).zip(&moved).filter(|(_, m)| is_moved(m)).map(|(i, _)| i).collect();
        if indices.is_empty() {
            // Programs do not expect a shape without a vertex.
            indices.push(0);
        }
        let of = |index: &i32| &moved[*index as usize];
        let offsets = indices.iter().flat_map(|i| of(i).0.map(f64::from)).collect();
        let mut children = vec![
            version(),
            Node::of("Indexes", Value::Ints(indices.clone())),
            Node::of("Vertices", Value::Reals(offsets)),
        ];
        if !target.normals.is_empty() {
            let turns = indices.iter().flat_map(|i| of(i).1.to_array()).collect();
            children.push(Node::of("Normals", Value::Reals(turns)));
        }
        let shape = document.add("Geometry", [&target.name, "Geometry"], "Shape", children);
        let percent = 100.0 * f64::from(target.default_weight);
        let children = vec![
            version(),
            properties(vec![number_property("DeformPercent", percent)]),
            Node::of("DeformPercent", percent),
            Node::of("FullWeights", Value::Reals(vec![100.0])),
        ];
        let channel = document.add("Deformer", [&target.name, "SubDeformer"], "BlendShapeChannel", children);
        document.connect(channel, blend);
        document.connect(shape, channel);
        channels.push(channel);
    }
    channels
}

/// What a skin follows.
struct Skinned<'a> {
    scene: &'a GlbScene<'a>,
    cut: &'a Cut<'a>,
    limbs: &'a [Id],
    /// Where its bones were when it was bound.
    frames: &'a [DAffine3],
}

/// A cluster for each bone that a vertex follows.
fn write_skin(
    document: &mut Document,
    name: &str,
    geometry: Id,
    skinned: &Skinned,
    points: &Points,
) -> Result<(), FormatError> {
    let Some(influences) = skinned.cut.surface.influences else {
        return Err(bad("the mesh follows no bones", "Bind the character first"));
    };
    let bones = skinned.limbs.len();
    if let Some(bone) = influences.bones().iter().find(|&&bone| usize::from(bone) >= bones) {
        return Err(bad(format!("a vertex follows bone {bone} of {bones}"), "Bind the character again"));
    }
    let mut followers: Vec<(Vec<i32>, Vec<f64>)> = vec![Default::default(); bones];
    for (point, &vertex) in (0..).zip(&points.vertex) {
        for (bone, weight) in whole_row(influences, vertex as usize) {
            let (indices, weights) = &mut followers[usize::from(bone)];
            indices.push(point);
            weights.push(f64::from(weight));
        }
    }
    let children =
        vec![Node::of("Version", 101), Node::of("Link_DeformAcuracy", 50.0), Node::of("SkinningType", "Linear")];
    let skin = document.add("Deformer", [name, "Deformer"], "Skin", children);
    document.connect(skin, geometry);
    let bones = skinned.scene.skeleton.bones();
    for ((bone, (indices, weights)), (&limb, &frame)) in
        bones.iter().zip(followers).zip(skinned.limbs.iter().zip(skinned.frames))
    {
        if indices.is_empty() {
            continue;
        }
        let children = vec![
            Node::of("Version", 100),
            Node::new("UserData", vec!["".into(), "".into()]),
            Node::of("Indexes", Value::Ints(indices)),
            Node::of("Weights", Value::Reals(weights)),
            Node::of("Transform", matrix(frame.inverse())),
            Node::of("TransformLink", matrix(frame)),
        ];
        let cluster = document.add("Deformer", [&bone.name, "SubDeformer"], "Cluster", children);
        document.connect(cluster, skin);
        document.connect(limb, cluster);
    }
    Ok(())
}
