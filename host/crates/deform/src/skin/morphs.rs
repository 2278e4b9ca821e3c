//! Shapes that a surface is blended towards before its bones move it (morph targets, blend shapes).

use super::bones::unit_normal;
use super::error::{SkinError, expect_length};

/// What weight 1 of a morph target adds to vertices that follow one another.
#[derive(Clone, Copy, Debug)]
pub struct MorphOffsets<'a> {
    /// The first vertex, zero-based.
    pub first_vertex: usize,
    /// k×3, model space.
    pub positions: &'a [[f32; 3]],
    /// k×3, or empty: the normals stay as they are.
    pub normals: &'a [[f32; 3]],
    /// The weight with which the target is already in the rest shape.
    pub rest_weight: f32,
}

/// Morph targets prepared for blending: `v = v₀ + Σ_t (w_t − w⁰_t) d_t`, with the rest shape's weights `w⁰`.
///
/// Only vertices that some target moves are touched, and only when a weight has changed.
///
/// ```
/// use armature_deform::skin::{LinearBlendSkin, MorphOffsets, Morphs};
/// use armature_geometry::Influences;
/// use glam::{Affine3A, Vec3};
///
/// let (positions, normals) = ([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]; 2]);
/// let smile =
///     MorphOffsets { first_vertex: 1, positions: &[[0.0, 0.5, 0.0]], normals: &[], rest_weight: 0.0 };
/// let mut morphs = Morphs::precompute(&positions, &normals, &[smile])?;
/// let influences = Influences::new(1, vec![0, 0], vec![1.0, 1.0], 1)?;
/// let mut skin = LinearBlendSkin::precompute(&positions, &normals, &influences, &[Affine3A::IDENTITY])?;
/// if morphs.solve(&[0.5])? {
///     skin.set_rest(&morphs)?;
/// }
/// let mut posed = (positions, normals);
/// skin.solve(&[Affine3A::from_translation(Vec3::Z)], &mut posed.0, &mut posed.1)?;
/// assert_eq!(posed.0, [[0.0, 0.0, 1.0], [1.0, 0.25, 1.0]]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Morphs {
    vertex_count: usize,
    /// The vertices that some target moves, ascending.
    vertices: Vec<u32>,
    /// Their rest positions and normals.
    rest: Vec<[[f32; 3]; 2]>,
    /// The same blended.
    blended: Vec<[[f32; 3]; 2]>,
    targets: Vec<Target>,
    /// The weights of `blended`.
    weights: Vec<f32>,
}

#[derive(Clone, Debug)]
struct Target {
    rest_weight: f32,
    /// Places in `vertices`, with what is added to position and normal.
    offsets: Vec<(u32, [[f32; 3]; 2])>,
}

impl Morphs {
    /// Takes a surface at rest, n×3 positions and normals (model space), and what its targets add.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        targets: &[MorphOffsets],
    ) -> Result<Self, SkinError> {
        let vertex_count = rest_positions.len();
        expect_length("rest normals", rest_normals.len(), vertex_count)?;
        let mut is_moved = vec![false; vertex_count];
        for target in targets {
            let end = target.first_vertex.saturating_add(target.positions.len());
            let own = is_moved.get_mut(target.first_vertex..end);
            let length = SkinError::Length { what: "vertices", got: vertex_count, expected: end };
            let own = own.ok_or(length)?;
            if !target.normals.is_empty() {
                expect_length("normals of a morph target", target.normals.len(), target.positions.len())?;
            }
            for (vertex, is_moved) in own.iter_mut().enumerate() {
                *is_moved |= target.of(vertex) != NOTHING;
            }
        }
        let vertices: Vec<u32> = (0..).zip(&is_moved).filter(|(_, moved)| **moved).map(|(vertex, _)| vertex).collect();
        let mut place = vec![u32::MAX; vertex_count];
        for (at, &vertex) in (0..).zip(&vertices) {
            place[vertex as usize] = at;
        }
        let prepared = targets.iter().map(|target| {
            let all = (0..target.positions.len()).map(|k| (place[target.first_vertex + k], target.of(k)));
            let offsets = all.filter(|(_, offset)| *offset != NOTHING).collect();
            Target { rest_weight: target.rest_weight, offsets }
        });
        let targets: Vec<Target> = prepared.collect();
        let rest: Vec<[[f32; 3]; 2]> =
            vertices.iter().map(|&vertex| [rest_positions[vertex as usize], rest_normals[vertex as usize]]).collect();
        let is_finite = |values: &[[f32; 3]; 2]| values.as_flattened().iter().all(|c| c.is_finite());
        let bad_rest = rest.iter().position(|values| !is_finite(values));
        let offsets = targets.iter().flat_map(|target| &target.offsets);
        let bad = bad_rest.or_else(|| offsets.filter(|(_, o)| !is_finite(o)).map(|(at, _)| *at as usize).next());
        if let Some(at) = bad {
            return Err(SkinError::VertexNotFinite { vertex: vertices[at] as usize });
        }
        let weights: Vec<f32> = targets.iter().map(|target| target.rest_weight).collect();
        if let Some(target) = weights.iter().position(|weight| !weight.is_finite()) {
            return Err(SkinError::WeightNotFinite { target });
        }
        Ok(Self { vertex_count, vertices, blended: rest.clone(), rest, targets, weights })
    }

    /// Number of targets.
    pub fn target_count(&self) -> usize {
        self.targets.len()
    }

    /// The weights of the latest blend; those of the rest shape before the first.
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Blends by one weight per target, of any size and sign. Returns whether anything changed. With the rest shape's
    /// weights it is the rest shape to the last bit. Allocates nothing.
    pub fn solve(&mut self, weights: &[f32]) -> Result<bool, SkinError> {
        expect_length("weights of morph targets", weights.len(), self.targets.len())?;
        if let Some(target) = weights.iter().position(|weight| !weight.is_finite()) {
            return Err(SkinError::WeightNotFinite { target });
        }
        if weights == self.weights {
            return Ok(false);
        }
        self.weights.copy_from_slice(weights);
        self.blended.copy_from_slice(&self.rest);
        for (target, weight) in self.targets.iter().zip(weights) {
            let more = (weight - target.rest_weight).clamp(f32::MIN, f32::MAX);
            if more == 0.0 {
                continue;
            }
            for (at, offset) in &target.offsets {
                let blended = &mut self.blended[*at as usize];
                for (value, offset) in blended.as_flattened_mut().iter_mut().zip(offset.as_flattened()) {
                    // The sum of a huge weight and a huge offset stays a number.
                    *value = (*value + more * offset).clamp(f32::MIN, f32::MAX);
                }
            }
        }
        Ok(true)
    }

    /// The vertices that some target moves, ascending, each with its blended position and normal. Normals are of unit
    /// length, or zero.
    pub fn moved(&self) -> impl Iterator<Item = (usize, [f32; 3], [f32; 3])> {
        let vertices = self.vertices.iter().zip(&self.blended);
        vertices.map(|(&vertex, &[position, normal])| (vertex as usize, position, unit_normal(normal)))
    }

    /// Number of vertices of the surface.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
    }
}

const NOTHING: [[f32; 3]; 2] = [[0.0; 3]; 2];

impl MorphOffsets<'_> {
    fn of(&self, vertex: usize) -> [[f32; 3]; 2] {
        [self.positions[vertex], self.normals.get(vertex).copied().unwrap_or_default()]
    }
}
