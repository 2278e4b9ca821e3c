//! Dual quaternion skinning of positions and normals on the CPU (Kavan et al. 2008; thesis section 6.2.1).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3};

use crate::eight::Eight;
use crate::linear_blend_skinning::{SkinError, check_rest, expect_length, widen};
use crate::nearest_rotation::{LANES, Lane, nearest_rotations};
use crate::skin_blocks::{Blend, Block, Layer, Pivots, SkinBlocks, made_unit, skin_blocks};

/// Real part `[w, x, y, z]`, then the dual part.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
struct DualQuaternion(Lane);

/// A character made ready to be skinned every frame by blended rigid motions: no joint collapses, however far it is
/// bent or twisted.
#[derive(Clone, Debug)]
pub struct DualQuaternionSkin {
    pub(crate) blocks: SkinBlocks,
    pub(crate) pivots: Pivots,
    bone_from_rest: Vec<DAffine3>,
    rest_origins: Vec<DVec3>,
    model_from_rest: Vec<DualQuaternion>,
    /// For each pair of bones that meet, the second one on the first one's side.
    signed: Vec<DualQuaternion>,
}

impl DualQuaternionSkin {
    /// Takes a character in its rest pose, as [`LinearBlendSkin::precompute`](crate::LinearBlendSkin::precompute)
    /// does.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        rest_model_from_bone: &[Affine3A],
    ) -> Result<Self, SkinError> {
        let bone_from_rest = check_rest(rest_positions, rest_normals, influences, rest_model_from_bone)?;
        let blocks = SkinBlocks::new(rest_positions, rest_normals, influences);
        let pivots = Pivots::new(&blocks);
        Ok(Self {
            rest_origins: rest_model_from_bone.iter().map(|frame| frame.translation.as_dvec3()).collect(),
            model_from_rest: vec![DualQuaternion([0.0; 8]); bone_from_rest.len()],
            signed: vec![DualQuaternion([0.0; 8]); pivots.pairs.len()],
            blocks,
            pivots,
            bone_from_rest,
        })
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
    /// A dual quaternion knows no scale: of each bone's motion since rest the nearest rotation counts, and where it
    /// takes the bone's origin. Normals turn with the blended rotation. Quaternions of either sign mean the same
    /// rotation; each is taken on the side of the vertex's heaviest bone. Allocates nothing, under the same terms as
    /// [`LinearBlendSkin::solve`](crate::LinearBlendSkin::solve); the result does not depend on the number of
    /// threads.
    pub fn solve(
        &mut self,
        model_from_bone: &[Affine3A],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        expect_length("posed bones", model_from_bone.len(), self.bone_count())?;
        self.blocks.check_room(positions, normals)?;
        self.set_pose(model_from_bone)?;
        skin_blocks(self, &self.blocks.blocks, positions, normals);
        Ok(())
    }

    pub(crate) fn set_pose(&mut self, model_from_bone: &[Affine3A]) -> Result<(), SkinError> {
        self.set_motions(model_from_bone)?;
        for (signed, [pivot, other]) in self.signed.iter_mut().zip(&self.pivots.pairs) {
            let [pivot, other] = [pivot, other].map(|bone| self.model_from_rest[usize::from(*bone)].0);
            *signed = DualQuaternion(if along(&pivot, &other) < 0.0 { other.map(|c| -c) } else { other });
        }
        Ok(())
    }

    fn set_motions(&mut self, model_from_bone: &[Affine3A]) -> Result<(), SkinError> {
        for (number, eight) in model_from_bone.chunks(LANES).enumerate() {
            let mut linear = [[[0.0; LANES]; 3]; 3];
            for (lane, frame) in eight.iter().enumerate() {
                let bone = number * LANES + lane;
                let moved = (widen(frame) * self.bone_from_rest[bone]).matrix3;
                for row in 0..3 {
                    for column in 0..3 {
                        linear[row][column][lane] = moved.col(column)[row] as f32;
                    }
                }
                if !frame.is_finite() || !moved.as_mat3().is_finite() {
                    return Err(SkinError::PoseNotFinite { bone });
                }
            }
            let turned = nearest_rotations(&linear);
            for (lane, frame) in eight.iter().enumerate() {
                let bone = number * LANES + lane;
                let column = |c: usize| DVec3::from_array([0, 1, 2].map(|r| f64::from(turned[r][c][lane])));
                let turn = DQuat::from_mat3(&DMat3::from_cols(column(0), column(1), column(2))).normalize();
                let shift = frame.translation.as_dvec3() - turn * self.rest_origins[bone];
                let dual = DQuat::from_xyzw(shift.x, shift.y, shift.z, 0.0) * turn * 0.5;
                let parts = [turn.w, turn.x, turn.y, turn.z, dual.w, dual.x, dual.y, dual.z];
                self.model_from_rest[bone] = DualQuaternion(parts.map(|c| c as f32));
            }
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
        blend_signed(&self.blocks.layers[layers.clone()], &self.pivots.of_layers[layers], &self.signed)
    }
}

/// The weighted sum of dual quaternions, made unit: `[component]`.
///
/// No two terms point away from the first one, so that the sum is never shorter than the first weight.
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

#[cfg(test)]
#[path = "dual_quaternion_skinning_tests.rs"]
mod tests;
