//! A motion and its surface as another program wants them: with its names of bones, and resting in a T or an A.

use armature_formats::gltf::GlbMesh;
use armature_formats::model::{MeshPart, Skin};
use armature_rig::{BoneNames, Motion, RestPose, Skeleton, rest_in};

/// What a program wants of a skeleton.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dress {
    /// Arms and legs rest so; the motion stays what it is.
    pub rest: Option<RestPose>,
    /// The rest pose comes first, as a frame of its own.
    pub rest_first: bool,
    /// What recognised bones are called.
    pub names: Option<BoneNames>,
}

/// A skeleton in its new dress, and the parts of a surface that were bound in the old one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dressed {
    /// The same bones.
    pub skeleton: Skeleton,
    parts: Vec<MeshPart>,
    skins: Vec<Skin>,
}

impl Dress {
    /// Dresses a motion; the error says why its limbs cannot be brought to the pose. `mesh`: the surface that goes with it.
    pub fn apply(&self, motion: &mut Motion, mesh: Option<&GlbMesh<'_>>) -> Result<Dressed, String> {
        let before = motion.skeleton.clone();
        let mut skeleton = before.clone();
        if let Some(pose) = self.rest {
            skeleton = rest_in(pose, &skeleton)?;
        }
        if let Some(names) = self.names {
            skeleton = names.rename(&skeleton);
        }
        if self.rest_first {
            motion.frames.insert(0, skeleton.rest_pose());
        }
        motion.skeleton = skeleton.clone();
        let mut dressed = Dressed { skeleton, parts: Vec::new(), skins: Vec::new() };
        if let (Some(mesh), Some(_)) = (mesh, self.rest) {
            dressed.keep_bound(mesh, &before);
        } else if let Some(mesh) = mesh {
            dressed.parts = mesh.parts.to_vec();
            dressed.skins = mesh.skins.to_vec();
        }
        Ok(dressed)
    }
}

impl Dressed {
    /// Parts that were bound in the old rest pose are bound there, not in the new one.
    fn keep_bound(&mut self, mesh: &GlbMesh<'_>, before: &Skeleton) {
        self.skins = mesh.skins.to_vec();
        let own = self.skins.len() as u32;
        self.skins.push(Skin { name: "bound".to_owned(), bound_model_from_bone: before.rest_model_from_bone() });
        self.parts = mesh.parts.to_vec();
        if self.parts.is_empty() {
            let vertices = mesh.split.map_or(mesh.mesh.vertices.len(), |split| split.mesh_vertex.len()) as u32;
            let material = (!mesh.materials.is_empty()).then_some(0);
            let triangles = 0..mesh.mesh.triangles.len() as u32;
            self.parts.push(MeshPart { vertices: 0..vertices, triangles, material, ..MeshPart::default() });
        }
        self.parts.iter_mut().for_each(|part| part.skin = part.skin.or(Some(own)));
    }

    /// The surface on this skeleton.
    pub fn mesh<'a>(&'a self, mesh: GlbMesh<'a>) -> GlbMesh<'a> {
        GlbMesh { parts: &self.parts, skins: &self.skins, ..mesh }
    }
}
