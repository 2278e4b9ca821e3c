//! The generalized winding number, summed over every facet (thesis 8.4): how many times a surface or a curve wraps
//! around a point, also where it is open, crosses itself or is not manifold.

use rayon::prelude::*;

use crate::turns::{LANES, TriangleBlock, Turns, answer_without_looking, triangle_blocks};
use crate::{MeshError, TriangleMesh};

/// The winding number of `mesh` at every point (mesh unit), by the solid angle of every triangle (thesis eq. 8.5,
/// 8.6): 1 inside a closed mesh whose triangles run counter-clockwise seen from outside, 0 outside. On the surface
/// it is that of one side or the mean of both, as rounding has it. A point that is not finite gives NaN.
///
/// The time is points times triangles; [`crate::WindingNumberHierarchy`] gives the same numbers sooner.
pub fn winding_number(mesh: &TriangleMesh, points: &[[f64; 3]]) -> Result<Vec<f64>, MeshError> {
    mesh.validate()?;
    let corners: Vec<[[f64; 3]; 3]> = mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize])).collect();
    let blocks = triangle_blocks(&corners);
    Ok(points.par_iter().map(|&p| direct(&blocks, p)).collect())
}

fn direct(blocks: &[TriangleBlock], p: [f64; 3]) -> f64 {
    answer_without_looking(&p).unwrap_or_else(|| {
        let mut turns = Turns::new();
        for block in blocks {
            turns.add_triangles(block, p);
        }
        turns.total()
    })
}

/// The winding number of directed segments in the plane at every point, by signed angles (thesis eq. 8.2, 8.3):
/// 1 inside a closed curve that runs counter-clockwise. `segments` names the start and end of each segment in
/// `vertices`; on the curve it is that of one side or the mean of
/// both, as rounding has it. A point that is not finite gives NaN.
pub fn winding_number_2d(
    vertices: &[[f64; 2]],
    segments: &[[u32; 2]],
    points: &[[f64; 2]],
) -> Result<Vec<f64>, MeshError> {
    validate_2d(vertices, segments)?;
    let blocks = segment_blocks(vertices, segments);
    let direct = |p: [f64; 2]| {
        let mut turns = Turns::new();
        add_segments(&mut turns, &blocks, p);
        turns.total()
    };
    Ok(points.par_iter().map(|&p| answer_without_looking(&p).unwrap_or_else(|| direct(p))).collect())
}

/// Up to four segments, `[end][axis][lane]`; unused lanes are all zero and see nothing.
pub(crate) type SegmentBlock = [[[f64; LANES]; 2]; 2];

/// Packs segments in order, four to a block.
pub(crate) fn segment_blocks(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Vec<SegmentBlock> {
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
pub(crate) fn add_segments(turns: &mut Turns, blocks: &[SegmentBlock], p: [f64; 2]) {
    for [[ax, ay], [bx, by]] in blocks {
        let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
        for l in 0..LANES {
            let (ax, ay, bx, by) = (ax[l] - p[0], ay[l] - p[1], bx[l] - p[0], by[l] - p[1]);
            re[l] = ax * bx + ay * by;
            im[l] = ax * by - ay * bx;
        }
        turns.multiply(&re, &im);
    }
}

pub(crate) fn validate_2d(vertices: &[[f64; 2]], segments: &[[u32; 2]]) -> Result<(), MeshError> {
    // The checks are those of a mesh whose third coordinate is zero and whose segments name an end twice.
    TriangleMesh {
        vertices: vertices.iter().map(|&[x, y]| [x, y, 0.0]).collect(),
        triangles: segments.iter().map(|&[a, b]| [a, b, b]).collect(),
    }
    .validate()
}
