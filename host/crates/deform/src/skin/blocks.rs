//! A character's vertices as the skinning kernels read them: eight side by side, as structures of arrays.
#![expect(
    clippy::inline_always,
    reason = "a kernel is compiled for wide registers only where it is inlined into the dispatch"
)]

use std::collections::HashMap;
use std::ops::Range;

use armature_geometry::Influences;

use super::bones::unit_normal;
use super::error::{SkinError, expect_length};
use super::in_chunks::in_chunks;
use super::morphs::Morphs;
use crate::lanes::{Eight, EightKernel, LANES, Lane, with_eight};

/// If a blended map's cofactors, relative to its own largest entry, shrink a normal to less than this (squared), it has
/// flattened the surface there to a line or a point: about 16 units in the last place of `f32`.
const FLAT: f32 = 4e-12;

/// Blocks of eight vertices, each with as many influence layers as its busiest vertex needs.
#[derive(Clone, Debug)]
pub(super) struct SkinBlocks {
    pub(super) vertex_count: usize,
    pub(super) blocks: Vec<Block>,
    pub(super) layers: Vec<Layer>,
}

/// Eight vertices at rest. Lanes without a vertex are at the origin.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub(super) struct Block {
    pub(super) position: [Lane; 3],
    /// Unit, or zero for a vertex without a normal.
    pub(super) normal: [Lane; 3],
    first_layer: u32,
    end_layer: u32,
}

/// One influence of each of eight vertices, the heaviest in a block's first layer. Lanes without one follow bone 0
/// with weight 0.
#[derive(Clone, Debug)]
pub(super) struct Layer {
    pub(super) bones: [u16; LANES],
    pub(super) weights: Lane,
}

/// Three rows of `(x, y, z, translation)`, eight maps side by side.
pub(super) type Map<E> = [[E; 4]; 3];

impl Block {
    pub(super) fn layers(&self) -> Range<usize> {
        self.first_layer as usize..self.end_layer as usize
    }
}

/// Gives the vertices that morph targets move their blended positions and normals.
pub(super) fn set_rest<B: AsMut<Block>>(
    blocks: &mut [B],
    vertex_count: usize,
    morphs: &Morphs,
) -> Result<(), SkinError> {
    expect_length("vertices of the morph targets", morphs.vertex_count(), vertex_count)?;
    for (vertex, position, normal) in morphs.moved() {
        let (block, lane) = (blocks[vertex / LANES].as_mut(), vertex % LANES);
        for axis in 0..3 {
            block.position[axis][lane] = position[axis];
            block.normal[axis][lane] = normal[axis];
        }
    }
    Ok(())
}

impl SkinBlocks {
    /// Takes what [`RestFrames::new`](super::RestFrames::new) has checked.
    pub(super) fn new(rest_positions: &[[f32; 3]], rest_normals: &[[f32; 3]], influences: &Influences) -> Self {
        let vertex_count = rest_positions.len();
        let mut layers: Vec<Layer> = Vec::new();
        let mut blocks = Vec::with_capacity(vertex_count.div_ceil(LANES));
        for first in (0..vertex_count).step_by(LANES) {
            let first_layer = layers.len();
            let (mut position, mut normal) = ([[0.0; LANES]; 3], [[0.0; LANES]; 3]);
            for (lane, vertex) in (first..vertex_count).take(LANES).enumerate() {
                let direction = unit_normal(rest_normals[vertex]);
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
            blocks.push(Block { position, normal, first_layer: first_layer as u32, end_layer: layers.len() as u32 });
        }
        Self { vertex_count, blocks, layers }
    }

    /// Numbers that belong to the slots of `influences`, in the order of the layers; 0 where a lane has no influence.
    pub(super) fn by_layer(&self, influences: &Influences, of_slots: &[f32]) -> Vec<Lane> {
        let mut out = vec![[0.0; LANES]; self.layers.len()];
        for vertex in 0..self.vertex_count {
            let first_layer = self.blocks[vertex / LANES].first_layer as usize;
            for slot in 0..influences.of_vertex(vertex).count() {
                out[first_layer + slot][vertex % LANES] = of_slots[vertex * influences.per_vertex() + slot];
            }
        }
        out
    }

    /// Gives the vertices that morph targets move their blended positions and normals.
    pub(super) fn set_rest(&mut self, morphs: &Morphs) -> Result<(), SkinError> {
        set_rest(&mut self.blocks, self.vertex_count, morphs)
    }

    /// Checks that there is space for every vertex's position and normal.
    pub(super) fn check_room(&self, positions: &[[f32; 3]], normals: &[[f32; 3]]) -> Result<(), SkinError> {
        expect_length("output positions", positions.len(), self.vertex_count)?;
        expect_length("output normals", normals.len(), self.vertex_count)
    }
}

/// A way to blend the motions of bones.
pub(super) trait Blend: Sync {
    /// The data of eight vertices.
    type Block: AsRef<Block> + Sync;
    /// The motions of eight vertices.
    type Motion<E: Eight>: MovesEight<E>;

    /// What the pose does to each of a block's vertices.
    fn blend<E: Eight>(&self, block: &Self::Block) -> Self::Motion<E>;
}

/// Motions of eight vertices, one each.
pub(super) trait MovesEight<E: Eight> {
    fn moved(&self, position: [E; 3]) -> [E; 3];
    /// Of unit length, or zero if the normal is.
    fn turned(&self, normal: [E; 3]) -> [E; 3];
}

impl<E: Eight> MovesEight<E> for Map<E> {
    #[inline(always)]
    fn moved(&self, position: [E; 3]) -> [E; 3] {
        move_by_map(self, position)
    }

    #[inline(always)]
    fn turned(&self, normal: [E; 3]) -> [E; 3] {
        turn_by_map(self, normal)
    }
}

/// Unit dual quaternions.
impl<E: Eight> MovesEight<E> for [E; 8] {
    #[inline(always)]
    fn moved(&self, position: [E; 3]) -> [E; 3] {
        move_by_motion(self, position)
    }

    #[inline(always)]
    fn turned(&self, normal: [E; 3]) -> [E; 3] {
        turn(self, normal)
    }
}

impl AsRef<Block> for Block {
    #[inline(always)]
    fn as_ref(&self) -> &Block {
        self
    }
}

impl AsMut<Block> for Block {
    fn as_mut(&mut self) -> &mut Block {
        self
    }
}

/// Writes the positions and normals of all blocks; see [`in_chunks`].
pub(super) fn skin_blocks<B: Blend>(
    skin: &B,
    blocks: &[B::Block],
    positions: &mut [[f32; 3]],
    normals: &mut [[f32; 3]],
) {
    in_chunks::<LANES, _>(blocks, positions, normals, |blocks, positions, normals| {
        with_eight(SkinChunk { skin, blocks, positions, normals });
    });
}

struct SkinChunk<'a, B: Blend> {
    skin: &'a B,
    blocks: &'a [B::Block],
    positions: &'a mut [[f32; 3]],
    normals: &'a mut [[f32; 3]],
}

impl<B: Blend> EightKernel for SkinChunk<'_, B> {
    type Output = ();

    #[inline(always)]
    fn run<E: Eight>(self) {
        let outputs = self.positions.chunks_mut(LANES).zip(self.normals.chunks_mut(LANES));
        for (block, (positions, normals)) in self.blocks.iter().zip(outputs) {
            let motion = self.skin.blend::<E>(block);
            let rest = block.as_ref();
            write(motion.moved(load(&rest.position)), positions);
            write(motion.turned(load(&rest.normal)), normals);
        }
    }
}

/// The pairs of bones that meet in a vertex, its heaviest first: the signs of dual quaternions depend on these.
#[derive(Clone, Debug)]
pub(super) struct Pivots {
    /// `[heaviest, other]`, each pair once.
    pub(super) pairs: Vec<[u16; 2]>,
    /// For each layer, the pair that each lane's influence makes with that of its block's first layer.
    pub(super) of_layers: Vec<[u32; LANES]>,
}

impl Pivots {
    pub(super) fn new(blocks: &SkinBlocks) -> Self {
        let mut number_of = HashMap::new();
        let mut out = Self { pairs: Vec::new(), of_layers: Vec::with_capacity(blocks.layers.len()) };
        for block in &blocks.blocks {
            let layers = &blocks.layers[block.layers()];
            for layer in layers {
                out.of_layers.push(std::array::from_fn(|lane| {
                    let pair = [layers[0].bones[lane], layer.bones[lane]];
                    *number_of.entry(pair).or_insert_with(|| {
                        out.pairs.push(pair);
                        out.pairs.len() as u32 - 1
                    })
                }));
            }
        }
        out
    }
}

/// Writes eight points if there is space for eight; the last block may have fewer.
#[inline(always)]
fn write<E: Eight>(points: [E; 3], to: &mut [[f32; 3]]) {
    if let Some(to) = to.first_chunk_mut() {
        E::interleave(points, to);
    } else {
        let mut all = [[0.0; 3]; LANES];
        E::interleave(points, &mut all);
        to.iter_mut().zip(all).for_each(|(to, from)| *to = from);
    }
}

#[inline(always)]
fn load<E: Eight>(lanes: &[Lane; 3]) -> [E; 3] {
    [E::load(&lanes[0]), E::load(&lanes[1]), E::load(&lanes[2])]
}

#[inline(always)]
fn move_by_map<E: Eight>(map: &Map<E>, p: [E; 3]) -> [E; 3] {
    [move_by_row(map[0], p), move_by_row(map[1], p), move_by_row(map[2], p)]
}

// Small functions here rather than closures: closures are not reliably inlined.
#[inline(always)]
fn move_by_row<E: Eight>(row: [E; 4], p: [E; 3]) -> E {
    row[3].plus_product(row[0], p[0]).plus_product(row[1], p[1]).plus_product(row[2], p[2])
}

/// Transforms normals by a map's cofactors (its inverse transpose times its determinant) and normalises them. Row i of
/// the cofactor matrix is the cross product of the other two rows.
#[inline(always)]
fn turn_by_map<E: Eight>([a, b, c]: &Map<E>, n: [E; 3]) -> [E; 3] {
    let shrink = E::splat(1.0) / largest(*a).max(largest(*b)).max(largest(*c));
    let (a, b, c) = (scaled(*a, shrink), scaled(*b, shrink), scaled(*c, shrink));
    let (x, y, z) = (dot_cross(n, b, c), dot_cross(n, c, a), dot_cross(n, a, b));
    let squared = (x * x).plus_product(y, y).plus_product(z, z);
    let stretch = E::splat(1.0) / squared.sqrt();
    // A comparison with NaN (zero matrix, overflow) is false and so also keeps the rest normal.
    let flat = E::splat(FLAT);
    [
        squared.if_above(flat, x * stretch, n[0]),
        squared.if_above(flat, y * stretch, n[1]),
        squared.if_above(flat, z * stretch, n[2]),
    ]
}

#[inline(always)]
fn largest<E: Eight>(row: [E; 4]) -> E {
    row[0].abs().max(row[1].abs()).max(row[2].abs())
}

#[inline(always)]
fn scaled<E: Eight>(row: [E; 4], by: E) -> [E; 3] {
    [row[0] * by, row[1] * by, row[2] * by]
}

/// `n · (a × b)`.
#[inline(always)]
fn dot_cross<E: Eight>(n: [E; 3], a: [E; 3], b: [E; 3]) -> E {
    ((a[1] * b[2] - a[2] * b[1]) * n[0])
        .plus_product(a[2] * b[0] - a[0] * b[2], n[1])
        .plus_product(a[0] * b[1] - a[1] * b[0], n[2])
}

/// `v + 2 q × (q × v + w v)` for unit quaternions `[w, x, y, z]`.
#[inline(always)]
fn turn<E: Eight>(motion: &[E; 8], v: [E; 3]) -> [E; 3] {
    let [w, x, y, z, ..] = *motion;
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (tx, ty, tz) = (y2 * v[2] - z2 * v[1], z2 * v[0] - x2 * v[2], x2 * v[1] - y2 * v[0]);
    [
        v[0].plus_product(w, tx).plus_product(y, tz) - z * ty,
        v[1].plus_product(w, ty).plus_product(z, tx) - x * tz,
        v[2].plus_product(w, tz).plus_product(x, ty) - y * tx,
    ]
}

/// Rotated by a unit dual quaternion, real part first, then translated by `2 (w d − d_w q + q × d)`.
#[inline(always)]
fn move_by_motion<E: Eight>(motion: &[E; 8], p: [E; 3]) -> [E; 3] {
    let [w, x, y, z, dw, dx, dy, dz] = *motion;
    let turned = turn(motion, p);
    let (w, x, y, z) = (w + w, x + x, y + y, z + z);
    [
        turned[0].plus_product(w, dx).plus_product(y, dz) - (dw * x).plus_product(z, dy),
        turned[1].plus_product(w, dy).plus_product(z, dx) - (dw * y).plus_product(x, dz),
        turned[2].plus_product(w, dz).plus_product(x, dy) - (dw * z).plus_product(y, dx),
    ]
}

/// Divides sums of dual quaternions by the length of their real parts.
#[inline(always)]
pub(super) fn made_unit<E: Eight>(sum: [E; 8]) -> [E; 8] {
    let squared = sum[0] * sum[0] + sum[1] * sum[1] + (sum[2] * sum[2] + sum[3] * sum[3]);
    // Only lanes without a vertex have length zero.
    let inverse = E::splat(1.0) / squared.max(E::splat(1e-30)).sqrt();
    let [a, b, c, d, e, f, g, h] = sum;
    [a * inverse, b * inverse, c * inverse, d * inverse, e * inverse, f * inverse, g * inverse, h * inverse]
}
