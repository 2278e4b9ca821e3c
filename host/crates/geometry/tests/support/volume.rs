//! Volumes for tests: Delaunay tetrahedra of a surface's vertices and an interior lattice, restricted to those inside.
#![allow(dead_code, reason = "each test file uses its own part of this module")]
#![allow(clippy::unwrap_used, reason = "a test whose data cannot be read has to fail")]

use std::ops::ControlFlow;

use armature_geometry::delaunay::delaunay_tetrahedra;
use armature_geometry::search::TriangleHierarchy;
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use glam::DVec3;

use crate::support::noise;

/// About `interior` points of a jittered lattice, not too close to the surface, are added inside.
pub(crate) fn volume_of(surface: &TriangleMesh, interior: usize) -> TetrahedralMesh {
    let at = |v: u32| DVec3::from(surface.vertices[v as usize]);
    let triangles = || surface.triangles.iter().map(|t| t.map(at));
    let volume: f64 = triangles().map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum();
    let area: f64 = triangles().map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum();
    let apart = 0.5 * (4.0 / 3.0_f64.sqrt() * area / surface.triangles.len() as f64).sqrt();
    let spacing = (volume.abs() / interior as f64).cbrt();
    let (low, high) = surface.bounds().unwrap();
    let winding = FastWindingNumber::precompute(surface).unwrap();
    let hierarchy = TriangleHierarchy::new(surface).unwrap();
    let mut noise = noise();
    let mut points = surface.vertices.clone();
    let count: [usize; 3] = std::array::from_fn(|k| ((high[k] - low[k]) / spacing) as usize + 1);
    for x in 0..count[0] {
        for y in 0..count[1] {
            for z in 0..count[2] {
                let cell = [x, y, z];
                let p = std::array::from_fn(|k| low[k] + spacing * (cell[k] as f64 + 0.5 + 0.3 * noise()));
                if winding.evaluate(p) > 0.5 && hierarchy.closest_point(p).unwrap().distance_squared > apart * apart {
                    points.push(p);
                }
            }
        }
    }
    inside(points, &winding)
}

/// The Delaunay tetrahedra of points whose barycentre has a winding number above one half.
pub(crate) fn inside(points: Vec<[f64; 3]>, winding: &FastWindingNumber) -> TetrahedralMesh {
    let all = delaunay_tetrahedra(&points, &mut |_, _| ControlFlow::Continue(())).unwrap().tetrahedra;
    let barycentre =
        |t: &[u32; 4]| (t.iter().map(|&v| DVec3::from(points[v as usize])).sum::<DVec3>() * 0.25).to_array();
    let barycentres: Vec<[f64; 3]> = all.iter().map(barycentre).collect();
    let inside = winding.evaluate_many(&barycentres);
    let tetrahedra = all.into_iter().zip(inside).filter(|(_, w)| *w > 0.5).map(|(t, _)| t).collect();
    TetrahedralMesh { vertices: points, tetrahedra }
}
