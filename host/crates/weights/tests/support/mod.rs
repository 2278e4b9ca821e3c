//! Shared by this crate's tests: files as the crate's own types, and a block of tetrahedra.
#![allow(dead_code, reason = "each test file uses its own part of this module")]

use std::path::Path;

use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_test_support::shared;
use armature_weights::BoneSegment;

/// Vertices and triangulated faces of an OBJ file.
pub(crate) fn read_obj(path: &Path) -> TriangleMesh {
    let read = armature_test_support::read_obj(path);
    TriangleMesh { vertices: read.vertices, triangles: read.triangles }
}

/// Bones of a TGF file: one for every edge.
pub(crate) fn read_tgf(path: &Path) -> Vec<BoneSegment> {
    armature_test_support::read_tgf(path).into_iter().map(|[head, tail]| BoneSegment { head, tail }).collect()
}

/// Vertices and tetrahedra of a MESH file.
pub(crate) fn read_mesh(path: &Path) -> TetrahedralMesh {
    let read = armature_test_support::read_mesh(path);
    TetrahedralMesh { vertices: read.vertices, tetrahedra: read.tetrahedra }
}

/// A shared mesh with its skeleton.
pub(crate) fn shared_character(name: &str) -> Option<(TriangleMesh, Vec<BoneSegment>)> {
    let mesh = shared(&format!("{name}.obj"))?;
    let skeleton = shared(&format!("{name}.tgf"))?;
    Some((read_obj(&mesh), read_tgf(&skeleton)))
}

/// A block of cubes, the given number along x, y and z, six tetrahedra each; `place` positions its integer vertices,
/// numbered with x fastest.
pub(crate) fn block([nx, ny, nz]: [usize; 3], place: impl Fn([f64; 3]) -> [f64; 3]) -> TetrahedralMesh {
    let number = |x: usize, y: usize, z: usize| x + (nx + 1) * (y + (ny + 1) * z);
    let mut mesh = TetrahedralMesh::default();
    for z in 0..=nz {
        for y in 0..=ny {
            mesh.vertices.extend((0..=nx).map(|x| place([x as f64, y as f64, z as f64])));
        }
    }
    for cell in 0..nx * ny * nz {
        let (x, y, z) = (cell % nx, cell / nx % ny, cell / (nx * ny));
        let at = |dx: usize, dy: usize, dz: usize| number(x + dx, y + dy, z + dz) as u32;
        let ring = [at(1, 0, 0), at(1, 1, 0), at(0, 1, 0), at(0, 1, 1), at(0, 0, 1), at(1, 0, 1)];
        mesh.tetrahedra.extend((0..6).map(|k| [at(0, 0, 0), at(1, 1, 1), ring[k], ring[(k + 1) % 6]]));
    }
    mesh
}

/// A flat figure of right triangles with legs of length `h`, wherever `inside` says for the middle of a square.
pub(crate) fn flat_shape(h: f64, [width, height]: [f64; 2], inside: impl Fn(f64, f64) -> bool) -> TriangleMesh {
    let (nx, ny) = ((width / h).round() as usize, (height / h).round() as usize);
    let mut number = std::collections::BTreeMap::new();
    let mut mesh = TriangleMesh::default();
    for (i, j) in (0..ny).flat_map(|j| (0..nx).map(move |i| (i, j))) {
        if !inside((i as f64 + 0.5) * h, (j as f64 + 0.5) * h) {
            continue;
        }
        let mut at = |i: usize, j: usize| {
            *number.entry((i, j)).or_insert_with(|| {
                mesh.vertices.push([i as f64 * h, j as f64 * h, 0.0]);
                mesh.vertices.len() as u32 - 1
            })
        };
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        mesh.triangles.extend(if (i + j) % 2 == 0 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
    }
    mesh
}

/// A solid of cubes with edges of length `h`, six tetrahedra each, wherever `inside` says for the middle of a cube.
pub(crate) fn solid_shape(h: f64, size: [f64; 3], inside: impl Fn([f64; 3]) -> bool) -> TetrahedralMesh {
    let cells = size.map(|length| (length / h).round() as usize);
    let whole = block(cells, |place| place.map(|x| x * h));
    let chosen: Vec<[u32; 4]> = whole
        .tetrahedra
        .chunks(6)
        .enumerate()
        .filter(|(cell, _)| {
            let (x, y, z) = (cell % cells[0], cell / cells[0] % cells[1], cell / (cells[0] * cells[1]));
            inside([x, y, z].map(|k| (k as f64 + 0.5) * h))
        })
        .flat_map(|(_, six)| six.to_vec())
        .collect();
    let mut number = vec![u32::MAX; whole.vertices.len()];
    let mut mesh = TetrahedralMesh::default();
    for corners in chosen {
        mesh.tetrahedra.push(corners.map(|vertex| {
            let place = &mut number[vertex as usize];
            if *place == u32::MAX {
                *place = mesh.vertices.len() as u32;
                mesh.vertices.push(whole.vertices[vertex as usize]);
            }
            *place
        }));
    }
    mesh
}

/// The vertex nearest to a place.
pub(crate) fn nearest(vertices: &[[f64; 3]], place: [f64; 3]) -> usize {
    let far = |vertex: &[f64; 3]| vertex.iter().zip(place).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    (0..vertices.len()).min_by(|&a, &b| far(&vertices[a]).total_cmp(&far(&vertices[b]))).expect("a vertex")
}
