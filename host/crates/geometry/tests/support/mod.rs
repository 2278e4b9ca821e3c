//! Meshes for tests: made by formula, or read from the shared data.
#![allow(dead_code, reason = "each test file uses its own part of this module")]
#![allow(clippy::unwrap_used, reason = "a test whose data cannot be read has to fail")]

use std::path::Path;

use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_test_support::shared;
use glam::DVec3;

/// Vertices and triangles of a shared OBJ or OFF file.
pub(crate) fn shared_triangles(name: &str) -> Option<TriangleMesh> {
    shared(name).map(|path| read_triangles(&path))
}

/// Vertices and triangles of an OBJ or OFF file, depending on its extension.
pub(crate) fn read_triangles(path: &Path) -> TriangleMesh {
    let is_off = path.extension().is_some_and(|extension| extension == "off");
    let read = if is_off { armature_test_support::read_off(path) } else { armature_test_support::read_obj(path) };
    TriangleMesh { vertices: read.vertices, triangles: read.triangles }
}

/// Vertices and tetrahedra of a shared MESH file.
pub(crate) fn shared_tetrahedra(name: &str) -> Option<TetrahedralMesh> {
    let read = armature_test_support::read_mesh(&shared(name)?);
    Some(TetrahedralMesh { vertices: read.vertices, tetrahedra: read.tetrahedra })
}

/// A unit sphere: an icosahedron whose triangles are repeatedly cut in four.
pub(crate) fn sphere(cuts: usize) -> TriangleMesh {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let mut vertices = Vec::new();
    for [x, y] in [[-1.0, golden], [1.0, golden], [-1.0, -golden], [1.0, -golden]] {
        vertices.extend([[x, y, 0.0], [0.0, x, y], [y, 0.0, x]]);
    }
    // The faces are the triples of vertices at the smallest distance, turned outward.
    let mut triangles = Vec::new();
    let near = |i: usize, j: usize| DVec3::from(vertices[i]).distance(DVec3::from(vertices[j])) < 2.1;
    for a in 0..12_u32 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if near(a as usize, b as usize) && near(b as usize, c as usize) && near(a as usize, c as usize) {
                    let [p, q, r] = [a, b, c].map(|v| DVec3::from(vertices[v as usize]));
                    triangles.push(if p.dot(q.cross(r)) > 0.0 { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    let mut mesh = TriangleMesh { vertices, triangles };
    for _ in 0..cuts {
        mesh = cut_in_four(&mesh);
    }
    mesh.vertices.iter_mut().for_each(|v| *v = DVec3::from(*v).normalize().to_array());
    mesh
}

fn cut_in_four(mesh: &TriangleMesh) -> TriangleMesh {
    let mut vertices = mesh.vertices.clone();
    let mut middles = std::collections::BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            let [p, q] = [a, b].map(|v| DVec3::from(mesh.vertices[v as usize]).normalize());
            vertices.push((p + q).normalize().to_array());
            vertices.len() as u32 - 1
        })
    };
    let mut triangles = Vec::new();
    for &[a, b, c] in &mesh.triangles {
        let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
        triangles.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    TriangleMesh { vertices, triangles }
}

/// A sphere of 2·`around`·(`rings` - 1) triangles along meridians, whose radius varies from vertex to vertex, normally
/// distributed around 1 with this deviation.
pub(crate) fn rough_sphere(rings: u32, around: u32, deviation: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut noise = noise();
    let mut add = |place: DVec3| {
        let [share, turn] = [0.5 + 0.5 * noise(), std::f64::consts::PI * noise()];
        let normal = (-2.0 * share.max(1e-12).ln()).sqrt() * turn.cos();
        mesh.vertices.push((place * (1.0 + deviation * normal)).to_array());
    };
    add(DVec3::Y);
    for ring in 1..rings {
        let polar = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
        for k in 0..around {
            let angle = std::f64::consts::TAU * f64::from(k) / f64::from(around);
            add(DVec3::new(polar.sin() * angle.cos(), polar.cos(), -polar.sin() * angle.sin()));
        }
    }
    add(-DVec3::Y);
    let at = |ring: u32, k: u32| 1 + (ring - 1) * around + k % around;
    let last = mesh.vertices.len() as u32 - 1;
    for k in 0..around {
        mesh.triangles.push([0, at(1, k), at(1, k + 1)]);
        for ring in 1..rings - 1 {
            let [a, b, c, d] = [at(ring, k), at(ring + 1, k), at(ring + 1, k + 1), at(ring, k + 1)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.triangles.push([at(rings - 1, k), last, at(rings - 1, k + 1)]);
    }
    mesh
}

/// A closed tube of `rings` rings of `sides` vertices around +Y, 2 long and 0.25 thick, with a spike: one vertex of the
/// middle ring is far away along +X.
pub(crate) fn spiked_tube(rings: u32, sides: u32, spike: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for (ring, side) in (0..rings).flat_map(|ring| (0..sides).map(move |side| (ring, side))) {
        let angle = std::f64::consts::TAU * f64::from(side) / f64::from(sides);
        let height = 2.0 * f64::from(ring) / f64::from(rings - 1);
        mesh.vertices.push([0.25 * angle.sin(), height, 0.25 * angle.cos()]);
    }
    mesh.vertices.extend([[0.0; 3], [0.0, 2.0, 0.0]]);
    let at = |ring: u32, side: u32| ring * sides + side % sides;
    let (bottom, top) = (rings * sides, rings * sides + 1);
    for side in 0..sides {
        for ring in 0..rings - 1 {
            let [a, b, c, d] = [at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side)];
            mesh.triangles.extend([[a, b, c], [a, c, d]]);
        }
        mesh.triangles.push([bottom, at(0, side + 1), at(0, side)]);
        mesh.triangles.push([top, at(rings - 1, side), at(rings - 1, side + 1)]);
    }
    mesh.vertices[at(rings / 2, sides / 4) as usize][0] = spike;
    mesh
}

/// The unit cube as `n`³ cells of six tetrahedra around a diagonal each (thesis figure 2.4, left), inner vertices
/// moved by up to `jitter` of a cell.
pub(crate) fn box_of_tetrahedra(n: u32, jitter: f64) -> TetrahedralMesh {
    let side = n + 1;
    let mut mesh = TetrahedralMesh::default();
    let mut noise = noise();
    for index in 0..side * side * side {
        let cell = [index % side, index / side % side, index / side / side];
        mesh.vertices.push(cell.map(|c| {
            let inside = cell.iter().all(|&c| 0 < c && c < n);
            let moved = noise() * jitter;
            (f64::from(c) + if inside { moved } else { 0.0 }) / f64::from(n)
        }));
    }
    let step = [1, side, side * side];
    for (x, y, z) in (0..n * n * n).map(|i| (i % n, i / n % n, i / n / n)) {
        let corner = x + y * side + z * side * side;
        for [i, j, k] in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let (one, two) = (corner + step[i], corner + step[i] + step[j]);
            mesh.tetrahedra.push([corner, one, two, two + step[k]]);
        }
    }
    mesh
}

/// Random numbers in -1..1, the same every time.
pub(crate) fn noise() -> impl FnMut() -> f64 {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}
