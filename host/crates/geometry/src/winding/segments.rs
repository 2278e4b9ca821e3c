//! Directed segments in the plane, four at a time.

use pulp::Simd;

use super::lanes::{LANES, load};
use super::turns::Turns;
use crate::{MeshError, TriangleMesh};

/// Up to four segments, `[end][axis][lane]`; unused lanes are all zero and span nothing.
pub(super) type SegmentBlock = [[[f64; LANES]; 2]; 2];

/// Packs segments in order, four to a block.
pub(super) fn segment_blocks(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Vec<SegmentBlock> {
    let pack = |chunk: &[[u32; 2]]| {
        let mut block = SegmentBlock::default();
        for (l, segment) in chunk.iter().enumerate() {
            for end in 0..2 {
                for axis in 0..2 {
                    block[end][axis][l] = vertices[segment[end] as usize][axis];
                }
            }
        }
        block
    };
    segments.chunks(LANES).map(pack).collect()
}

/// Adds the angles of segments seen from `p` (thesis eq. 8.3).
#[inline(always)]
pub(super) fn add_segments<S: Simd>(turns: &mut Turns<S>, blocks: &[SegmentBlock], p: [f64; 2]) {
    let s = turns.simd;
    let p = [s.splat_f64s(p[0]), s.splat_f64s(p[1])];
    turns.add(
        blocks,
        #[inline(always)]
        |[a, b]| {
            let [ax, ay] = [s.sub_f64s(load::<S>(&a[0]), p[0]), s.sub_f64s(load::<S>(&a[1]), p[1])];
            let [bx, by] = [s.sub_f64s(load::<S>(&b[0]), p[0]), s.sub_f64s(load::<S>(&b[1]), p[1])];
            let re = s.add_f64s(s.mul_f64s(ax, bx), s.mul_f64s(ay, by));
            [re, s.sub_f64s(s.mul_f64s(ax, by), s.mul_f64s(ay, bx))]
        },
    );
}

pub(crate) fn validate_2d(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Result<(), MeshError> {
    // The checks are those of a mesh with z = 0 in which each segment is a triangle that repeats a vertex.
    TriangleMesh {
        vertices: vertices.iter().map(|&[x, y]| [x, y, 0.0]).collect(),
        triangles: segments.iter().map(|&[a, b]| [a, b, b]).collect(),
    }
    .validate()
}
