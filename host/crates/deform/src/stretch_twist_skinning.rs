//! Stretchable, twistable bones over linear or dual quaternion blending (thesis eqs. 6.4 to 6.6).
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use armature_geometry::Influences;
use glam::{Affine3A, DQuat, DVec3, Quat, Vec3};

use crate::dual_quaternion_skinning::{move_positions, turn, write};
use crate::in_chunks::in_chunks;
use crate::linear_blend_skinning::{SkinError, check_rest, expect_length, unit};
use crate::nearest_rotation::{LANES, Lane};
use crate::widest::{Kernel, widest};

/// How the bones' motions are blended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BoneBlend {
    /// As matrices (linear blend skinning).
    Linear,
    /// As dual quaternions.
    DualQuaternion,
}

/// A bone at rest, a line segment (mesh units, model space).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BoneSegment {
    /// Where it starts.
    pub start: Vec3,
    /// Where it ends.
    pub end: Vec3,
}

/// A posed bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StretchTwist {
    /// Where the start goes.
    pub start: Vec3,
    /// The rotation since rest, which takes the rest direction to the posed one.
    pub turn: Quat,
    /// Posed length over rest length; 1 does not stretch.
    pub stretch: f32,
    /// Twists about the bone at its start and end (radians); 0 does not twist.
    pub twist: [f32; 2],
}

/// A character whose bones may stretch and twist along their length.
#[derive(Clone, Debug)]
pub struct StretchTwistSkin {
    blend: BoneBlend,
    vertex_count: usize,
    blocks: Vec<Block>,
    layers: Vec<Layer>,
    rest: Vec<BoneSegment>,
    posed: Vec<Posed>,
}

#[derive(Clone, Debug)]
struct Block {
    position: [Lane; 3],
    normal: [Lane; 3],
    layers: std::ops::Range<usize>,
}

/// One influence of each of eight vertices.
#[derive(Clone, Debug)]
struct Layer {
    bones: [u16; LANES],
    weights: Lane,
    ends: Lane,
}

/// `[turn (w, x, y, z), turn · axis (w, x, y, z), start', stretch' at the end, rest start, half twist, its slope]`;
/// padded to whole registers.
type Posed = [f32; 24];

impl StretchTwistSkin {
    /// Takes a character at rest. `end_weights`: as long as `influences.bones()` and in its order, how far towards
    /// the end of that bone the vertex sits, 0 at the start and 1 at the end (`e_i` of the thesis); they are clamped.
    pub fn precompute(
        rest_positions: &[[f32; 3]],
        rest_normals: &[[f32; 3]],
        influences: &Influences,
        end_weights: &[f32],
        rest: &[BoneSegment],
        blend: BoneBlend,
    ) -> Result<Self, SkinError> {
        let frames: Vec<Affine3A> = rest.iter().map(|bone| Affine3A::from_translation(bone.start)).collect();
        check_rest(rest_positions, rest_normals, influences, &frames)?;
        if let Some(bone) = rest.iter().position(|bone| !bone.end.is_finite()) {
            return Err(SkinError::RestNotInvertible { bone });
        }
        expect_length("end weights", end_weights.len(), influences.bones().len())?;
        if let Some(slot) = end_weights.iter().position(|e| !e.is_finite()) {
            return Err(SkinError::VertexNotFinite { vertex: slot / influences.per_vertex() });
        }
        let vertex_count = rest_positions.len();
        let mut layers: Vec<Layer> = Vec::new();
        let mut blocks = Vec::new();
        for first in (0..vertex_count).step_by(LANES) {
            let first_layer = layers.len();
            let (mut position, mut normal) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            for (lane, vertex) in (first..vertex_count).take(LANES).enumerate() {
                let direction = unit(rest_normals[vertex]);
                for axis in 0..3 {
                    position[axis][lane] = rest_positions[vertex][axis];
                    normal[axis][lane] = direction[axis];
                }
                for (slot, (bone, weight)) in influences.of_vertex(vertex).enumerate() {
                    if layers.len() == first_layer + slot {
                        layers.push(Layer { bones: [0; LANES], weights: [0.0; LANES], ends: [0.0; LANES] });
                    }
                    let layer = &mut layers[first_layer + slot];
                    layer.bones[lane] = bone;
                    layer.weights[lane] = weight;
                    layer.ends[lane] = end_weights[vertex * influences.per_vertex() + slot].clamp(0.0, 1.0);
                }
            }
            blocks.push(Block { position, normal, layers: first_layer..layers.len() });
        }
        Ok(Self { blend, vertex_count, blocks, layers, rest: rest.to_vec(), posed: vec![[0.0; 24]; rest.len()] })
    }

    /// Writes the posed positions and unit normals, n×3 each.
    ///
    /// Bones that neither stretch nor twist give the underlying method. Normals turn with the blended rotation (its
    /// cofactors, for linear blending) of the bones and their twists at the vertex; what the weights' own slopes add
    /// is left out. Allocates nothing, under the same terms as
    /// [`LinearBlendSkin::solve`](crate::LinearBlendSkin::solve).
    pub fn solve(
        &mut self,
        pose: &[StretchTwist],
        positions: &mut [[f32; 3]],
        normals: &mut [[f32; 3]],
    ) -> Result<(), SkinError> {
        expect_length("posed bones", pose.len(), self.rest.len())?;
        expect_length("room for positions", positions.len(), self.vertex_count)?;
        expect_length("room for normals", normals.len(), self.vertex_count)?;
        for (bone, (pose, rest)) in pose.iter().zip(&self.rest).enumerate() {
            self.posed[bone] = posed(pose, rest).ok_or(SkinError::PoseNotFinite { bone })?;
        }
        let (layers, bones, blend) = (&self.layers, &self.posed, self.blend);
        let skin_chunk = |blocks: &[Block], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]| {
            widest(SkinBlocks { blend, blocks, layers, bones, positions, normals });
        };
        in_chunks::<LANES, _>(&self.blocks, positions, normals, skin_chunk);
        Ok(())
    }
}

fn posed(pose: &StretchTwist, rest: &BoneSegment) -> Option<Posed> {
    let turn = DQuat::from_array(pose.turn.to_array().map(f64::from));
    let length = turn.length();
    if !(length > 1e-12 && length.is_finite()) {
        return None;
    }
    let turn = turn * (1.0 / length);
    let along = (rest.end - rest.start).as_dvec3();
    let axis = along.normalize_or_zero();
    let with_axis = turn * DQuat::from_xyzw(axis.x, axis.y, axis.z, 0.0);
    let longer: DVec3 = turn * (along * (f64::from(pose.stretch) - 1.0));
    let mut out = [0.0; 24];
    let values = [turn.w, turn.x, turn.y, turn.z, with_axis.w, with_axis.x, with_axis.y, with_axis.z];
    out[..8].copy_from_slice(&values.map(|c| c as f32));
    out[8..11].copy_from_slice(&pose.start.to_array());
    out[11..14].copy_from_slice(&longer.to_array().map(|c| c as f32));
    out[14..17].copy_from_slice(&rest.start.to_array());
    out[17] = 0.5 * pose.twist[0];
    out[18] = 0.5 * (pose.twist[1] - pose.twist[0]);
    let finite = out.iter().all(|c| c.is_finite());
    if axis == DVec3::ZERO {
        // A bone without length has no axis to twist about.
        out[17..19].fill(0.0);
    }
    finite.then_some(out)
}

struct SkinBlocks<'a> {
    blend: BoneBlend,
    blocks: &'a [Block],
    layers: &'a [Layer],
    bones: &'a [Posed],
    positions: &'a mut [[f32; 3]],
    normals: &'a mut [[f32; 3]],
}

impl Kernel for SkinBlocks<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let outputs = self.positions.chunks_mut(LANES).zip(self.normals.chunks_mut(LANES));
        for (block, (positions, normals)) in self.blocks.iter().zip(outputs) {
            let layers = &self.layers[block.layers.clone()];
            let (moved, turned) = match self.blend {
                BoneBlend::Linear => {
                    let map = blend_matrices(layers, self.bones);
                    (apply(&map, &block.position), cofactors_times(&map, &block.normal))
                }
                BoneBlend::DualQuaternion => {
                    let motion = blend_motions(layers, self.bones);
                    (move_positions(&motion, &block.position), turn(&motion, &block.normal))
                }
            };
            write(&moved, positions);
            write(&turned, normals);
        }
    }
}

/// Rotation `R K(e)` and translation of one influence a lane.
#[inline(always)]
fn motions(layer: &Layer, bones: &[Posed]) -> ([Lane; 4], [Lane; 3]) {
    let mut parts = [[0.0; LANES]; 19];
    for l in 0..LANES {
        let bone = &bones[usize::from(layer.bones[l])];
        for c in 0..19 {
            parts[c][l] = bone[c];
        }
    }
    let (mut q, mut shift) = ([[0.0; LANES]; 4], [[0.0; LANES]; 3]);
    for l in 0..LANES {
        let e = layer.ends[l];
        let (sine, cosine) = sine_and_cosine(parts[17][l] + e * parts[18][l]);
        for c in 0..4 {
            q[c][l] = cosine * parts[c][l] + sine * parts[4 + c][l];
        }
        for axis in 0..3 {
            shift[axis][l] = parts[8 + axis][l] + e * parts[11 + axis][l];
        }
    }
    let start = turn_by(&q, &[parts[14], parts[15], parts[16]]);
    for axis in 0..3 {
        for l in 0..LANES {
            shift[axis][l] -= start[axis][l];
        }
    }
    (q, shift)
}

#[inline(always)]
fn turn_by(q: &[Lane; 4], v: &[Lane; 3]) -> [Lane; 3] {
    turn(&[q[0], q[1], q[2], q[3], [0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]], v)
}

/// Taylor's series on a quarter turn to either side: errors below 1e-7, and exactly 0 and 1 at 0.
#[inline(always)]
fn sine_and_cosine(angle: f32) -> (f32, f32) {
    let turns = angle * std::f32::consts::FRAC_1_PI * 0.5;
    // Adding and taking away 1.5·2²³ rounds to a whole number.
    let near = turns - ((turns + 12_582_912.0) - 12_582_912.0);
    let folded = near.abs() > 0.25;
    let x = if folded { 0.5_f32.copysign(near) - near } else { near } * std::f32::consts::TAU;
    let s = x * x;
    let sine = 1.0 / 362_880.0 - s / 39_916_800.0;
    let sine = x * (1.0 - s * (1.0 / 6.0 - s * (1.0 / 120.0 - s * (1.0 / 5040.0 - s * sine))));
    let cosine = 1.0 / 40_320.0 - s * (1.0 / 3_628_800.0 - s / 479_001_600.0);
    let cosine = 1.0 - s * (0.5 - s * (1.0 / 24.0 - s * (1.0 / 720.0 - s * cosine)));
    (sine, if folded { -cosine } else { cosine })
}

#[inline(always)]
fn blend_motions(layers: &[Layer], bones: &[Posed]) -> [Lane; 8] {
    let mut sum = [[0.0; LANES]; 8];
    let mut pivot = [[0.0; LANES]; 4];
    for (number, layer) in layers.iter().enumerate() {
        let (q, t) = motions(layer, bones);
        if number == 0 {
            pivot = q;
        }
        for l in 0..LANES {
            let along = q[0][l] * pivot[0][l] + q[1][l] * pivot[1][l] + q[2][l] * pivot[2][l] + q[3][l] * pivot[3][l];
            let weight = layer.weights[l].copysign(along);
            let half = 0.5 * weight;
            let (w, x, y, z) = (q[0][l], q[1][l], q[2][l], q[3][l]);
            let (tx, ty, tz) = (t[0][l], t[1][l], t[2][l]);
            (0..4).for_each(|c| sum[c][l] += weight * q[c][l]);
            sum[4][l] -= half * (tx * x + ty * y + tz * z);
            sum[5][l] += half * (tx * w + (ty * z - tz * y));
            sum[6][l] += half * (ty * w + (tz * x - tx * z));
            sum[7][l] += half * (tz * w + (tx * y - ty * x));
        }
    }
    for l in 0..LANES {
        let squared = sum[0][l] * sum[0][l] + sum[1][l] * sum[1][l] + sum[2][l] * sum[2][l] + sum[3][l] * sum[3][l];
        let inverse = 1.0 / squared.max(1e-30).sqrt();
        for part in &mut sum {
            part[l] *= inverse;
        }
    }
    sum
}

/// Three rows of `(x, y, z, translation)`.
type Map = [[Lane; 4]; 3];

#[inline(always)]
fn blend_matrices(layers: &[Layer], bones: &[Posed]) -> Map {
    let mut sum = [[[0.0; LANES]; 4]; 3];
    for layer in layers {
        let (q, t) = motions(layer, bones);
        for l in 0..LANES {
            let weight = layer.weights[l];
            let (w, x, y, z) = (q[0][l], q[1][l], q[2][l], q[3][l]);
            let (x2, y2, z2) = (x + x, y + y, z + z);
            let (xx, yy, zz, xy, xz, yz) = (x * x2, y * y2, z * z2, x * y2, x * z2, y * z2);
            let (wx, wy, wz) = (w * x2, w * y2, w * z2);
            let rows = [
                [1.0 - (yy + zz), xy - wz, xz + wy, t[0][l]],
                [xy + wz, 1.0 - (xx + zz), yz - wx, t[1][l]],
                [xz - wy, yz + wx, 1.0 - (xx + yy), t[2][l]],
            ];
            for row in 0..3 {
                for column in 0..4 {
                    sum[row][column][l] += weight * rows[row][column];
                }
            }
        }
    }
    sum
}

#[inline(always)]
fn apply(map: &Map, p: &[Lane; 3]) -> [Lane; 3] {
    let mut out = [[0.0; LANES]; 3];
    for row in 0..3 {
        for l in 0..LANES {
            let [a, b, c, t] = map[row].map(|entry| entry[l]);
            out[row][l] = a * p[0][l] + b * p[1][l] + c * p[2][l] + t;
        }
    }
    out
}

/// Row i of the cofactor matrix is the cross product of the other two; where nothing is left of a normal, as the
/// blended rotations cancel, it stays as it was.
#[inline(always)]
fn cofactors_times(map: &Map, n: &[Lane; 3]) -> [Lane; 3] {
    let mut out = [[0.0; LANES]; 3];
    for l in 0..LANES {
        let at = |row: usize, column: usize| map[row][column][l];
        let (nx, ny, nz) = (n[0][l], n[1][l], n[2][l]);
        let cross = |a: usize, b: usize| {
            (at(a, 1) * at(b, 2) - at(a, 2) * at(b, 1)) * nx
                + (at(a, 2) * at(b, 0) - at(a, 0) * at(b, 2)) * ny
                + (at(a, 0) * at(b, 1) - at(a, 1) * at(b, 0)) * nz
        };
        let (x, y, z) = (cross(1, 2), cross(2, 0), cross(0, 1));
        let squared = x * x + y * y + z * z;
        let inverse = 1.0 / squared.sqrt();
        // Blended rotations have entries of at most one: this is 16 units in their last place.
        let sane = squared > 4e-12;
        out[0][l] = if sane { x * inverse } else { nx };
        out[1][l] = if sane { y * inverse } else { ny };
        out[2][l] = if sane { z * inverse } else { nz };
    }
    out
}

#[cfg(test)]
#[path = "stretch_twist_skinning_tests.rs"]
mod tests;
