//! All primitives of a scene, one after the other, in its rest pose.

use glam::{DAffine3, DVec3};
use gltf_json::mesh::{Mesh, Primitive};
use serde::Deserialize;

use super::container::Document;
use super::nodes::Nodes;
use super::primitive::{Target, Vertices};
use super::read_material::Placement;
use super::rest::relative;
use super::skin::{Rig, blend};
use super::vrm::TargetSource;
use crate::FormatError;
use crate::model::Model;
use crate::model::collect::{Collected, FileTarget, FileVertex, Following};
use crate::text::counted;
use crate::text::names::UniqueNames;

/// What has been gathered from the primitives so far.
#[derive(Debug, Default)]
pub(super) struct Gathered<'r> {
    rig: Option<&'r Rig>,
    collected: Collected,
    /// Where each morph target of the model comes from.
    pub(super) target_sources: Vec<TargetSource>,
    /// The materials that are used, in order of appearance.
    pub(super) materials: Vec<usize>,
    pub(super) mesh_names: Vec<String>,
    skipped_primitives: usize,
    unweighted: usize,
}

/// What a mesh's primitives share.
struct MeshOfNode<'a> {
    node: usize,
    mesh: usize,
    name: String,
    /// The names of its morph targets, as many as the file gives.
    target_names: Vec<String>,
    weights: &'a [f32],
}

impl<'r> Gathered<'r> {
    pub(super) fn new(rig: Option<&'r Rig>) -> Self {
        Self { rig, ..Self::default() }
    }

    /// Adds the mesh of a node, if it has one.
    pub(super) fn add_node(&mut self, document: &Document, nodes: &Nodes, node: usize) -> Result<(), FormatError> {
        let Some(index) = document.root.nodes[node].mesh else { return Ok(()) };
        let mesh = document.get(&document.root.meshes, index, "mesh")?;
        self.mesh_names.push(mesh.name.clone().unwrap_or_default());
        let own_weights = document.root.nodes[node].weights.as_deref();
        let weights = own_weights.or(mesh.weights.as_deref()).unwrap_or_default();
        if !weights.iter().all(|weight| weight.is_finite()) {
            return Err(document.error("a weight of a morph target is not finite"));
        }
        let name = mesh.name.clone().unwrap_or_default();
        let fallback = if name.is_empty() { format!("mesh_{}", index.value() + 1) } else { name.clone() };
        let shared =
            MeshOfNode { node, mesh: index.value(), name, target_names: target_names(mesh, &fallback), weights };
        for primitive in &mesh.primitives {
            self.add(document, nodes, &shared, primitive)?;
        }
        Ok(())
    }

    fn add(
        &mut self,
        document: &Document,
        nodes: &Nodes,
        mesh: &MeshOfNode,
        primitive: &Primitive,
    ) -> Result<(), FormatError> {
        let material = match primitive.material {
            Some(index) => Some(document.get(&document.root.materials, index, "material")?),
            None => None,
        };
        let placement = material.map(Placement::of_material);
        let mut vertices = document.vertices(primitive, placement.map_or(0, |p| p.set), mesh.weights)?;
        let Some(triangles) = document.triangles(primitive, vertices.positions.len())? else {
            self.skipped_primitives += 1;
            return Ok(());
        };
        if triangles.is_empty() {
            return Ok(());
        }
        if let Some(placement) = placement {
            vertices.textures.iter_mut().flatten().for_each(|uv| *uv = placement.apply(*uv));
        }
        // Only vertices that this primitive draws: several may share one large array.
        let mut number = vec![u32::MAX; vertices.positions.len()];
        let mut used = Vec::new();
        for triangle in &triangles {
            for &corner in triangle {
                let slot = &mut number[corner as usize];
                if *slot == u32::MAX {
                    *slot = used.len() as u32;
                    used.push(corner as usize);
                }
            }
        }
        self.add_vertices(document, nodes, mesh.node, &vertices, &used)?;
        let select = |offsets: &[[f32; 3]]| -> Vec<[f32; 3]> {
            if offsets.is_empty() { Vec::new() } else { used.iter().map(|&vertex| offsets[vertex]).collect() }
        };
        let target = |(index, target): (usize, &Target)| FileTarget {
            name: mesh.target_names[index].clone(),
            default_weight: mesh.weights.get(index).copied().unwrap_or_default(),
            positions: select(&target.positions),
            normals: select(&target.normals),
        };
        let targets = vertices.targets.iter().enumerate().map(target).collect();
        let source = |index| TargetSource { node: mesh.node, mesh: mesh.mesh, index };
        self.target_sources.extend((0..vertices.targets.len()).map(source));
        let triangles: Vec<[u32; 3]> = triangles.iter().map(|t| t.map(|corner| number[corner as usize])).collect();
        let material = primitive.material.map(|index| self.material(index.value()));
        self.collected.end_part(&mesh.name, material, &triangles, targets).map_err(|what| document.error(what))
    }

    /// Our number of a material.
    fn material(&mut self, index: usize) -> u32 {
        let known = self.materials.iter().position(|&material| material == index);
        known.unwrap_or_else(|| {
            self.materials.push(index);
            self.materials.len() - 1
        }) as u32
    }

    fn add_vertices(
        &mut self,
        document: &Document,
        nodes: &Nodes,
        node: usize,
        vertices: &Vertices,
        used: &[usize],
    ) -> Result<(), FormatError> {
        let place = self.place(document, nodes, node, vertices)?;
        for &vertex in used {
            let (frame, following) = place(self, vertex)?;
            let read = FileVertex {
                position: DVec3::from(vertices.positions[vertex].map(f64::from)),
                normal: vertices.normals.as_ref().map(|n| n[vertex]),
                texture: vertices.textures.as_ref().map(|t| t[vertex]),
                color: vertices.colors.as_ref().map(|c| c[vertex]),
            };
            self.collected.add_vertex(&frame, &read, following).map_err(|what| document.error(what))?;
        }
        Ok(())
    }

    /// For a vertex, the frame that brings it to the rest pose, and the bones it follows.
    fn place<'a>(
        &self,
        document: &'a Document,
        nodes: &'a Nodes,
        node: usize,
        vertices: &'a Vertices,
    ) -> Result<Place<'a>, FormatError> {
        let world = nodes.world[node];
        let Some(rig) = self.rig else { return Ok(Box::new(move |_, _| Ok((world, Following::default())))) };
        let skin = match document.root.nodes[node].skin {
            Some(index) => {
                document.get(&document.root.skins, index, "skin")?;
                Some(index.value())
            }
            None => None,
        };
        let Some(skin) = skin.filter(|_| !vertices.joints.is_empty()) else {
            // A rigid part follows the bone it is attached to.
            let bone = rig.bone_above(nodes, node);
            let frame = bone.map_or(world, |b| {
                let joint = rig.node_of_bone[b];
                // A joint scaled to nothing has no inverse.
                if nodes.world[joint].matrix3.determinant() == 0.0 {
                    return rig.rest[b] * relative(nodes, Some(joint), node);
                }
                rig.rest[b] * nodes.world[joint].inverse() * world
            });
            let following = bone.map_or(Following::made_up(0), |bone| Following::bound(vec![(bone as u16, 1.0)]));
            return Ok(Box::new(move |_, _| Ok((frame, following.clone()))));
        };
        let joints = &document.root.skins[skin].joints;
        let bones: Vec<usize> = joints.iter().filter_map(|joint| rig.bone_of_node[joint.value()]).collect();
        let frames: Vec<DAffine3> =
            bones.iter().zip(&rig.inverse_binds[skin]).map(|(&bone, bind)| rig.rest[bone] * *bind).collect();
        Ok(Box::new(move |gathered, vertex| {
            let mut influences: Vec<(usize, f32)> = Vec::new();
            for (joints, weights) in vertices.joints.iter().map(|set| set[vertex]) {
                for (joint, weight) in joints.into_iter().zip(weights).filter(|(_, w)| *w > 0.0) {
                    if joint as usize >= bones.len() {
                        let what = format!("vertex {vertex} follows joint {joint}, but its skin has {}", bones.len());
                        return Err(document.error(what));
                    }
                    match influences.iter_mut().find(|(known, _)| *known == joint as usize) {
                        Some((_, sum)) => *sum += weight,
                        None => influences.push((joint as usize, weight)),
                    }
                }
            }
            let unbound = influences.is_empty();
            if unbound {
                gathered.unweighted += 1;
                influences.push((0, 1.0));
            }
            let frame = blend(&frames, &influences);
            let mut of_bones: Vec<(u16, f32)> = Vec::with_capacity(influences.len());
            for (joint, weight) in influences {
                let bone = bones[joint] as u16;
                // A skin may list a joint twice.
                match of_bones.iter_mut().find(|(known, _)| *known == bone) {
                    Some((_, sum)) => *sum += weight,
                    None => of_bones.push((bone, weight)),
                }
            }
            Ok((frame, Following { influences: of_bones, unbound }))
        }))
    }

    pub(super) fn warn(&self, warnings: &mut Vec<String>) {
        if self.skipped_primitives > 0 {
            let sets = counted(self.skipped_primitives, ["set", "sets"]);
            warnings.push(format!("{sets} of points or lines: ignored."));
        }
        if self.unweighted > 0 {
            let vertices = counted(self.unweighted, ["vertex follows", "vertices follow"]);
            warnings.push(format!("{vertices} no joint; the first of the skin carries them."));
        }
    }

    /// Welds the drawn vertices into the mesh.
    pub(super) fn finish(self, model: &mut Model, document: &Document) -> Result<(), FormatError> {
        let skeleton = self.rig.map(|rig| &rig.skeleton);
        self.collected.finish(skeleton, model).map_err(|what| document.error(what))
    }
}

/// Frame of a vertex and what it follows; counts what had to be repaired.
type Place<'a> = Box<dyn Fn(&mut Gathered, usize) -> Result<(DAffine3, Following), FormatError> + 'a>;

#[derive(Default, Deserialize)]
#[serde(default, rename_all = "camelCase")]
struct Extras {
    target_names: Vec<String>,
}

/// The names that exporters give by convention, each once; numbered ones after the mesh where there are none.
fn target_names(mesh: &Mesh, mesh_name: &str) -> Vec<String> {
    let of = |extras: &gltf_json::Extras| serde_json::from_str::<Extras>(extras.as_ref()?.get()).ok();
    let mut extras = std::iter::once(&mesh.extras).chain(mesh.primitives.iter().map(|primitive| &primitive.extras));
    let given = extras.find_map(|extras| of(extras).filter(|e| !e.target_names.is_empty())).unwrap_or_default();
    let count = mesh.primitives.iter().map(|primitive| primitive.targets.as_ref().map_or(0, Vec::len)).max();
    let mut names = UniqueNames::default();
    let name = |index: usize| {
        let given = given.target_names.get(index).map(String::as_str).unwrap_or_default();
        names.give(given, &format!("{mesh_name}.{}", index + 1))
    };
    (0..count.unwrap_or_default()).map(name).collect()
}
