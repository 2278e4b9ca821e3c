//! Meshes for the tests.

// Each test program uses a part of these.
#![allow(dead_code, reason = "each test program uses only some helpers")]

use std::ops::ControlFlow;

use armature_geometry::TriangleMesh;
use glam::DVec3;

pub(crate) fn go(_stage: &'static str, _done: f64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// A sphere of radius 1: an octahedron whose edges are halved `steps` times.
pub(crate) fn sphere(steps: usize) -> TriangleMesh {
    let mut vertices: Vec<DVec3> =
        [[1., 0., 0.], [-1., 0., 0.], [0., 1., 0.], [0., -1., 0.], [0., 0., 1.], [0., 0., -1.]]
            .map(DVec3::from)
            .to_vec();
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..steps {
        let mut middles = std::collections::BTreeMap::new();
        let mut next = Vec::new();
        for &[a, b, c] in &triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    vertices.push((vertices[p as usize] + vertices[q as usize]).normalize());
                    vertices.len() as u32 - 1
                })
            });
            next.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
        }
        triangles = next;
    }
    TriangleMesh { vertices: vertices.iter().map(DVec3::to_array).collect(), triangles }
}

/// The mesh without the triangles of which any corner is within `radius` of `centre`; vertices stay.
pub(crate) fn cut(mesh: &TriangleMesh, centre: [f64; 3], radius: f64) -> TriangleMesh {
    let near = |v: u32| DVec3::from(mesh.vertices[v as usize]).distance(centre.into()) < radius;
    let triangles = mesh.triangles.iter().copied().filter(|t| !t.iter().any(|&v| near(v))).collect();
    TriangleMesh { vertices: mesh.vertices.clone(), triangles }
}

/// A flat grid of squares of size 1, each in two triangles.
pub(crate) fn sheet(width: u32, height: u32) -> TriangleMesh {
    let at = |i: u32, j: u32| j * (width + 1) + i;
    let vertices = (0..=height).flat_map(|j| (0..=width).map(move |i| [f64::from(i), f64::from(j), 0.0])).collect();
    let squares = (0..height).flat_map(|j| (0..width).map(move |i| (i, j)));
    let triangles = squares
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    TriangleMesh { vertices, triangles }
}

/// A tube of radius 1 along z.
pub(crate) fn tube(around: u32, along: u32, from: f64, to: f64) -> TriangleMesh {
    let place = |i: u32, j: u32| {
        let angle = std::f64::consts::TAU * f64::from(i) / f64::from(around);
        [angle.cos(), angle.sin(), from + (to - from) * f64::from(j) / f64::from(along)]
    };
    let vertices = (0..=along).flat_map(|j| (0..around).map(move |i| place(i, j))).collect();
    let at = |i: u32, j: u32| j * around + i % around;
    let squares = (0..along).flat_map(|j| (0..around).map(move |i| (i, j)));
    let triangles = squares
        .flat_map(|(i, j)| [[at(i, j), at(i + 1, j), at(i + 1, j + 1)], [at(i, j), at(i + 1, j + 1), at(i, j + 1)]])
        .collect();
    TriangleMesh { vertices, triangles }
}

/// One mesh of two.
pub(crate) fn together(a: &TriangleMesh, b: &TriangleMesh) -> TriangleMesh {
    let count = a.vertices.len() as u32;
    let mut both = a.clone();
    both.vertices.extend_from_slice(&b.vertices);
    both.triangles.extend(b.triangles.iter().map(|t| t.map(|v| v + count)));
    both
}
