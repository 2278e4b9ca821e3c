//! Dual quaternion skinning of positions and normals on the CPU (Kavan et al. 2008; thesis section 6.2.1).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::{Affine3A, DAffine3, DMat3, DQuat, DVec3};

use crate::in_chunks::in_chunks;
use crate::linear_blend_skinning::{SkinError, check_rest, expect_length, unit, widen};
use crate::nearest_rotation::{LANES, Lane, nearest_rotations};
use crate::widest::{Kernel, widest};

/// Real part `[w, x, y, z]`, then the dual part.
type DualQuaternion = [f32; 8];

/// A character made ready to be skinned every frame by blended rigid motions: no joint collapses, however far it is
/// bent or twisted.
#[derive(Clone, Debug)]
pub struct DualQuaternionSkin {
    vertex_count: usize,
    blocks: Vec<Block>,
    layers: Vec<Layer>,
    bone_from_rest: Vec<DAffine3>,
    rest_origins: Vec<DVec3>,
    model_from_rest: Vec<DualQuaternion>,
}

/// Eight vertices as structures of arrays.
#[derive(Clone, Debug)]
struct Block {
    position: [Lane; 3],
    normal: [Lane; 3],
    layers: std::ops::Range<usize>,
}

/// One influence of each of eight vertices, the heaviest in a block's first layer.
#[derive(Clone, Debug)]
struct Layer {
    bones: [u16; LANES],
    weights: Lane,
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
        let vertex_count = rest_positions.len();
        let mut layers = Vec::new();
        let blocks = (0..vertex_count)
            .step_by(LANES)
            .map(|first| Block::new(first, rest_positions, rest_normals, influences, &mut layers))
            .collect();
        Ok(Self {
            vertex_count,
            blocks,
            layers,
            rest_origins: rest_model_from_bone.iter().map(|frame| frame.translation.as_dvec3()).collect(),
            model_from_rest: vec![[0.0; 8]; bone_from_rest.len()],
            bone_from_rest,
        })
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.vertex_count
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
        expect_length("room for positions", positions.len(), self.vertex_count)?;
        expect_length("room for normals", normals.len(), self.vertex_count)?;
        self.set_pose(model_from_bone)?;
        let (layers, bones) = (&self.layers, &self.model_from_rest);
        let skin_chunk = |blocks: &[Block], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]| {
            widest(SkinBlocks { blocks, layers, bones, positions, normals });
        };
        in_chunks::<LANES, _>(&self.blocks, positions, normals, skin_chunk);
        Ok(())
    }

    fn set_pose(&mut self, model_from_bone: &[Affine3A]) -> Result<(), SkinError> {
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
                self.model_from_rest[bone] = parts.map(|c| c as f32);
            }
        }
        Ok(())
    }
}

impl Block {
    fn new(
        first: usize,
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        layers: &mut Vec<Layer>,
    ) -> Self {
        let first_layer = layers.len();
        let (mut position, mut normal) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
        for (lane, vertex) in (first..rest_positions.len()).take(LANES).enumerate() {
            let direction = unit(rest_normals[vertex]);
            for axis in 0..3 {
                position[axis][lane] = rest_positions[vertex][axis];
                normal[axis][lane] = direction[axis];
            }
            for (slot, (bone, weight)) in influences.of_vertex(vertex).enumerate() {
                if layers.len() == first_layer + slot {
                    layers.push(Layer { bones: [0; LANES], weights: [0.0; LANES] });
                }
                layers[first_layer + slot].bones[lane] = bone;
                layers[first_layer + slot].weights[lane] = weight;
            }
        }
        Self { position, normal, layers: first_layer..layers.len() }
    }
}

struct SkinBlocks<'a> {
    blocks: &'a [Block],
    layers: &'a [Layer],
    bones: &'a [DualQuaternion],
    positions: &'a mut [[f32; 3]],
    normals: &'a mut [[f32; 3]],
}

impl Kernel for SkinBlocks<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let outputs = self.positions.chunks_mut(LANES).zip(self.normals.chunks_mut(LANES));
        for (block, (positions, normals)) in self.blocks.iter().zip(outputs) {
            let motion = blend(&self.layers[block.layers.clone()], self.bones);
            write(&move_positions(&motion, &block.position), positions);
            write(&turn(&motion, &block.normal), normals);
        }
    }
}

/// The weighted sum of dual quaternions, made unit: `[component][lane]`.
///
/// No two terms point away from the first one, so that the sum is never shorter than the first weight.
#[inline(always)]
fn blend(layers: &[Layer], bones: &[DualQuaternion]) -> [Lane; 8] {
    let mut sums = [[0.0_f32; 8]; LANES];
    let pivots = layers.first().map_or([0; LANES], |layer| layer.bones);
    for layer in layers {
        for lane in 0..LANES {
            let bone = &bones[usize::from(layer.bones[lane])];
            let pivot = &bones[usize::from(pivots[lane])];
            let along = bone[0] * pivot[0] + bone[1] * pivot[1] + (bone[2] * pivot[2] + bone[3] * pivot[3]);
            let weight = if along < 0.0 { -layer.weights[lane] } else { layer.weights[lane] };
            for c in 0..8 {
                sums[lane][c] += weight * bone[c];
            }
        }
    }
    let mut out = [[0.0; LANES]; 8];
    for lane in 0..LANES {
        for c in 0..8 {
            out[c][lane] = sums[lane][c];
        }
    }
    for l in 0..LANES {
        let squared = out[0][l] * out[0][l] + out[1][l] * out[1][l] + (out[2][l] * out[2][l] + out[3][l] * out[3][l]);
        // Only lanes without a vertex have no length.
        let inverse = 1.0 / squared.max(1e-30).sqrt();
        for part in &mut out {
            part[l] *= inverse;
        }
    }
    out
}

/// `v + 2 q × (q × v + w v)`.
#[inline(always)]
pub(crate) fn turn(motion: &[Lane; 8], v: &[Lane; 3]) -> [Lane; 3] {
    let mut out = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let (w, x, y, z) = (motion[0][l], motion[1][l], motion[2][l], motion[3][l]);
        let (vx, vy, vz) = (v[0][l], v[1][l], v[2][l]);
        let tx = 2.0 * (y * vz - z * vy);
        let ty = 2.0 * (z * vx - x * vz);
        let tz = 2.0 * (x * vy - y * vx);
        out[0][l] = vx + w * tx + (y * tz - z * ty);
        out[1][l] = vy + w * ty + (z * tx - x * tz);
        out[2][l] = vz + w * tz + (x * ty - y * tx);
    }
    out
}

/// Turned, then shifted by `2 (w d − d_w q + q × d)`.
#[inline(always)]
pub(crate) fn move_positions(motion: &[Lane; 8], p: &[Lane; 3]) -> [Lane; 3] {
    let mut out = turn(motion, p);
    for l in 0..LANES {
        let (w, x, y, z) = (motion[0][l], motion[1][l], motion[2][l], motion[3][l]);
        let (dw, dx, dy, dz) = (motion[4][l], motion[5][l], motion[6][l], motion[7][l]);
        out[0][l] += 2.0 * (w * dx - dw * x + (y * dz - z * dy));
        out[1][l] += 2.0 * (w * dy - dw * y + (z * dx - x * dz));
        out[2][l] += 2.0 * (w * dz - dw * z + (x * dy - y * dx));
    }
    out
}

/// The last block may be shorter.
#[inline(always)]
pub(crate) fn write(lanes: &[Lane; 3], to: &mut [[f32; 3]]) {
    for (l, to) in to.iter_mut().enumerate() {
        *to = [lanes[0][l], lanes[1][l], lanes[2][l]];
    }
}

#[cfg(test)]
#[path = "dual_quaternion_skinning_tests.rs"]
mod tests;
