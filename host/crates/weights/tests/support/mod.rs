//! Just enough reading of OBJ and TGF for tests of this crate, which knows no file formats.
#![allow(dead_code, reason = "each test file uses its own part of this module")]
#![allow(clippy::unwrap_used, reason = "a test whose data cannot be read has to fail")]

use std::path::{Path, PathBuf};

use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::BoneSegment;

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

/// Vertices and triangulated faces of an OBJ file.
pub(crate) fn read_obj(path: &Path) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => {
                let mut next = || words.next().unwrap().parse().unwrap();
                mesh.vertices.push([next(), next(), next()]);
            }
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

/// Bones of a TGF file: one for every edge.
pub(crate) fn read_tgf(path: &Path) -> Vec<BoneSegment> {
    let text = std::fs::read_to_string(path).unwrap();
    let (nodes, links) = text.split_once("\n#").unwrap();
    let mut joints: Vec<[f64; 3]> = Vec::new();
    for line in nodes.lines().filter(|l| !l.trim().is_empty()) {
        let numbers: Vec<f64> = line.split_whitespace().map(|w| w.parse().unwrap()).collect();
        joints.push([numbers[1], numbers[2], numbers[3]]);
    }
    let ends = |line: &str| {
        let mut numbers = line.split_whitespace().map_while(|w| w.parse::<usize>().ok());
        Some((numbers.next()?, numbers.next()?))
    };
    let links = links.split('#').next().unwrap();
    links.lines().filter_map(ends).map(|(a, b)| BoneSegment { head: joints[a - 1], tail: joints[b - 1] }).collect()
}

/// A shared mesh with its skeleton.
pub(crate) fn shared_character(name: &str) -> Option<(TriangleMesh, Vec<BoneSegment>)> {
    let mesh = shared_data(&format!("{name}.obj"))?;
    let skeleton = shared_data(&format!("{name}.tgf"))?;
    Some((read_obj(&mesh), read_tgf(&skeleton)))
}

/// A block of so many cubes along x, y and z, six tetrahedra each; `place` puts its whole-numbered vertices, of which
/// x comes fastest.
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

/// Vertices and tetrahedra of a MESH file.
pub(crate) fn read_medit(path: &Path) -> TetrahedralMesh {
    let text = std::fs::read_to_string(path).unwrap();
    let mut words = text.split_whitespace();
    let mut mesh = TetrahedralMesh::default();
    while let Some(word) = words.next() {
        match word {
            "Vertices" => {
                for _ in 0..words.next().unwrap().parse().unwrap() {
                    mesh.vertices.push(std::array::from_fn(|_| words.next().unwrap().parse().unwrap()));
                    words.next();
                }
            }
            "Tetrahedra" => {
                for _ in 0..words.next().unwrap().parse().unwrap() {
                    mesh.tetrahedra.push(std::array::from_fn(|_| words.next().unwrap().parse::<u32>().unwrap() - 1));
                    words.next();
                }
            }
            _ => {}
        }
    }
    mesh
}

/// A dense array, column-major.
pub(crate) struct Array {
    pub(crate) columns: usize,
    pub(crate) values: Vec<f64>,
}

/// A row-major npy file of f64 with two dimensions.
pub(crate) fn read_npy(path: &Path) -> Array {
    let (header, data) = npy_parts(path);
    assert!(header.contains("'<f8'") && header.contains("'fortran_order': False"), "{header}");
    let shape = header.split('(').nth(1).unwrap().split(')').next().unwrap();
    let columns: usize = shape.split(',').nth(1).unwrap().trim().parse().unwrap();
    let rows: Vec<f64> = data.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().unwrap())).collect();
    let values = (0..columns).flat_map(|column| rows.iter().skip(column).step_by(columns).copied()).collect();
    Array { columns, values }
}

/// An npy file of i64 with one dimension.
pub(crate) fn read_npy_indices(path: &Path) -> Vec<usize> {
    let (header, data) = npy_parts(path);
    assert!(header.contains("'<i8'"), "{header}");
    data.chunks_exact(8).map(|bytes| i64::from_le_bytes(bytes.try_into().unwrap()) as usize).collect()
}

fn npy_parts(path: &Path) -> (String, Vec<u8>) {
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(&bytes[..7], b"\x93NUMPY\x01");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    (String::from_utf8(bytes[10..10 + length].to_vec()).unwrap(), bytes[10 + length..].to_vec())
}
