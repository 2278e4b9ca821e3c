//! The distance from a vertex to the sheet that faces it, through the volume or across a gap.

use glam::DVec3;
use rayon::prelude::*;

use super::surface::Surface;
use crate::TriangleMesh;
use crate::search::box_tree::Bounds;
use crate::search::triangle_queries::segment_meets_triangle;

/// Rays start this far from their vertex, relative to the size of the surface: anything nearer counts as touching.
const START: f64 = 1e-7;

/// For each vertex, the distances to the first facing sheet within `reach`, along the normal (a gap) and against it (a
/// thickness); infinite where there is none.
pub(super) fn facing_distances(surface: &Surface, reach: f64) -> Vec<[f64; 2]> {
    (0..surface.positions.len() as u32).into_par_iter().map(|v| of_vertex(surface, v, reach)).collect()
}

/// For each vertex of a mesh, how far the sheets that face it are, across a gap and through the volume, in the mesh's
/// unit; infinite where there is none within `reach`, and 0 for a vertex in no triangle.
pub(crate) fn space_around(mesh: &TriangleMesh, reach: f64) -> Vec<[f64; 2]> {
    let (surface, given) = Surface::new(mesh);
    let distances = facing_distances(&surface, reach / surface.unit);
    let of = |&v: &u32| distances.get(v as usize).map_or([0.0; 2], |facing| facing.map(|far| far * surface.unit));
    given.iter().map(of).collect()
}

fn of_vertex(surface: &Surface, vertex: u32, reach: f64) -> [f64; 2] {
    let normal: DVec3 = surface.star(vertex).map(|t| surface.area_vector(t)).sum();
    let Some(normal) = normal.try_normalize() else { return [f64::INFINITY; 2] };
    [normal, -normal].map(|direction| first_facing(surface, vertex, normal, direction * reach) * reach)
}

/// The first triangle facing against `normal` along a ray from a vertex, as a fraction of the ray.
fn first_facing(surface: &Surface, vertex: u32, normal: DVec3, ray: DVec3) -> f64 {
    let from = surface.positions[vertex as usize] + ray * (START / ray.length());
    let inverse = ray.recip();
    let nearest = std::cell::Cell::new(f64::INFINITY);
    surface.visit(
        |bounds| meets(bounds, from, inverse, nearest.get()),
        |t| {
            let corners = surface.corners(t);
            if surface.triangles[t as usize].contains(&vertex) || surface.area_vector(t).dot(normal) >= 0.0 {
                return;
            }
            if let Some(along) = segment_meets_triangle(from, ray, &corners) {
                nearest.set(nearest.get().min(along));
            }
        },
    );
    nearest.get()
}

fn meets(bounds: &Bounds, from: DVec3, inverse: DVec3, nearest: f64) -> bool {
    let (mut enter, mut leave) = (0.0_f64, nearest.min(1.0));
    for axis in 0..3 {
        if inverse[axis].is_infinite() {
            if from[axis] < bounds.low[axis] || from[axis] > bounds.high[axis] {
                return false;
            }
            continue;
        }
        let (a, b) =
            ((bounds.low[axis] - from[axis]) * inverse[axis], (bounds.high[axis] - from[axis]) * inverse[axis]);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    }
    enter <= leave + 1e-12
}
