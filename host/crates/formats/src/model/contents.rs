//! The contents of a model file, in any format.

use armature_geometry::{Influences, TetrahedralMesh, TriangleMesh};
use armature_rig::{Motion, Skeleton};
use glam::Affine3A;

use super::avatar::Avatar;
use super::material::{GreyMaps, Material};
use super::parts::{MeshPart, MorphTarget};

/// A mesh with everything that came with it.
///
/// The geometry in `mesh` is *welded*: a point of the surface is one vertex, even where texture coordinates or
/// normals jump, so that Laplacians and weights see a closed surface. Where attributes do jump, `split` lists the
/// vertices to draw with: a drawn vertex is a mesh vertex together with one texture coordinate and one normal.
/// `normals`, `texture_coordinates` and `vertex_colors` always belong to the drawn vertices; without a split those are the mesh's own.
/// [`Model::split_at_seams`] returns the plain one-array form.
///
/// All meshes of a file are in these arrays, one after the other; `parts` says where each begins and ends and which of
/// the `materials` it is drawn with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// The object's name in the file, or the file's name without its extension.
    pub name: String,
    /// Surface; its unit and axes are the file's (glTF and our own exports: metres, +Y up).
    pub mesh: TriangleMesh,
    /// The volume, if the file has one. Its vertices are exactly `mesh.vertices`, in the same order: interior ones
    /// belong to no triangle.
    pub tetrahedra: Option<TetrahedralMesh>,
    /// Drawn vertices where attributes jump along seams; `None`: the mesh's vertices are drawn as they are.
    pub split: Option<Split>,
    /// Unit normals of the drawn vertices.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates of the drawn vertices: (0, 0) is the image's upper left corner, as in glTF.
    pub texture_coordinates: Option<Vec<[f32; 2]>>,
    /// Colours of the drawn vertices: linear red, green, blue and opacity, which multiply the material's.
    pub vertex_colors: Option<Vec<[f32; 4]>>,
    /// The meshes, in order; empty: the whole surface is one, drawn with the first material.
    pub parts: Vec<MeshPart>,
    /// What parts are drawn with.
    pub materials: Vec<Material>,
    /// What is not yet in `materials`, because images would have to be decoded for it.
    pub grey_maps: Vec<GreyMaps>,
    /// Shapes that parts can be blended towards. `mesh` is the shape with all of them at their default weights.
    pub morph_targets: Vec<MorphTarget>,
    /// The artist's own skeleton and weights.
    pub rig: Option<ModelRig>,
    /// What a VRM avatar says of itself.
    pub avatar: Option<Avatar>,
    /// Named clips on the rig's skeleton.
    pub motions: Vec<(String, Motion)>,
    /// What was unusual, ignored or repaired, in sentences for the user.
    pub warnings: Vec<String>,
}

/// Vertices to draw with, where one mesh vertex needs several.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// The mesh vertex of every drawn vertex.
    pub mesh_vertex: Vec<u32>,
    /// Triangles over drawn vertices, in the order of `mesh.triangles`.
    pub triangles: Vec<[u32; 3]>,
}

/// A skeleton and how the mesh's vertices (not the drawn ones) follow it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelRig {
    /// Bones; skinning with the rest pose leaves the mesh as it is.
    pub skeleton: Skeleton,
    /// One row per vertex of `Model::mesh`.
    pub influences: Influences,
    /// Poses other than the skeleton's rest pose that parts were bound in.
    pub skins: Vec<Skin>,
    /// Vertices of `Model::mesh`, ascending, of which the file does not say what they follow. Their rows are made up: they
    /// stay with a bone that is likely to carry the whole.
    pub unbound: Vec<u32>,
}

/// The pose of the bones in which mesh parts were bound, where that is not the skeleton's rest pose. Their vertices are
/// stored as they lie in that pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// Its name in the file; may be empty.
    pub name: String,
    /// One frame per bone of the skeleton, model space.
    pub bound_model_from_bone: Vec<Affine3A>,
}

impl Model {
    /// The first material; a plain one is added if there is none.
    pub fn first_material(&mut self) -> &mut Material {
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        &mut self.materials[0]
    }

    /// Triangles over the drawn vertices.
    pub fn drawn_triangles(&self) -> &[[u32; 3]] {
        self.split.as_ref().map_or(&self.mesh.triangles, |s| &s.triangles)
    }

    /// Number of drawn vertices: the length of `normals` and `texture_coordinates`.
    pub fn drawn_vertex_count(&self) -> usize {
        self.split.as_ref().map_or(self.mesh.vertices.len(), |s| s.mesh_vertex.len())
    }

    /// The mesh vertex of every drawn vertex.
    pub fn mesh_vertex_of_drawn(&self) -> Vec<u32> {
        self.split.as_ref().map_or_else(|| (0..self.mesh.vertices.len() as u32).collect(), |s| s.mesh_vertex.clone())
    }

    /// The same model with the drawn vertices as its mesh and no split: all arrays have one length, for drawing and
    /// export. If there was a split, the volume is dropped, because its vertices no longer match.
    #[must_use]
    pub fn split_at_seams(&self) -> Self {
        let Some(split) = &self.split else { return self.clone() };
        let vertices = split.mesh_vertex.iter().map(|&v| self.mesh.vertices[v as usize]).collect();
        let rig = self.rig.as_ref().map(|rig| ModelRig {
            skeleton: rig.skeleton.clone(),
            influences: select_rows(&rig.influences, &split.mesh_vertex, rig.skeleton.len()),
            skins: rig.skins.clone(),
            unbound: {
                let unbound = |vertex: &u32| rig.unbound.binary_search(vertex).is_ok();
                (0..).zip(&split.mesh_vertex).filter(|(_, vertex)| unbound(vertex)).map(|(drawn, _)| drawn).collect()
            },
        });
        Self {
            mesh: TriangleMesh { vertices, triangles: split.triangles.clone() },
            tetrahedra: None,
            split: None,
            rig,
            ..self.clone()
        }
    }
}

/// The influences of the listed vertices.
fn select_rows(influences: &Influences, vertices: &[u32], bone_count: usize) -> Influences {
    let per_vertex = influences.per_vertex();
    let rows = vertices.iter().map(|&v| v as usize * per_vertex..(v as usize + 1) * per_vertex);
    let bones = rows.clone().flat_map(|row| influences.bones()[row].iter().copied()).collect();
    let weights = rows.flat_map(|row| influences.weights()[row].iter().copied()).collect();
    // Rows of valid influences are valid; the empty fallback is unreachable.
    Influences::new(per_vertex, bones, weights, bone_count).unwrap_or_default()
}
