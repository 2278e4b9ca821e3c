//! A skeleton whose bones are sampled by vertices of a mesh, for endpoint and joint weights.

use glam::DVec3;

use super::projected::projected_endpoint_weight;
use crate::biharmonic::BiharmonicError;
use crate::bone_segment::BoneSegment;

/// Bones and the vertices of a mesh that lie on them.
#[derive(Clone, Copy, Debug)]
pub struct SampledSkeleton<'a> {
    /// n×3 positions of the mesh's vertices (mesh unit); planar meshes have z = 0.
    pub vertices: &'a [[f64; 3]],
    /// The m bones.
    pub bones: &'a [BoneSegment],
    /// For each bone the zero-based vertices on it, including both ends. Bones that meet share a vertex.
    pub bone_vertices: &'a [Vec<usize>],
}

/// Why endpoint or joint weights could not be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EndpointError {
    /// Every bone needs a list of vertices.
    #[error("there are {bones} bones, but {given} lists of vertices for them")]
    BoneCount {
        /// Bones given.
        bones: usize,
        /// Lists of vertices given.
        given: usize,
    },
    /// No vertex lies on a bone.
    #[error("bone {bone} holds no vertex of the mesh; it may lie outside, or have no samples among the vertices")]
    NoVertex {
        /// Zero-based bone.
        bone: usize,
    },
    /// A bone's vertex does not exist.
    #[error("bone {bone} holds vertex {vertex}, but the mesh has only {vertices} vertices")]
    NoSuchVertex {
        /// Zero-based bone.
        bone: usize,
        /// The vertex.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
    /// A bone has an end that is not finite.
    #[error("bone {bone} has a coordinate that is not a finite number")]
    NotFinite {
        /// Zero-based bone.
        bone: usize,
    },
    /// The weights could not be computed; handles are bones here, or joints for joint weights.
    #[error(transparent)]
    Weights(#[from] BiharmonicError),
}

impl SampledSkeleton<'_> {
    /// `wanted`: the number of vertices in the mesh's operators.
    pub(crate) fn check(&self, wanted: usize) -> Result<(), EndpointError> {
        if self.vertices.len() != wanted {
            let given = self.vertices.len();
            return Err(BiharmonicError::Size { what: "the skeleton's mesh", given, wanted }.into());
        }
        if self.bones.len() != self.bone_vertices.len() {
            return Err(EndpointError::BoneCount { bones: self.bones.len(), given: self.bone_vertices.len() });
        }
        if self.bones.is_empty() {
            return Err(BiharmonicError::NoHandles.into());
        }
        for (bone, (ends, held)) in self.bones.iter().zip(self.bone_vertices).enumerate() {
            if !ends.head.iter().chain(&ends.tail).all(|c| c.is_finite()) {
                return Err(EndpointError::NotFinite { bone });
            }
            if held.is_empty() {
                return Err(EndpointError::NoVertex { bone });
            }
            if let Some(&vertex) = held.iter().find(|&&vertex| vertex >= self.vertices.len()) {
                return Err(EndpointError::NoSuchVertex { bone, vertex, vertices: self.vertices.len() });
            }
        }
        Ok(())
    }

    /// Whether a bone's vertices are at different places along it.
    pub(crate) fn has_length(&self, bone: usize) -> bool {
        let mut along = self.bone_vertices[bone].iter().map(|&vertex| self.along(bone, vertex));
        let first = along.next();
        along.any(|other| Some(other) != first)
    }

    /// The vertices on one bone, ascending, each once.
    pub(crate) fn held_by(&self, bone: usize) -> Vec<usize> {
        let mut held = self.bone_vertices[bone].clone();
        held.sort_unstable();
        held.dedup();
        held
    }

    /// How far along a bone a vertex is.
    pub(crate) fn along(&self, bone: usize, vertex: usize) -> f64 {
        projected_endpoint_weight(&self.bones[bone], self.vertices[vertex])
    }

    /// The vertices at a bone's head and tail: the nearest of its own.
    pub(crate) fn ends(&self, bone: usize) -> [usize; 2] {
        let BoneSegment { head, tail } = self.bones[bone];
        [head, tail].map(|end| {
            let apart = |&vertex: &usize| DVec3::from(self.vertices[vertex]).distance_squared(end.into());
            let nearest = self.bone_vertices[bone].iter().map(|v| (apart(v), *v)).min_by(|a, b| a.0.total_cmp(&b.0));
            nearest.map_or(0, |(_, vertex)| vertex)
        })
    }

    /// All vertices on bones, ascending, each once.
    pub(crate) fn held(&self) -> Vec<usize> {
        let mut held: Vec<usize> = self.bone_vertices.iter().flatten().copied().collect();
        held.sort_unstable();
        held.dedup();
        held
    }
}
