//! The input's outline, in a frame where every predicate is exact.

use super::error::PlanarError;
use super::input::{PlanarInput, PlanarShape};
use crate::TriangleMesh;
use crate::surface::weld_vertices;
use crate::winding::segments::validate_2d;

/// From the input's coordinates to ones between 1 and 4, with the outline between 1.5 and 3.5. None is near zero, so no
/// product in a predicate underflows; the price is the last 10⁻¹⁵ of the outline's size.
#[derive(Clone, Copy, Debug)]
pub(super) struct Frame {
    centre: [f64; 2],
    scale: f64,
}

/// The middle between 1 and 4.
const MIDDLE: f64 = 2.5;
/// The fourth power of a thousandth of this, as areas of small triangles need it, is far from underflow.
const SMALLEST_SIZE: f64 = 1e-60;

impl Frame {
    fn around(vertices: &[[f64; 2]]) -> Result<Self, PlanarError> {
        let none = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        let (low, high) = vertices
            .iter()
            .fold(none, |(low, high), p| ([0, 1].map(|k| p[k].min(low[k])), [0, 1].map(|k| p[k].max(high[k]))));
        let half = [0, 1].map(|k| 0.5 * high[k] - 0.5 * low[k]);
        let largest = half[0].max(half[1]);
        if largest < SMALLEST_SIZE {
            return Err(PlanarError::NoArea);
        }
        let scale = libm::scalbn(1.0, -1 - libm::ilogb(largest));
        Ok(Self { centre: [0, 1].map(|k| 0.5 * low[k] + 0.5 * high[k]), scale })
    }

    pub(super) fn unit_from_input(&self, p: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| MIDDLE + (p[k] - self.centre[k]) * self.scale)
    }

    pub(super) fn input_from_unit(&self, p: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| (p[k] - MIDDLE) / self.scale + self.centre[k])
    }

    /// The factor from lengths of the input.
    pub(super) fn scale(&self) -> f64 {
        self.scale
    }
}

/// Directed segments between places.
#[derive(Clone, Debug)]
pub(super) struct Outline {
    pub(super) frame: Frame,
    /// Positions of the input's vertices in the frame.
    pub(super) vertices: Vec<[f64; 2]>,
    /// Start and end of each segment in `vertices`, as often as the outline runs along it.
    pub(super) segments: Vec<[u32; 2]>,
}

pub(super) fn outline_of(input: &PlanarInput) -> Result<Outline, PlanarError> {
    let vertices = match input.shape {
        PlanarShape::Outline { vertices, segments } => {
            validate_2d(vertices, segments)?;
            vertices
        }
        PlanarShape::Mesh { vertices, triangles } => {
            let vertices_in_space = vertices.iter().map(|&[x, y]| [x, y, 0.0]).collect();
            TriangleMesh { vertices: vertices_in_space, triangles: triangles.to_vec() }.validate()?;
            vertices
        }
    };
    let finite = |p: &[f64; 2]| p.iter().all(|c| c.is_finite() && c.abs() <= 1e60);
    if let Some(bone) = input.bones.iter().position(|ends| !ends.iter().all(finite)) {
        return Err(PlanarError::BoneNotFinite { bone });
    }
    if let Some(point) = input.points.iter().position(|p| !finite(p)) {
        return Err(PlanarError::PointNotFinite { point });
    }
    let frame = Frame::around(vertices)?;
    let vertices: Vec<[f64; 2]> = vertices.iter().map(|&p| frame.unit_from_input(p)).collect();
    let segments = match input.shape {
        PlanarShape::Outline { segments, .. } => segments.to_vec(),
        PlanarShape::Mesh { triangles, .. } => boundary(&vertices, triangles),
    };
    Ok(Outline { frame, vertices, segments })
}

/// The segments around a flat mesh, whatever the orientation of its triangles: each triangle counts as
/// counter-clockwise, and edges used in both directions cancel. Vertices at one place count as one.
fn boundary(vertices: &[[f64; 2]], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let weld = weld_vertices(&vertices.iter().map(|&[x, y]| [x, y, 0.0]).collect::<Vec<_>>(), 0.0);
    let first = |v: u32| weld.representative[weld.welded_of[v as usize] as usize];
    let mut sides: Vec<([u32; 2], i64)> = Vec::with_capacity(3 * triangles.len());
    for corners in triangles {
        let corners = corners.map(first);
        let [a, b, c] = corners.map(|v| vertices[v as usize]);
        let area = doubled_area(a, b, c);
        let [a, b, c] = corners;
        let turned = if area < 0.0 { [a, c, b] } else { [a, b, c] };
        for k in 0..3 {
            let (from, to) = (turned[k], turned[(k + 1) % 3]);
            if area != 0.0 {
                sides.push(([from.min(to), from.max(to)], if from < to { 1 } else { -1 }));
            }
        }
    }
    sides.sort_unstable();
    let mut segments = Vec::new();
    for along in sides.chunk_by(|a, b| a.0 == b.0) {
        let count: i64 = along.iter().map(|(_, count)| count).sum();
        let [from, to] = along[0].0;
        let directed = if count > 0 { [from, to] } else { [to, from] };
        segments.extend(std::iter::repeat_n(directed, count.unsigned_abs() as usize));
    }
    segments
}

/// Twice the area of a triangle, with the exact sign: positive for counter-clockwise.
pub(super) fn doubled_area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let [a, b, c] = [a, b, c].map(|[x, y]| robust::Coord { x, y });
    robust::orient2d(a, b, c)
}
