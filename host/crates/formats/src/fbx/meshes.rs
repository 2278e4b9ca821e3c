//! The meshes of a scene, one part for each material of each.

use std::collections::HashMap;

use glam::{DAffine3, DMat3, DVec3};
use ufbx::{Face, Mesh, Node, Scene, SkinDeformer, VertexVec2};

use super::materials::{Materials, uv_set};
use super::open::{affine, number, vector};
use super::rig::Rig;
use crate::FormatError;
use crate::model::collect::{Collected, FileTarget, FileVertex, Following};
use crate::text::counted;
use crate::text::names::UniqueNames;

/// What has been gathered so far.
pub(super) struct Gathered<'s> {
    file: &'s str,
    scene: &'s Scene,
    rig: &'s Rig,
    pub(super) collected: Collected,
    pub(super) mesh_names: Vec<String>,
    unweighted: usize,
    extra_skins: usize,
    dual_quaternions: usize,
    between_shapes: usize,
}

/// The frame of every vertex of a mesh and what it follows.
type Places = Vec<(DAffine3, Following)>;

/// A corner as it is drawn: the vertex, and what differs from corner to corner.
#[derive(PartialEq, Eq, Hash)]
struct CornerKey {
    vertex: u32,
    normal: Option<[u32; 3]>,
    texture: Option<[u32; 2]>,
    color: Option<[u32; 4]>,
}

impl<'s> Gathered<'s> {
    pub(super) fn new(file: &'s str, scene: &'s Scene, rig: &'s Rig) -> Self {
        Self {
            file,
            scene,
            rig,
            collected: Collected::default(),
            mesh_names: Vec::new(),
            unweighted: 0,
            extra_skins: 0,
            dual_quaternions: 0,
            between_shapes: 0,
        }
    }

    /// Adds the mesh of a node, if it has one.
    pub(super) fn add_node(&mut self, node: &Node, materials: &mut Materials) -> Result<(), FormatError> {
        let Some(mesh) = node.mesh.as_deref().filter(|mesh| mesh.num_triangles > 0) else { return Ok(()) };
        let name = if node.element.name.is_empty() { &mesh.element.name } else { &node.element.name };
        self.mesh_names.push(name.to_string());
        let places = self.places(node, mesh);
        let targets = self.targets(name, mesh);
        let mut faces: Vec<Vec<usize>> = Vec::new();
        for face in 0..mesh.faces.len() {
            let material = mesh.face_material.get(face).copied().unwrap_or_default() as usize;
            // A number that no list of materials has is that of no material.
            let slot = material.min(node.materials.len().max(mesh.materials.len()));
            faces.resize(faces.len().max(slot + 1), Vec::new());
            faces[slot].push(face);
        }
        for (slot, faces) in faces.iter().enumerate().filter(|(_, faces)| !faces.is_empty()) {
            let material = node.materials.get(slot).or_else(|| mesh.materials.get(slot));
            let number = material.map(|material| materials.number(material));
            let uv_set = material.and_then(|material| uv_set(material));
            let part = Part { mesh, faces, coordinates: coordinates(mesh, uv_set) };
            self.add_part(name, &part, &places, &targets, number, materials)?;
        }
        Ok(())
    }

    fn add_part(
        &mut self,
        name: &str,
        part: &Part,
        places: &Places,
        targets: &[FileTarget],
        material: Option<u32>,
        materials: &Materials,
    ) -> Result<(), FormatError> {
        let file = self.file;
        let error = |what: &str| FormatError::whole(file, what, "Simplify the meshes, or export them again");
        let mut numbers: HashMap<CornerKey, u32> = HashMap::new();
        let mut used: Vec<u32> = Vec::new();
        let mut triangles = Vec::new();
        let mut corners = Vec::new();
        for &face in part.faces {
            let Some(&Face { index_begin, num_indices }) = part.mesh.faces.get(face) else { continue };
            let count = ufbx::triangulate_face_vec(&mut corners, part.mesh, Face { index_begin, num_indices });
            for triangle in corners.chunks_exact(3).take(count as usize) {
                let mut triangle_numbers = [0; 3];
                for (number, &corner) in triangle_numbers.iter_mut().zip(triangle) {
                    let Some((vertex, drawn)) = part.corner(corner as usize, material, materials) else {
                        return Err(error("a face of a mesh has a corner that does not exist"));
                    };
                    let key = CornerKey {
                        vertex,
                        normal: drawn.normal.map(|n| n.map(f32::to_bits)),
                        texture: drawn.texture.map(|t| t.map(f32::to_bits)),
                        color: drawn.color.map(|c| c.map(f32::to_bits)),
                    };
                    *number = match numbers.entry(key) {
                        std::collections::hash_map::Entry::Occupied(known) => *known.get(),
                        std::collections::hash_map::Entry::Vacant(new) => {
                            let number = used.len() as u32;
                            let place = places.get(vertex as usize).ok_or_else(|| error("a mesh has no vertices"))?;
                            let drawn = at_default_weights(drawn, vertex as usize, targets);
                            self.collected.add_vertex(&place.0, &drawn, place.1.clone()).map_err(error)?;
                            used.push(vertex);
                            *new.insert(number)
                        }
                    };
                }
                triangles.push(triangle_numbers);
            }
        }
        if triangles.is_empty() {
            return Ok(());
        }
        let select = |offsets: &[[f32; 3]]| -> Vec<[f32; 3]> {
            if offsets.is_empty() { Vec::new() } else { used.iter().map(|&vertex| offsets[vertex as usize]).collect() }
        };
        let own_targets = targets.iter().map(|target| FileTarget {
            name: target.name.clone(),
            default_weight: target.default_weight,
            positions: select(&target.positions),
            normals: select(&target.normals),
        });
        let own_targets = own_targets.collect();
        self.collected.end_part(name, material, &triangles, own_targets).map_err(error)
    }

    /// Where the vertices of a mesh rest, and which bones they follow.
    fn places(&mut self, node: &Node, mesh: &Mesh) -> Places {
        let rigid = self.rigid_place(node);
        let skins = mesh.skin_deformers.len();
        self.extra_skins += skins.saturating_sub(1);
        let Some(skin) = mesh.skin_deformers.first().filter(|_| !self.rig.node_of_bone.is_empty()) else {
            return vec![rigid; mesh.num_vertices];
        };
        self.dual_quaternions += usize::from(skin.skinning_method == ufbx::SkinningMethod::DualQuaternion);
        let clusters = self.cluster_frames(skin);
        let place = |vertex: usize| {
            let mut influences: Vec<(u16, f32)> = Vec::new();
            let mut sum = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
            let mut total = 0.0;
            let found = skin.vertices.get(vertex).and_then(|found| {
                let first = found.weight_begin as usize;
                skin.weights.get(first..first.checked_add(found.num_weights as usize)?)
            });
            for weight in found.unwrap_or_default().iter().filter(|w| w.weight > 0.0 && w.weight.is_finite()) {
                let Some(&Some((bone, frame))) = clusters.get(weight.cluster_index as usize) else { continue };
                total += weight.weight;
                sum.matrix3 += frame.matrix3 * weight.weight;
                sum.translation += frame.translation * weight.weight;
                match influences.iter_mut().find(|(known, _)| *known == bone) {
                    Some((_, sum)) => *sum += weight.weight as f32,
                    None => influences.push((bone, weight.weight as f32)),
                }
            }
            let share = DAffine3 { matrix3: sum.matrix3 * (1.0 / total), translation: sum.translation / total };
            (!influences.is_empty() && share.is_finite()).then_some((share, Following::bound(influences)))
        };
        let places: Vec<Option<_>> = (0..mesh.num_vertices).map(place).collect();
        self.unweighted += places.iter().filter(|place| place.is_none()).count();
        places.into_iter().map(|place| place.unwrap_or_else(|| rigid.clone())).collect()
    }

    /// Of each cluster: its bone, and what takes a vertex to the bone's rest pose.
    fn cluster_frames(&self, skin: &SkinDeformer) -> Vec<Option<(u16, DAffine3)>> {
        let frame = |cluster: &ufbx::Ref<ufbx::SkinCluster>| {
            let node = number(cluster.bone_node.as_deref()?);
            let bone = (*self.rig.bone_of_node.get(node)?)?;
            Some((bone as u16, self.rig.rest[bone] * affine(&cluster.geometry_to_bone)))
        };
        skin.clusters.iter().map(frame).collect()
    }

    /// A mesh without a skin follows the bone it is attached to.
    fn rigid_place(&self, node: &Node) -> (DAffine3, Following) {
        let world = affine(&node.geometry_to_world);
        let Some(bone) = self.rig.bone_above(number(node)) else {
            let none = self.rig.node_of_bone.is_empty();
            return (world, if none { Following::default() } else { Following::made_up(0) });
        };
        let shown = affine(&self.scene.nodes[self.rig.node_of_bone[bone]].node_to_world);
        let local = if shown.matrix3.determinant() == 0.0 { world } else { shown.inverse() * world };
        (self.rig.rest[bone] * local, Following::bound(vec![(bone as u16, 1.0)]))
    }

    /// The shapes of a mesh's channels, as offsets of all its vertices.
    fn targets(&mut self, mesh_name: &str, mesh: &Mesh) -> Vec<FileTarget> {
        let mut names = UniqueNames::default();
        let mut targets = Vec::new();
        for channel in mesh.blend_deformers.iter().flat_map(|deformer| deformer.channels.iter()) {
            let last = channel.keyframes.iter().last().map(|keyframe| &keyframe.shape);
            let Some(shape) = channel.target_shape.as_ref().or(last) else { continue };
            self.between_shapes += channel.keyframes.len().saturating_sub(1);
            let name = names.give(&channel.element.name, &format!("{mesh_name}.{}", targets.len() + 1));
            let mut positions = vec![[0.0; 3]; mesh.num_vertices];
            let has_normals =
                shape.normal_offsets.len() == shape.offset_vertices.len() && !shape.normal_offsets.is_empty();
            let mut normals = vec![[0.0; 3]; if has_normals { mesh.num_vertices } else { 0 }];
            for (k, &vertex) in shape.offset_vertices.iter().enumerate() {
                if let Some((slot, offset)) = positions.get_mut(vertex as usize).zip(shape.position_offsets.get(k)) {
                    *slot = vector(offset).as_vec3().to_array();
                }
                if let Some((slot, offset)) = normals.get_mut(vertex as usize).zip(shape.normal_offsets.get(k)) {
                    *slot = vector(offset).as_vec3().to_array();
                }
            }
            let default_weight = if channel.weight.is_finite() { channel.weight as f32 } else { 0.0 };
            targets.push(FileTarget { name, default_weight, positions, normals });
        }
        targets
    }

    pub(super) fn warn(&self, warnings: &mut Vec<String>) {
        if self.unweighted > 0 {
            let vertices = counted(self.unweighted, ["vertex follows", "vertices follow"]);
            warnings.push(format!("{vertices} no bone of the skin: carried by what the mesh is attached to."));
        }
        if self.extra_skins > 0 {
            let skins = counted(self.extra_skins, ["further skin", "further skins"]);
            warnings.push(format!("{skins} of meshes that have one already: ignored."));
        }
        if self.dual_quaternions > 0 {
            let meshes = counted(self.dual_quaternions, ["mesh asks", "meshes ask"]);
            warnings.push(format!("{meshes} for dual quaternions; linear blending is used."));
        }
        if self.between_shapes > 0 {
            let shapes = counted(self.between_shapes, ["shape", "shapes"]);
            warnings.push(format!("{shapes} between a blend shape's start and end: ignored."));
        }
    }
}

/// The faces of a mesh that are drawn with one material.
struct Part<'m> {
    mesh: &'m Mesh,
    faces: &'m [usize],
    coordinates: Option<&'m VertexVec2>,
}

impl Part<'_> {
    /// The vertex at a corner, and how it is drawn.
    fn corner(&self, corner: usize, material: Option<u32>, materials: &Materials) -> Option<(u32, FileVertex)> {
        let mesh = self.mesh;
        let vertex = *mesh.vertex_indices.get(corner)?;
        let position = vector(mesh.vertices.get(vertex as usize)?);
        let value = |indices: &[u32]| indices.get(corner).map(|&index| index as usize);
        let normals = &mesh.vertex_normal;
        let normal = value(&normals.indices).and_then(|at| normals.values.get(at)).filter(|_| normals.exists);
        let normal = normal.map(|n| vector(n).as_vec3().to_array()).filter(|n| n.iter().all(|c| c.is_finite()));
        let texture = self.coordinates.and_then(|uv| uv.values.get(value(&uv.indices)?));
        let texture = texture.map(|uv| materials.placed(material, [uv.x, uv.y]));
        let colors = &mesh.vertex_color;
        let color = value(&colors.indices).and_then(|at| colors.values.get(at)).filter(|_| colors.exists);
        let color = color.map(|c| [linear(c.x), linear(c.y), linear(c.z), c.w.clamp(0.0, 1.0) as f32]);
        Some((vertex, FileVertex { position, normal, texture, color }))
    }
}

/// The texture coordinates of the set that a material asks for, or the first.
fn coordinates<'m>(mesh: &'m Mesh, set: Option<&str>) -> Option<&'m VertexVec2> {
    let named = mesh.uv_sets.iter().find(|uv| Some(uv.name.as_ref()) == set);
    let uv = named.map_or(&mesh.vertex_uv, |uv| &uv.vertex_uv);
    uv.exists.then_some(uv)
}

/// Colours of vertices are stored as they are displayed.
fn linear(srgb: f64) -> f32 {
    let c = if srgb.is_finite() { srgb.clamp(0.0, 1.0) as f32 } else { 1.0 };
    if c <= 0.04045 { c / 12.92 } else { libm::powf((c + 0.055) / 1.055, 2.4) }
}

/// A corner with the morph targets that the file shows.
fn at_default_weights(mut drawn: FileVertex, vertex: usize, targets: &[FileTarget]) -> FileVertex {
    for target in targets.iter().filter(|target| target.default_weight != 0.0) {
        let offset = DVec3::from(target.positions[vertex].map(f64::from));
        drawn.position += f64::from(target.default_weight) * offset;
        if let (Some(normal), Some(offset)) = (&mut drawn.normal, target.normals.get(vertex)) {
            *normal = std::array::from_fn(|k| normal[k] + target.default_weight * offset[k]);
        }
    }
    drawn
}
