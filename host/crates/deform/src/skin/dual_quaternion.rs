//! Dual quaternion skinning of positions and normals on the CPU (Kavan et al. 2008; thesis section 6.2.1).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::Affine3A;

use super::blocks::{Blend, Block, Layer, Pivots, made_unit};
use super::bones::BoneBinding;
use super::error::SkinError;
use super::frame_skin::{FrameSkin, RestSkin, solve_frames};
use super::morphs::Morphs;
use crate::lanes::{Eight, LANES, Lane};

/// Real part `[w, x, y, z]`, then the dual part.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct DualQuaternion(Lane);

/// A character prepared for skinning every frame with blended rigid motions: no joint collapses, however far it is bent
/// or twisted.
#[derive(Clone, Debug)]
pub struct DualQuaternionSkin {
    rest: RestSkin,
    pub(super) pivots: Pivots,
    model_from_rest: Vec<DualQuaternion>,
    /// For each pair of bones that meet, the second one on the first one's side.
    signed: Vec<DualQuaternion>,
}

impl DualQuaternionSkin {
    /// Takes a character in its rest pose, like [`LinearBlendSkin::precompute`](super::LinearBlendSkin::precompute).
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
        let pivots = Pivots::new(&rest.blocks);
        let none = |count| vec![DualQuaternion([0.0; LANES]); count];
        Self { model_from_rest: none(rest.frames.binding_count()), signed: none(pivots.pairs.len()), rest, pivots }
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
    /// Dual quaternions have no scale: for each bone's motion since rest, the nearest rotation is used, and where it
    /// takes the bone's origin. Normals turn with the blended rotation. Quaternions of either sign mean the same
    /// rotation; each is taken on the side of the vertex's heaviest bone. Allocates nothing, under the same terms as
    /// [`LinearBlendSkin::solve`](super::LinearBlendSkin::solve); the result does not depend on the number of threads.
    pub fn solve(
        &mut self,
        model_from_bone: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        solve_frames(self, model_from_bone, positions, normals)
    }
}

impl FrameSkin for DualQuaternionSkin {
    fn rest(&self) -> &RestSkin {
        &self.rest
    }

    fn set_pose(&mut self, model_from_bone: &[Affine3A]) -> Result<(), SkinError> {
        self.rest
            .frames
            .motions(model_from_bone, |bone, motion| self.model_from_rest[bone] = DualQuaternion(motion))?;
        for (signed, [pivot, other]) in self.signed.iter_mut().zip(&self.pivots.pairs) {
            let [pivot, other] = [pivot, other].map(|bone| self.model_from_rest[usize::from(*bone)].0);
            *signed = DualQuaternion(if along(&pivot, &other) < 0.0 { other.map(|c| -c) } else { other });
        }
        Ok(())
    }
}

fn along(a: &Lane, b: &Lane) -> f32 {
    a[0] * b[0] + a[1] * b[1] + (a[2] * b[2] + a[3] * b[3])
}

impl Blend for DualQuaternionSkin {
    type Block = Block;
    type Motion<E: Eight> = [E; 8];

    #[inline(always)]
    fn blend<E: Eight>(&self, block: &Block) -> [E; 8] {
        let layers = block.layers();
        blend_signed(&self.rest.blocks.layers[layers.clone()], &self.pivots.of_layers[layers], &self.signed)
    }
}

/// The weighted sum of dual quaternions, normalised: `[component]`.
///
/// No two terms point away from the first one, so the sum is never shorter than the first weight.
#[inline(always)]
fn blend_signed<E: Eight>(layers: &[Layer], pairs: &[[u32; LANES]], motions: &[DualQuaternion]) -> [E; 8] {
    let mut sums = [E::zero(); LANES];
    for (layer, pairs) in layers.iter().zip(pairs) {
        for lane in 0..LANES {
            let motion = E::load(&motions[pairs[lane] as usize].0);
            sums[lane] = sums[lane].plus_product(motion, E::splat(layer.weights[lane]));
        }
    }
    made_unit(E::transpose(sums))
}
