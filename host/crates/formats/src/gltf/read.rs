//! glTF to model.

use armature_geometry::{Influences, TriangleMesh};
use glam::{DAffine3, DVec3};
use gltf_json::mesh::Primitive;

use super::accessor::MAX_ELEMENTS;
use super::animation::read_motions;
use super::container::Document;
use super::nodes::Nodes;
use super::primitive::Vertices;
use super::skin::{Rig, blend};
use crate::seams::{position_key, weld};
use crate::texture::set_texture;
use crate::{FormatError, Model, ModelRig, Resolver, Split};

/// Influences a vertex keeps when a file has more.
const MAX_INFLUENCES: usize = 8;

/// Reads all meshes of the shown scene as one, in the scene's frame, with the skeleton of all skins, the colour and
/// texture of the material that most triangles have, and the animations that move the skeleton.
///
/// Vertices at one place and with one skinning are one vertex of the mesh.
pub(crate) fn read_gltf(file: &str, bytes: &[u8], resolver: Resolver) -> Result<Model, FormatError> {
    let document = Document::read(file, bytes, resolver)?;
    let nodes = Nodes::read(&document)?;
    let mut model = Model::default();
    let rig = Rig::read(&document, &nodes, &mut model.warnings)?;
    let mut surface = Surface { rig: rig.as_ref(), ..Surface::default() };
    for &node in nodes.order.iter().filter(|&&n| nodes.shown[n]) {
        if let Some(mesh) = document.root.nodes[node].mesh {
            let mesh = document.get(&document.root.meshes, mesh, "mesh")?;
            surface.mesh_names.push(mesh.name.clone().unwrap_or_default());
            for primitive in &mesh.primitives {
                surface.add(&document, &nodes, node, primitive)?;
            }
        }
    }
    surface.warn(&document, &mut model.warnings);
    if let [name] = surface.mesh_names.as_slice() {
        name.clone_into(&mut model.name);
    }
    surface.material(&document, resolver, &mut model)?;
    surface.finish(&mut model, &document)?;
    if let Some(rig) = &rig {
        model.motions = read_motions(&document, &nodes, rig, &mut model.warnings)?;
    }
    Ok(model)
}

/// What has been gathered from the primitives so far: drawn vertices and triangles over them.
#[derive(Debug, Default)]
struct Surface<'r> {
    rig: Option<&'r Rig>,
    positions: Vec<[f64; 3]>,
    normals: Vec<[f32; 3]>,
    textures: Vec<[f32; 2]>,
    /// Bone and weight, as many a vertex as it has.
    influences: Vec<Vec<(u16, f32)>>,
    triangles: Vec<[u32; 3]>,
    has_normals: bool,
    has_textures: bool,
    /// Triangles of each material (`None` is the default one), in order of appearance.
    triangles_of_material: Vec<(Option<usize>, usize)>,
    mesh_names: Vec<String>,
    skipped_primitives: usize,
    morphs: bool,
    unweighted: usize,
}

impl Surface<'_> {
    fn add(
        &mut self,
        document: &Document,
        nodes: &Nodes,
        node: usize,
        primitive: &Primitive,
    ) -> Result<(), FormatError> {
        let material = match primitive.material {
            Some(index) => Some(document.get(&document.root.materials, index, "material")?),
            None => None,
        };
        let base = material.and_then(|m| m.pbr_metallic_roughness.base_color_texture.as_ref());
        let vertices = document.vertices(primitive, base.map_or(0, |t| t.tex_coord))?;
        let Some(triangles) = document.triangles(primitive, vertices.positions.len())? else {
            self.skipped_primitives += 1;
            return Ok(());
        };
        if self.positions.len() + vertices.positions.len() > MAX_ELEMENTS
            || self.triangles.len() + triangles.len() > 2 * MAX_ELEMENTS
        {
            let what = "all meshes together have more than 16 million vertices";
            return Err(FormatError::whole(document.file, what, "Simplify the meshes"));
        }
        self.morphs |= primitive.targets.as_ref().is_some_and(|t| !t.is_empty());
        let key = primitive.material.map(|index| index.value());
        match self.triangles_of_material.iter_mut().find(|(material, _)| *material == key) {
            Some((_, count)) => *count += triangles.len(),
            None => self.triangles_of_material.push((key, triangles.len())),
        }
        // Only vertices that this primitive draws: several may share one large array.
        let mut number = vec![u32::MAX; vertices.positions.len()];
        let mut used = Vec::new();
        let first = self.positions.len() as u32;
        for triangle in &triangles {
            for &corner in triangle {
                let slot = &mut number[corner as usize];
                if *slot == u32::MAX {
                    *slot = first + used.len() as u32;
                    used.push(corner as usize);
                }
            }
        }
        self.triangles.extend(triangles.iter().map(|t| t.map(|corner| number[corner as usize])));
        self.add_vertices(document, nodes, node, &vertices, &used)
    }

    fn add_vertices(
        &mut self,
        document: &Document,
        nodes: &Nodes,
        node: usize,
        vertices: &Vertices,
        used: &[usize],
    ) -> Result<(), FormatError> {
        self.has_normals |= vertices.normals.is_some();
        self.has_textures |= vertices.textures.is_some();
        let place = self.place(document, nodes, node, vertices)?;
        for &vertex in used {
            let (frame, influences) = place(self, vertex)?;
            let position = frame.transform_point3(DVec3::from(vertices.positions[vertex].map(f64::from)));
            if !position.is_finite() {
                return Err(document.error("a vertex is moved beyond all numbers"));
            }
            self.positions.push(position.to_array());
            let normal = vertices.normals.as_ref().map_or([0.0; 3], |n| n[vertex]);
            let turned = frame.matrix3.inverse().transpose() * DVec3::from(normal.map(f64::from));
            let turned = turned * frame.matrix3.determinant().signum();
            self.normals.push(turned.try_normalize().unwrap_or(DVec3::Y).as_vec3().to_array());
            self.textures.push(vertices.textures.as_ref().map_or([0.0; 2], |t| t[vertex]));
            self.influences.push(influences);
        }
        Ok(())
    }

    /// For a vertex the frame that brings it to the rest pose, and the bones it follows.
    fn place<'a>(
        &self,
        document: &'a Document,
        nodes: &'a Nodes,
        node: usize,
        vertices: &'a Vertices,
    ) -> Result<Place<'a>, FormatError> {
        let world = nodes.world[node];
        let Some(rig) = self.rig else { return Ok(Box::new(move |_, _| Ok((world, Vec::new())))) };
        let skin = match document.root.nodes[node].skin {
            Some(index) => {
                document.get(&document.root.skins, index, "skin")?;
                Some(index.value())
            }
            None => None,
        };
        let Some(skin) = skin.filter(|_| !vertices.joints.is_empty()) else {
            // A rigid part follows the bone it hangs on.
            let bone = rig.bone_above(nodes, node);
            let frame = bone.map_or(world, |b| rig.rest[b] * nodes.world[rig.node_of_bone[b]].inverse() * world);
            let bone = bone.unwrap_or(0) as u16;
            return Ok(Box::new(move |_, _| Ok((frame, vec![(bone, 1.0)]))));
        };
        let joints = &document.root.skins[skin].joints;
        let bones: Vec<usize> = joints.iter().filter_map(|joint| rig.bone_of_node[joint.value()]).collect();
        let frames: Vec<DAffine3> =
            bones.iter().zip(&rig.inverse_binds[skin]).map(|(&bone, bind)| rig.rest[bone] * *bind).collect();
        Ok(Box::new(move |surface, vertex| {
            let mut influences: Vec<(usize, f32)> = Vec::new();
            for (joints, weights) in vertices.joints.iter().map(|set| set[vertex]) {
                for (joint, weight) in joints.into_iter().zip(weights).filter(|(_, w)| *w > 0.0) {
                    if joint as usize >= bones.len() {
                        let what = format!("vertex {vertex} follows joint {joint}, its skin has {}", bones.len());
                        return Err(document.error(what));
                    }
                    match influences.iter_mut().find(|(known, _)| *known == joint as usize) {
                        Some((_, sum)) => *sum += weight,
                        None => influences.push((joint as usize, weight)),
                    }
                }
            }
            if influences.is_empty() {
                surface.unweighted += 1;
                influences.push((0, 1.0));
            }
            let frame = blend(&frames, &influences);
            Ok((frame, influences.into_iter().map(|(joint, w)| (bones[joint] as u16, w)).collect()))
        }))
    }

    fn warn(&self, document: &Document, warnings: &mut Vec<String>) {
        if self.skipped_primitives > 0 {
            warnings.push(format!("{} sets of points or lines are left out.", self.skipped_primitives));
        }
        if self.morphs {
            warnings.push("Morph targets are left out.".to_owned());
        }
        if self.unweighted > 0 {
            warnings
                .push(format!("{} vertices follow no joint; the first of their skin carries them.", self.unweighted));
        }
        if document.root.extensions_used.iter().any(|e| e == "KHR_texture_transform") {
            warnings.push("Texture transforms are left out.".to_owned());
        }
    }

    fn material(&self, document: &Document, resolver: Resolver, model: &mut Model) -> Result<(), FormatError> {
        // The last of equals would win; the first is to.
        let most = self.triangles_of_material.iter().rev().max_by_key(|(_, count)| *count);
        let Some(index) = most.and_then(|(material, _)| *material) else { return Ok(()) };
        if self.triangles_of_material.len() > 1 {
            let count = self.triangles_of_material.len();
            model.warnings.push(format!("Of {count} materials only the one of most triangles is used."));
        }
        let root = &document.root;
        let surface = &root.materials[index].pbr_metallic_roughness;
        let color = surface.base_color_factor.0;
        if color.iter().all(|c| c.is_finite()) {
            model.base_color = Some(color.map(|c| c.clamp(0.0, 1.0)));
        }
        let Some(info) = &surface.base_color_texture else { return Ok(()) };
        let texture = document.get(&root.textures, info.index, "texture")?;
        let Some(image) = root.images.get(texture.source.value()) else {
            model.warnings.push("The texture is left out: its image is of a kind only an extension knows.".to_owned());
            return Ok(());
        };
        match (image.buffer_view, &image.uri) {
            (Some(view), _) => set_texture("of the file", document.view(view)?.0.to_vec(), model),
            (None, Some(uri)) => match document.fetch(uri, resolver) {
                Ok(bytes) => set_texture(image.name.as_deref().unwrap_or("beside the file"), bytes, model),
                Err(error) => model.warnings.push(format!("The texture is left out: {}.", error.what)),
            },
            (None, None) => {}
        }
        Ok(())
    }

    /// Welds the drawn vertices to the mesh.
    fn finish(self, model: &mut Model, document: &Document) -> Result<(), FormatError> {
        let key = |(position, influences): (&[f64; 3], &Vec<(u16, f32)>)| {
            let row: Vec<(u16, u32)> = influences.iter().map(|(bone, w)| (*bone, w.to_bits())).collect();
            (position_key(*position), row)
        };
        let (firsts, groups) = weld(self.positions.iter().zip(&self.influences).map(key));
        let attributes = self.has_normals || self.has_textures;
        if firsts.len() < self.positions.len() && attributes {
            model.split = Some(Split { mesh_vertex: groups.clone(), triangles: self.triangles.clone() });
        }
        model.mesh = TriangleMesh {
            vertices: firsts.iter().map(|&first| self.positions[first as usize]).collect(),
            triangles: self.triangles.iter().map(|t| t.map(|v| groups[v as usize])).collect(),
        };
        model.normals = self.has_normals.then_some(self.normals);
        model.texture_coordinates = self.has_textures.then_some(self.textures);
        if let Some(rig) = self.rig {
            let rows: Vec<&[(u16, f32)]> = firsts.iter().map(|&f| self.influences[f as usize].as_slice()).collect();
            let influences = influences(&rows, rig.skeleton.len()).map_err(|e| document.error(e.to_string()))?;
            model.rig = Some(ModelRig { skeleton: rig.skeleton.clone(), influences });
        }
        Ok(())
    }
}

/// Frame and influences of a vertex; counts on the surface what it had to repair.
type Place<'a> = Box<dyn Fn(&mut Surface, usize) -> Result<(DAffine3, Vec<(u16, f32)>), FormatError> + 'a>;

/// Rows of differing length to a table, at most [`MAX_INFLUENCES`] wide, the heaviest kept.
fn influences(rows: &[&[(u16, f32)]], bone_count: usize) -> Result<Influences, armature_geometry::InfluencesError> {
    let per_vertex = rows.iter().map(|r| r.len()).max().unwrap_or(1).clamp(1, MAX_INFLUENCES);
    let mut bones = Vec::with_capacity(rows.len() * per_vertex);
    let mut weights = Vec::with_capacity(rows.len() * per_vertex);
    for row in rows {
        let mut sorted = row.to_vec();
        sorted.sort_by(|a, b| b.1.total_cmp(&a.1));
        sorted.resize(per_vertex, (0, 0.0));
        bones.extend(sorted.iter().map(|(bone, _)| *bone));
        weights.extend(sorted.iter().map(|(_, weight)| *weight));
    }
    Influences::new(per_vertex, bones, weights, bone_count)
}
