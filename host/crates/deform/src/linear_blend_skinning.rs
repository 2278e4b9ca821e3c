//! Linear blend skinning of positions and normals on the CPU (thesis eq. 2.1: `v' = Σ_b w_b T_b v`).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::{Affine3A, DAffine3, DVec3};

use crate::eight::Eight;
use crate::nearest_rotation::{LANES, Lane};
use crate::skin_blocks::{Blend, Block, Layer, Map, SkinBlocks, skin_blocks};

/// One bone's `model_from_rest` as rows of `(x, y, z, translation)`: two that fill a register, and the third.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Rows {
    upper: Lane,
    lower: [f32; 4],
}

/// A character made ready to be skinned every frame.
#[derive(Clone, Debug)]
pub struct LinearBlendSkin {
    pub(crate) blocks: SkinBlocks,
    bone_from_rest: Vec<DAffine3>,
    model_from_rest: Vec<Rows>,
}

/// Why a character cannot be skinned.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SkinError {
    /// Two arrays that have to be equally long are not.
    #[error("{what}: {got} given, {expected} needed")]
    Length {
        /// Which array.
        what: &'static str,
        /// Its length.
        got: usize,
        /// The length it has to have.
        expected: usize,
    },
    /// A rest position or rest normal is NaN or infinite.
    #[error("vertex {vertex} has a rest position or normal that is not a finite number")]
    VertexNotFinite {
        /// Zero-based vertex.
        vertex: usize,
    },
    /// A vertex follows a bone that is not there.
    #[error("vertex {vertex} follows bone {bone}, but there are only {bone_count} bones")]
    BoneOutOfRange {
        /// Zero-based vertex.
        vertex: usize,
        /// The offending zero-based bone.
        bone: u16,
        /// How many bones there are.
        bone_count: usize,
    },
    /// A rest frame has no inverse (zero scale, or not finite).
    #[error("the rest frame of bone {bone} cannot be inverted; give the bone a scale other than zero at rest")]
    RestNotInvertible {
        /// Zero-based bone.
        bone: usize,
    },
    /// A frame of the pose is NaN or infinite; nothing was written.
    #[error("the pose of bone {bone} is not finite; nothing was skinned")]
    PoseNotFinite {
        /// Zero-based bone.
        bone: usize,
    },
}

impl LinearBlendSkin {
    /// Takes a character in its rest pose.
    ///
    /// `rest_positions`, `rest_normals`: n×3 in model space; normals need no unit length, and a zero normal (a
    /// vertex without a face) stays zero. `influences`: n rows. `rest_model_from_bone`: one frame a bone.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        rest_model_from_bone: &[Affine3A],
    ) -> Result<Self, SkinError> {
        let bone_from_rest = check_rest(rest_positions, rest_normals, influences, rest_model_from_bone)?;
        let blocks = SkinBlocks::new(rest_positions, rest_normals, influences);
        let model_from_rest = vec![Rows { upper: [0.0; LANES], lower: [0.0; 4] }; bone_from_rest.len()];
        Ok(Self { blocks, bone_from_rest, model_from_rest })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.blocks.vertex_count
    }

    /// Number of bones.
    pub fn bone_count(&self) -> usize {
        self.bone_from_rest.len()
    }

    /// Writes the posed positions and unit normals, n×3 each, for one frame a bone.
    ///
    /// Allocates nothing (from 32k vertices on it shares the work among rayon's threads, whose queue may take a
    /// small block now and then when called from outside the pool). Each vertex is computed on its own, so the
    /// result does not depend on the number of threads.
    ///
    /// Normals go through the cofactors of the blended matrix, that is, through its inverse transpose times its
    /// determinant: they agree with the normals of the posed triangles, reflections included. Where the blended
    /// map flattens the surface to a line or a point (a bone of zero scale, opposite twists) the rest normal is
    /// kept, so a normal is always finite.
    pub fn solve(
        &mut self,
        model_from_bone: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        expect_length("posed bones", model_from_bone.len(), self.bone_count())?;
        self.blocks.check_room(positions, normals)?;
        for (bone, frame) in model_from_bone.iter().enumerate() {
            self.set_bone(bone, frame)?;
        }
        skin_blocks(self, &self.blocks.blocks, positions, normals);
        Ok(())
    }

    pub(crate) fn set_bone(&mut self, bone: usize, frame: &Affine3A) -> Result<(), SkinError> {
        let moved = widen(frame) * self.bone_from_rest[bone];
        self.model_from_rest[bone] = rows_of(&moved).ok_or(SkinError::PoseNotFinite { bone })?;
        Ok(())
    }
}

impl Blend for LinearBlendSkin {
    type Block = Block;
    type Motion<E: Eight> = Map<E>;

    #[inline(always)]
    fn blend<E: Eight>(&self, block: &Block) -> Map<E> {
        blend_rows(&self.blocks.layers[block.layers()], &self.model_from_rest)
    }
}

/// Each lane's matrices run along their rows, two rows in one register and the third beside that of the lane four
/// further on; the sums are transposed.
#[inline(always)]
fn blend_rows<E: Eight>(layers: &[Layer], bones: &[Rows]) -> Map<E> {
    let (mut upper, mut lower) = ([E::zero(); LANES], [E::zero(); 4]);
    for layer in layers {
        let rows = |lane: usize| &bones[usize::from(layer.bones[lane])];
        let weights = E::load(&layer.weights).spread();
        for lane in 0..4 {
            let (near, far) = (rows(lane), rows(lane + 4));
            upper[lane] = upper[lane].plus_product(E::load(&near.upper), E::splat(layer.weights[lane]));
            upper[lane + 4] = upper[lane + 4].plus_product(E::load(&far.upper), E::splat(layer.weights[lane + 4]));
            lower[lane] = lower[lane].plus_product(E::halves(&near.lower, &far.lower), weights[lane]);
        }
    }
    let [a, b, c, d, e, f, g, h] = E::transpose(upper);
    [[a, b, c, d], [e, f, g, h], E::transpose_halves(lower)]
}

/// Checks a character in its rest pose; returns the inverse rest frames.
pub(crate) fn check_rest(
    rest_positions: &[[f32; 3]],
    rest_normals: &[[f32; 3]],
    influences: &Influences,
    rest_model_from_bone: &[Affine3A],
) -> Result<Vec<DAffine3>, SkinError> {
    let vertex_count = rest_positions.len();
    expect_length("rest normals", rest_normals.len(), vertex_count)?;
    expect_length("rows of influences", influences.vertex_count(), vertex_count)?;
    let vectors = rest_positions.iter().zip(rest_normals);
    if let Some(vertex) = vectors.clone().position(|(p, n)| !p.iter().chain(n).all(|c| c.is_finite())) {
        return Err(SkinError::VertexNotFinite { vertex });
    }
    let bone_count = rest_model_from_bone.len();
    for vertex in 0..vertex_count {
        if let Some((bone, _)) = influences.of_vertex(vertex).find(|(b, _)| usize::from(*b) >= bone_count) {
            return Err(SkinError::BoneOutOfRange { vertex, bone, bone_count });
        }
    }
    rest_model_from_bone
        .iter()
        .enumerate()
        .map(|(bone, frame)| invert(frame).ok_or(SkinError::RestNotInvertible { bone }))
        .collect()
}

pub(crate) fn expect_length(what: &'static str, got: usize, expected: usize) -> Result<(), SkinError> {
    if got == expected { Ok(()) } else { Err(SkinError::Length { what, got, expected }) }
}

/// Rest frames are inverted and multiplied in `f64`, so that the rest pose gives the identity to the last bit
/// even for a bone far from the origin.
pub(crate) fn widen(frame: &Affine3A) -> DAffine3 {
    DAffine3 { matrix3: frame.matrix3.as_dmat3(), translation: frame.translation.as_dvec3() }
}

fn invert(frame: &Affine3A) -> Option<DAffine3> {
    let inverse = widen(frame).inverse();
    (frame.is_finite() && inverse.is_finite()).then_some(inverse)
}

fn rows_of(frame: &DAffine3) -> Option<Rows> {
    let m = frame.matrix3.transpose();
    let row = |r: DVec3, t: f64| r.extend(t).as_vec4().to_array();
    let [a, b] = [row(m.x_axis, frame.translation.x), row(m.y_axis, frame.translation.y)];
    let lower = row(m.z_axis, frame.translation.z);
    let upper = std::array::from_fn(|i| if i < 4 { a[i] } else { b[i - 4] });
    upper.iter().chain(&lower).all(|c| c.is_finite()).then_some(Rows { upper, lower })
}

pub(crate) fn unit(n: [f32; 3]) -> [f32; 3] {
    let wide = DVec3::new(n[0].into(), n[1].into(), n[2].into());
    wide.normalize_or_zero().as_vec3().to_array()
}

#[cfg(test)]
#[path = "linear_blend_skinning_tests.rs"]
mod tests;
