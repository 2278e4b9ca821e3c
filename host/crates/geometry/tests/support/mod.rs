//! Meshes for tests: made by formula, or read from the shared data folder by just enough of a reader.
#![allow(dead_code, reason = "each test file uses its own part of this module")]
#![allow(clippy::unwrap_used, reason = "a test whose data cannot be read has to fail")]

use std::path::{Path, PathBuf};

use armature_geometry::{TetrahedralMesh, TriangleMesh};
use glam::DVec3;

/// Path of a file in the shared data folder beside the repository; `None`, said aloud, where it is absent.
pub(crate) fn shared_data(name: &str) -> Option<PathBuf> {
    let found = Path::new(env!("CARGO_MANIFEST_DIR"))
        .ancestors()
        .map(|folder| folder.join("shared/data").join(name))
        .find(|path| path.exists());
    if found.is_none() {
        println!("SKIPPED: shared/data/{name} is not there");
        assert!(
            std::env::var_os("ARMATURE_REQUIRE_SHARED_DATA").is_none(),
            "shared/data/{name} is required but not there"
        );
    }
    found
}

/// Vertices and triangles of a shared OBJ or OFF file.
pub(crate) fn shared_triangles(name: &str) -> Option<TriangleMesh> {
    let text = std::fs::read_to_string(shared_data(name)?).unwrap();
    Some(read_triangles(name, &text))
}

/// Vertices and triangles of the text of an OBJ or OFF file; which one, its name says.
pub(crate) fn read_triangles(name: &str, text: &str) -> TriangleMesh {
    if name.contains(".off") { read_off(text) } else { read_obj(text) }
}

fn read_obj(text: &str) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => mesh.vertices.push(floats(words)),
            Some("f") => {
                let corners: Vec<u32> =
                    words.map(|w| w.split('/').next().unwrap().parse::<u32>().unwrap() - 1).collect();
                mesh.triangles.extend((2..corners.len()).map(|k| [corners[0], corners[k - 1], corners[k]]));
            }
            _ => {}
        }
    }
    mesh
}

fn read_off(text: &str) -> TriangleMesh {
    let mut words = text.split_whitespace().skip(1);
    let counts: [usize; 3] = std::array::from_fn(|_| words.next().unwrap().parse().unwrap());
    let vertices = (0..counts[0]).map(|_| floats(&mut words)).collect();
    let mut triangle = || {
        assert_eq!(words.next(), Some("3"));
        std::array::from_fn(|_| words.next().unwrap().parse().unwrap())
    };
    let triangles = (0..counts[1]).map(|_| triangle()).collect();
    TriangleMesh { vertices, triangles }
}

fn floats<'a>(mut words: impl Iterator<Item = &'a str>) -> [f64; 3] {
    std::array::from_fn(|_| words.next().unwrap().parse().unwrap())
}

/// Vertices and tetrahedra of a shared MESH file.
pub(crate) fn shared_tetrahedra(name: &str) -> Option<TetrahedralMesh> {
    let text = std::fs::read_to_string(shared_data(name)?).unwrap();
    let mut lines = text.lines().map(str::trim);
    let mut mesh = TetrahedralMesh::default();
    while let Some(line) = lines.next() {
        if line == "Vertices" {
            let count: usize = lines.next().unwrap().parse().unwrap();
            mesh.vertices = (0..count).map(|_| floats(lines.next().unwrap().split_whitespace())).collect();
        } else if line == "Tetrahedra" {
            let count: usize = lines.next().unwrap().parse().unwrap();
            let mut corners = || {
                let mut words = lines.next().unwrap().split_whitespace();
                std::array::from_fn(|_| words.next().unwrap().parse::<u32>().unwrap() - 1)
            };
            mesh.tetrahedra = (0..count).map(|_| corners()).collect();
        }
    }
    Some(mesh)
}

/// A unit sphere: an icosahedron whose triangles are cut in four, again and again.
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
