//! Where the given vertices lie on the coarse surface, found by walking on it from where they were collapsed to.

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{NONE, Surface};
use crate::hierarchy::closest_on_triangle;
use crate::{Fans, MeshError, SurfacePlace, TriangleHierarchy, TriangleMesh, vertex_triangles};

/// Steps of a walk; one or two are usual, and each comes nearer.
const MOST_STEPS: usize = 64;

/// How many times farther a triangle counts as that faces away from the vertex: the other side of a thin wall, or a
/// fold.
const AVERSION: f64 = 4.0;

/// A vertex as it was given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Given {
    pub(super) position: [f64; 3],
    pub(super) normal: DVec3,
    /// The coarse vertex it was collapsed to, [`NONE`] for a vertex without triangle.
    pub(super) start: u32,
}

/// The place on `coarse` of each vertex and its distance from there. Vertices without triangle take the nearest.
pub(super) fn places(coarse: &TriangleMesh, given: &[Given]) -> Result<Vec<(SurfacePlace, f64)>, MeshError> {
    let fans = vertex_triangles(coarse.vertices.len(), &coarse.triangles);
    let is_stray = given.iter().any(|g| g.start == NONE);
    let everywhere = if is_stray { Some(TriangleHierarchy::new(coarse)?) } else { None };
    Ok(given.par_iter().map(|vertex| place_of(coarse, &fans, everywhere.as_ref(), vertex)).collect())
}

/// The normal that every vertex of a surface had before it was made coarser.
pub(super) fn normals(surface: &Surface) -> Vec<DVec3> {
    let of_vertex = |v: u32| surface.star(v).map(|t| surface.area_vector(t)).sum::<DVec3>();
    (0..surface.positions.len() as u32).into_par_iter().map(of_vertex).collect()
}

fn place_of(
    coarse: &TriangleMesh,
    fans: &Fans,
    everywhere: Option<&TriangleHierarchy>,
    given: &Given,
) -> (SurfacePlace, f64) {
    let query = DVec3::from(given.position);
    if given.start == NONE {
        let triangle = everywhere.and_then(|h| h.closest_point(given.position)).map_or(0, |c| c.triangle);
        return located(coarse, triangle, query);
    }
    let mut best = (f64::INFINITY, NONE);
    let look = |vertex: u32, best: &mut (f64, u32)| {
        for &t in fans.of(vertex as usize) {
            let corners = coarse.triangles[t as usize].map(|v| DVec3::from(coarse.vertices[v as usize]));
            let away = (corners[1] - corners[0]).cross(corners[2] - corners[0]).dot(given.normal) < 0.0;
            let aversion = if away { AVERSION * AVERSION } else { 1.0 };
            let candidate = (aversion * closest_on_triangle(query, &corners).distance_squared(query), t);
            if candidate < *best {
                *best = candidate;
            }
        }
    };
    look(given.start, &mut best);
    for _ in 0..MOST_STEPS {
        let Some(&from) = coarse.triangles.get(best.1 as usize) else { break };
        let before = best;
        from.iter().for_each(|&vertex| look(vertex, &mut best));
        if best.1 == before.1 {
            break;
        }
    }
    located(coarse, best.1.min(coarse.triangles.len().saturating_sub(1) as u32), query)
}

fn located(coarse: &TriangleMesh, triangle: u32, query: DVec3) -> (SurfacePlace, f64) {
    let corners = coarse.triangles[triangle as usize].map(|v| DVec3::from(coarse.vertices[v as usize]));
    let point = closest_on_triangle(query, &corners);
    (SurfacePlace { triangle, barycentric: barycentric(point, &corners) }, point.distance(query))
}

/// Of a point in the triangle: none negative, sum 1. A triangle without area is treated as its longest edge.
pub(crate) fn barycentric(point: DVec3, [a, b, c]: &[DVec3; 3]) -> [f64; 3] {
    let normal = (*b - *a).cross(*c - *a);
    let parts = [(b, c), (c, a), (a, b)].map(|(p, q)| (*p - point).cross(*q - point).dot(normal).max(0.0));
    let sum = parts.iter().sum::<f64>();
    if sum > 0.0 && sum.is_finite() {
        return parts.map(|part| part / sum);
    }
    let edges = [(0, 1, *a, *b), (1, 2, *b, *c), (2, 0, *c, *a)];
    let longest = edges.iter().max_by(|x, y| x.2.distance_squared(x.3).total_cmp(&y.2.distance_squared(y.3)));
    let mut at = [1.0, 0.0, 0.0];
    if let Some(&(i, j, p, q)) = longest.filter(|(_, _, p, q)| p.distance_squared(*q) > 0.0) {
        let along = ((point - p).dot(q - p) / p.distance_squared(q)).clamp(0.0, 1.0);
        at = [0.0; 3];
        (at[i], at[j]) = (1.0 - along, along);
    }
    at
}
