//! The contents of a GLB or FBX file.

use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Motion, Pose, Skeleton};

use crate::FormatError;
use crate::model::{Material, MeshPart, Model, MorphTarget, Skin, Split};

/// The contents of a GLB or FBX file. Everything is borrowed.
#[derive(Clone, Debug)]
pub struct GlbScene<'a> {
    /// Name of the character.
    pub name: &'a str,
    /// Bones; may be empty for a mesh that does not move.
    pub skeleton: &'a Skeleton,
    /// The surface; may be missing.
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
    /// Normals of the drawn vertices; of any length except zero.
    pub normals: Option<&'a [[f32; 3]]>,
    /// Texture coordinates of the drawn vertices.
    pub texture_coordinates: Option<&'a [[f32; 2]]>,
    /// Linear colours of the drawn vertices.
    pub vertex_colors: Option<&'a [[f32; 4]]>,
    /// How the mesh's vertices follow the bones; `None` only for a skeleton without bones.
    pub influences: Option<&'a Influences>,
    /// The meshes, in order; empty: the whole surface is one, drawn with the first material.
    pub parts: &'a [MeshPart],
    /// Shapes that parts can be blended towards; the surface has them at their default weights.
    pub morph_targets: &'a [MorphTarget],
    /// Poses, other than the skeleton's rest pose, that parts were bound in.
    pub skins: &'a [Skin],
    /// What they are drawn with; may be empty.
    pub materials: &'a [Material],
}

/// The times of a clip's poses.
#[derive(Clone, Copy, Debug)]
pub enum GlbTimes<'a> {
    /// Evenly, the first at zero.
    EverySeconds(f64),
    /// At these seconds, one per pose, not negative and increasing.
    At(&'a [f64]),
}

/// One animation of a [`GlbScene`].
#[derive(Clone, Copy, Debug)]
pub struct GlbClip<'a> {
    /// Its name.
    pub name: &'a str,
    /// The times of its poses.
    pub times: GlbTimes<'a>,
    /// One pose per key, on the scene's skeleton; rotations between keys take the shortest path. Empty if only the weights
    /// change.
    pub poses: &'a [Pose],
    /// For each key one weight per morph target of the scene's mesh, in its order; empty if they do not change.
    pub weights: &'a [Vec<f32>],
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
            vertex_colors: model.vertex_colors.as_deref(),
            parts: &model.parts,
            morph_targets: &model.morph_targets,
            skins: model.rig.as_ref().map_or(&[], |rig| rig.skins.as_slice()),
            materials: &model.materials,
        }
    }
}

impl<'a> GlbClip<'a> {
    /// A clip of a motion at its own rate.
    pub fn of_motion(name: &'a str, motion: &'a Motion) -> Self {
        Self { name, times: GlbTimes::EverySeconds(motion.frame_seconds), poses: &motion.frames, weights: &[] }
    }

    /// Number of keys.
    pub fn keys(&self) -> usize {
        if self.poses.is_empty() { self.weights.len() } else { self.poses.len() }
    }
}

/// An error in what was passed in for writing.
pub(crate) fn bad(what: impl Into<String>, remedy: &str) -> FormatError {
    FormatError::whole("GLB", what, remedy)
}
