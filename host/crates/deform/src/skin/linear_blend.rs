//! Linear blend skinning of positions and normals on the CPU (thesis eq. 2.1: `v' = Σ_b w_b T_b v`).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::Affine3A;

use super::blocks::{Blend, Block, Layer, Map};
use super::bones::{BoneBinding, BoneRows};
use super::error::SkinError;
use super::frame_skin::{FrameSkin, RestSkin, solve_frames};
use super::morphs::Morphs;
use crate::lanes::{Eight, LANES, Lane};

/// One bone's `model_from_rest` as rows of `(x, y, z, translation)`: two that fill a register, and the third.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct Rows {
    upper: Lane,
    lower: [f32; 4],
}

/// A character prepared for skinning every frame.
#[derive(Clone, Debug)]
pub struct LinearBlendSkin {
    rest: RestSkin,
    model_from_rest: Vec<Rows>,
}

impl LinearBlendSkin {
    /// Takes a character in its rest pose.
    ///
    /// `rest_positions`, `rest_normals`: n×3 in model space; normals need not be of unit length, and a zero normal (a
    /// vertex without a face) stays zero. `influences`: n rows. `rest_model_from_bone`: one frame per bone.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        rest_model_from_bone: &[Affine3A],
    ) -> Result<Self, SkinError> {
        Ok(Self::of(RestSkin::new(rest_positions, rest_normals, influences, rest_model_from_bone)?))
    }

    /// The same for vertices bound in several poses: `influences` refer to `bindings`, which refer to bones.
    pub fn precompute_bound(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        bindings: &[BoneBinding],
        bone_count: usize,
    ) -> Result<Self, SkinError> {
        Ok(Self::of(RestSkin::bound(rest_positions, rest_normals, influences, bindings, bone_count)?))
    }

    fn of(rest: RestSkin) -> Self {
        let model_from_rest = vec![Rows { upper: [0.0; LANES], lower: [0.0; 4] }; rest.frames.binding_count()];
        Self { rest, model_from_rest }
    }

    /// Moves the rest shape to where morph targets have it. Allocates nothing.
    pub fn set_rest(&mut self, morphs: &Morphs) -> Result<(), SkinError> {
        self.rest.blocks.set_rest(morphs)
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.rest.blocks.vertex_count
    }

    /// Number of bones.
    pub fn bone_count(&self) -> usize {
        self.rest.frames.bone_count()
    }

    /// Writes the posed positions and unit normals, n×3 each, for one frame per bone.
    ///
    /// Allocates nothing (from 32k vertices on it shares the work among rayon's threads, whose queue may allocate a
    /// small block now and then when called from outside the pool). Each vertex is computed independently, so the
    /// result does not depend on the number of threads.
    ///
    /// Normals are transformed by the cofactors of the blended matrix (its inverse transpose times its determinant):
    /// they agree with the normals of the posed triangles, including reflections. Where the blended map flattens the
    /// surface to a line or a point (a bone of zero scale, opposite twists) the rest normal is kept, so a normal is
    /// always finite.
    pub fn solve(
        &mut self,
        model_from_bone: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        solve_frames(self, model_from_bone, positions, normals)
    }
}

impl FrameSkin for LinearBlendSkin {
    fn rest(&self) -> &RestSkin {
        &self.rest
    }

    fn set_pose(&mut self, model_from_bone: &[Affine3A]) -> Result<(), SkinError> {
        self.rest.frames.rows(model_from_bone, |bone, rows| self.model_from_rest[bone] = Rows::of(rows))
    }
}

impl Rows {
    fn of([a, b, lower]: BoneRows) -> Self {
        Self { upper: std::array::from_fn(|i| if i < 4 { a[i] } else { b[i - 4] }), lower }
    }
}

impl Blend for LinearBlendSkin {
    type Block = Block;
    type Motion<E: Eight> = Map<E>;

    #[inline(always)]
    fn blend<E: Eight>(&self, block: &Block) -> Map<E> {
        blend_rows(&self.rest.blocks.layers[block.layers()], &self.model_from_rest)
    }
}

/// Each lane's matrices are stored by rows, two rows in one register and the third next to that of the lane four
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
