//! Where the original vertices are on the coarse surface, found by walking on it from where they were collapsed to.

use glam::DVec3;
use rayon::prelude::*;

use super::surface::{NONE, Surface};
use crate::search::TriangleHierarchy;
use crate::search::triangle_queries::{barycentric, closest_on_triangle};
use crate::surface::{Fans, vertex_triangles};
use crate::{MeshError, TriangleMesh};

/// Most steps of a walk; one or two are usual, and each comes closer.
const MOST_STEPS: usize = 64;

/// How many times farther away a triangle counts if it faces away from the vertex: the other side of a thin wall, or a
/// fold.
const AVERSION: f64 = 4.0;

/// A place on a triangle mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfacePlace {
    /// Zero-based triangle.
    pub triangle: u32,
    /// Coordinates with respect to its three corners: none negative, sum 1.
    pub barycentric: [f64; 3],
}

/// An original vertex.
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
