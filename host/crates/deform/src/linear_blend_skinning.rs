//! Linear blend skinning of positions and normals on the CPU (thesis eq. 2.1: `v' = Σ_b w_b T_b v`).

use armature_geometry::Influences;
use glam::{Affine3A, DAffine3, DVec3, Mat4, Vec4};

use crate::in_chunks::in_chunks;

/// Vertices that go through the arithmetic side by side, one register wide.
const LANES: usize = 4;
/// A blended map whose cofactors, relative to its own largest entry, shrink a normal to less than this (squared)
/// has flattened the surface there to a line or a point: about 16 units in the last place of `f32`.
const FLAT: f32 = 4e-12;

/// One bone's `model_from_rest` as three rows of `(x, y, z, translation)`.
type Rows = [Vec4; 3];
/// One number a lane.
type Lane = Vec4;

/// A character made ready to be skinned every frame.
///
/// Vertices are kept in blocks of four as structures of arrays, each block with as many influence layers as its
/// busiest vertex needs.
#[derive(Clone, Debug)]
pub struct LinearBlendSkin {
    vertex_count: usize,
    blocks: Vec<Block>,
    layers: Vec<Layer>,
    bone_from_rest: Vec<DAffine3>,
    model_from_rest: Vec<Rows>,
}

#[derive(Clone, Debug)]
struct Block {
    position: [Lane; 3],
    normal: [Lane; 3],
    layers: std::ops::Range<usize>,
}

#[derive(Clone, Debug)]
struct Layer {
    bones: [u16; LANES],
    weights: [f32; LANES],
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
        let (vertex_count, bone_count) = (rest_positions.len(), bone_from_rest.len());
        let mut layers = Vec::new();
        let blocks = (0..vertex_count)
            .step_by(LANES)
            .map(|first| Block::new(first, rest_positions, rest_normals, influences, &mut layers))
            .collect();
        Ok(Self { vertex_count, blocks, layers, bone_from_rest, model_from_rest: vec![[Vec4::ZERO; 3]; bone_count] })
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
        expect_length("room for positions", positions.len(), self.vertex_count)?;
        expect_length("room for normals", normals.len(), self.vertex_count)?;
        for (bone, (frame, rest)) in model_from_bone.iter().zip(&self.bone_from_rest).enumerate() {
            let rows = rows_of(&(widen(frame) * *rest));
            if !rows.iter().all(|row| row.is_finite()) {
                return Err(SkinError::PoseNotFinite { bone });
            }
            self.model_from_rest[bone] = rows;
        }
        let (layers, bones) = (&self.layers, &self.model_from_rest);
        let skin_chunk = |blocks: &[Block], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]| {
            let outputs = positions.chunks_mut(LANES).zip(normals.chunks_mut(LANES));
            for (block, (positions, normals)) in blocks.iter().zip(outputs) {
                skin_block(block, &layers[block.layers.clone()], bones, positions, normals);
            }
        };
        in_chunks::<LANES, _>(&self.blocks, positions, normals, skin_chunk);
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
        let mut block = Self { position: [Vec4::ZERO; 3], normal: [Vec4::ZERO; 3], layers: first_layer..first_layer };
        for (lane, vertex) in (first..rest_positions.len()).take(LANES).enumerate() {
            let normal = unit(rest_normals[vertex]);
            for axis in 0..3 {
                block.position[axis][lane] = rest_positions[vertex][axis];
                block.normal[axis][lane] = normal[axis];
            }
            for (slot, (bone, weight)) in influences.of_vertex(vertex).enumerate() {
                if layers.len() == first_layer + slot {
                    layers.push(Layer { bones: [0; LANES], weights: [0.0; LANES] });
                }
                let layer = &mut layers[first_layer + slot];
                layer.bones[lane] = bone;
                layer.weights[lane] = weight;
            }
        }
        block.layers.end = layers.len();
        block
    }
}

/// Blends each lane's matrix (one bone's rows are contiguous, so this runs along the rows), transposes, and moves
/// all lanes at once.
fn skin_block(block: &Block, layers: &[Layer], bones: &[Rows], positions: &mut [[f32; 3]], normals: &mut [[f32; 3]]) {
    let mut blended = [[Vec4::ZERO; LANES]; 3];
    for layer in layers {
        for lane in 0..LANES {
            let (bone, weight) = (&bones[usize::from(layer.bones[lane])], layer.weights[lane]);
            for (row, bone_row) in blended.iter_mut().zip(bone) {
                row[lane] += *bone_row * weight;
            }
        }
    }
    let map = blended.map(|[a, b, c, d]| {
        let lanes = Mat4::from_cols(a, b, c, d).transpose();
        [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis]
    });
    let moved = interleave(move_positions(&map, &block.position));
    let turned = interleave(turn_normals(&map, &block.normal));
    // A full block is the rule; the last one may be shorter.
    if let (Some(positions), Some(normals)) = (positions.first_chunk_mut(), normals.first_chunk_mut()) {
        (*positions, *normals) = (moved, turned);
    } else {
        positions.iter_mut().zip(moved).for_each(|(to, from)| *to = from);
        normals.iter_mut().zip(turned).for_each(|(to, from)| *to = from);
    }
}

fn interleave([x, y, z]: [Lane; 3]) -> [[f32; 3]; LANES] {
    let lanes = Mat4::from_cols(x, y, z, Vec4::ZERO).transpose();
    [lanes.x_axis, lanes.y_axis, lanes.z_axis, lanes.w_axis].map(|v| [v.x, v.y, v.z])
}

fn move_positions(map: &[[Lane; 4]; 3], p: &[Lane; 3]) -> [Lane; 3] {
    map.map(|row| row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3])
}

/// Row i of the cofactor matrix is the cross product of the other two rows.
fn turn_normals(map: &[[Lane; 4]; 3], n: &[Lane; 3]) -> [Lane; 3] {
    let scale = map.iter().flat_map(|row| &row[..3]).fold(Vec4::ZERO, |scale, entry| scale.max(entry.abs()));
    let shrink = scale.recip();
    let unit = map.map(|row| [row[0] * shrink, row[1] * shrink, row[2] * shrink]);
    let cofactors_times_normal = |a: &[Lane; 3], b: &[Lane; 3]| {
        (a[1] * b[2] - a[2] * b[1]) * n[0] + (a[2] * b[0] - a[0] * b[2]) * n[1] + (a[0] * b[1] - a[1] * b[0]) * n[2]
    };
    let turned = [
        cofactors_times_normal(&unit[1], &unit[2]),
        cofactors_times_normal(&unit[2], &unit[0]),
        cofactors_times_normal(&unit[0], &unit[1]),
    ];
    let squared = turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2];
    let stretch = Vec4::from_array(squared.to_array().map(f32::sqrt)).recip();
    // A comparison with NaN (zero matrix, overflow) is false and so keeps the rest normal too.
    let sane = squared.cmpgt(Vec4::splat(FLAT));
    [0, 1, 2].map(|axis| Vec4::select(sane, turned[axis] * stretch, n[axis]))
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

fn rows_of(frame: &DAffine3) -> Rows {
    let m = frame.matrix3.transpose();
    let row = |r: DVec3, t: f64| r.extend(t).as_vec4();
    [row(m.x_axis, frame.translation.x), row(m.y_axis, frame.translation.y), row(m.z_axis, frame.translation.z)]
}

pub(crate) fn unit(n: [f32; 3]) -> [f32; 3] {
    let wide = DVec3::new(n[0].into(), n[1].into(), n[2].into());
    wide.normalize_or_zero().as_vec3().to_array()
}

#[cfg(test)]
#[path = "linear_blend_skinning_tests.rs"]
mod tests;
