//! What a model file holds, whatever its format.

use armature_geometry::{Influences, TetrahedralMesh, TriangleMesh};
use armature_rig::{Motion, Skeleton};

/// A mesh with what came along with it.
///
/// The geometry in `mesh` is *welded*: a point of the surface is one vertex, even where texture coordinates or
/// normals jump, so that Laplacians and weights see a closed surface. Where attributes do jump, `split` lists the
/// vertices to draw with: a drawn vertex is a mesh vertex together with one texture coordinate and one normal.
/// `normals` and `texture_coordinates` always belong to the drawn vertices; without a split those are the mesh's own.
/// [`Model::split_at_seams`] gives the plain one-array form.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Model {
    /// The object's name in the file, or the file's own without its extension.
    pub name: String,
    /// Surface; its unit and axes are the file's (glTF and our own exports: metres, +Y up).
    pub mesh: TriangleMesh,
    /// The volume, where the file has one. Its vertices are exactly `mesh.vertices`, in the same order: those
    /// inside belong to no triangle.
    pub tetrahedra: Option<TetrahedralMesh>,
    /// Drawn vertices where attributes jump along seams; `None`: the mesh's vertices are drawn as they are.
    pub split: Option<Split>,
    /// Unit normals of the drawn vertices.
    pub normals: Option<Vec<[f32; 3]>>,
    /// Texture coordinates of the drawn vertices: (0, 0) is the image's upper left corner, as in glTF.
    pub texture_coordinates: Option<Vec<[f32; 2]>>,
    /// Base colour, linear red, green, blue and opacity, each in 0..=1; multiplies the texture.
    pub base_color: Option<[f32; 4]>,
    /// Base colour image, sRGB.
    pub texture: Option<Texture>,
    /// The artist's own skeleton and weights.
    pub rig: Option<ModelRig>,
    /// Named clips on the rig's skeleton.
    pub motions: Vec<(String, Motion)>,
    /// What was found odd, left out or repaired on the way, in sentences for the user.
    pub warnings: Vec<String>,
}

/// Vertices to draw with, where one mesh vertex needs several.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// For every drawn vertex the mesh vertex it sits on.
    pub mesh_vertex: Vec<u32>,
    /// Triangles over drawn vertices, in the order of `mesh.triangles`.
    pub triangles: Vec<[u32; 3]>,
}

/// An image as its file's bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// `image/png` or `image/jpeg`.
    pub mime: String,
    /// The encoded image.
    pub bytes: Vec<u8>,
}

/// A skeleton and how the mesh's vertices (not the drawn ones) follow it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ModelRig {
    /// Bones; skinning with the rest pose leaves the mesh as it is.
    pub skeleton: Skeleton,
    /// One row a vertex of `Model::mesh`.
    pub influences: Influences,
}

impl Model {
    /// Triangles over the drawn vertices.
    pub fn drawn_triangles(&self) -> &[[u32; 3]] {
        self.split.as_ref().map_or(&self.mesh.triangles, |s| &s.triangles)
    }

    /// Number of drawn vertices: the length of `normals` and `texture_coordinates`.
    pub fn drawn_vertex_count(&self) -> usize {
        self.split.as_ref().map_or(self.mesh.vertices.len(), |s| s.mesh_vertex.len())
    }

    /// For every drawn vertex the mesh vertex it sits on.
    pub fn mesh_vertex_of_drawn(&self) -> Vec<u32> {
        self.split.as_ref().map_or_else(|| (0..self.mesh.vertices.len() as u32).collect(), |s| s.mesh_vertex.clone())
    }

    /// The same model with the drawn vertices as its mesh and no split: every array has one length, for drawing and
    /// for exports. The volume is dropped where there was a split, as its vertices no longer match.
    #[must_use]
    pub fn split_at_seams(&self) -> Self {
        let Some(split) = &self.split else { return self.clone() };
        let vertices = split.mesh_vertex.iter().map(|&v| self.mesh.vertices[v as usize]).collect();
        let rig = self.rig.as_ref().map(|rig| ModelRig {
            skeleton: rig.skeleton.clone(),
            influences: select_rows(&rig.influences, &split.mesh_vertex, rig.skeleton.len()),
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
