//! The generalized winding number, summed over every facet (thesis 8.4): how many times a surface or a curve wraps
//! around a point, even where it is open, intersects itself or is not manifold.

use pulp::Simd;

use super::queries::{Field, evaluate_many};
use super::segments::{SegmentBlock, add_segments, segment_blocks, validate_2d};
use super::turns::{TriangleBlock, Turns, triangle_blocks};
use crate::{MeshError, TriangleMesh};

/// The winding number of `mesh` at every point (mesh unit), by the solid angle of every triangle (thesis eq. 8.5, 8.6):
/// 1 inside a closed mesh whose triangles run counter-clockwise seen from outside, 0 outside. On the surface it is that
/// of one side or the mean of both, depending on rounding. NaN for a point that is not finite.
///
/// Takes time proportional to points times triangles; [`crate::winding::WindingNumberHierarchy`] gives the same numbers
/// faster.
pub fn winding_number(mesh: &TriangleMesh, points: &[[f64; 3]]) -> Result<Vec<f64>, MeshError> {
    mesh.validate()?;
    let corners: Vec<[[f64; 3]; 3]> = mesh.triangles.iter().map(|t| t.map(|v| mesh.vertices[v as usize])).collect();
    let blocks = triangle_blocks(&corners);
    Ok(evaluate_many(&Triangles(blocks), points))
}

struct Triangles(Vec<TriangleBlock>);

impl Field<3> for Triangles {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, point: [f64; 3], _: &mut Vec<u32>) -> f64 {
        let mut turns = Turns::new(simd);
        turns.add_triangles(&self.0, point);
        turns.total()
    }
}

/// The winding number of directed segments in the plane at every point, by signed angles (thesis eq. 8.2, 8.3): 1
/// inside a closed curve that runs counter-clockwise. `segments` are indices into `vertices`, the start and end of
/// each. On the curve it is that of one side or the mean of both, depending on rounding. NaN for a point that is not
/// finite.
pub fn winding_number_2d(
    vertices: &[[f64; 2]],
    segments: &[[u32; 2]],
    points: &[[f64; 2]],
) -> Result<Vec<f64>, MeshError> {
    validate_2d(vertices, segments)?;
    Ok(evaluate_many(&Segments(segment_blocks(vertices, segments)), points))
}

struct Segments(Vec<SegmentBlock>);

impl Field<2> for Segments {
    #[inline(always)]
    fn at<S: Simd>(&self, simd: S, point: [f64; 2], _: &mut Vec<u32>) -> f64 {
        let mut turns = Turns::new(simd);
        add_segments(&mut turns, &self.0, point);
        turns.total()
    }
}
