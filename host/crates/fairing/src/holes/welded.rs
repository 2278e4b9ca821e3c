//! A mesh as a surface: vertices at one place are one.

use std::collections::BTreeSet;

use armature_geometry::orientation::orient_patches;
use armature_geometry::surface::{edges, weld_vertices};
use armature_geometry::{MeshError, TriangleMesh};
use glam::DVec3;

/// A mesh whose vertices at one place are one, with triangles that all face the same way where that is possible.
pub(crate) struct Welded {
    pub(crate) positions: Vec<DVec3>,
    pub(crate) triangles: Vec<[u32; 3]>,
    /// The first original vertex of each.
    pub(crate) original: Vec<u32>,
    /// For every original vertex, the welded one.
    pub(crate) joined: Vec<u32>,
}

impl Welded {
    pub(crate) fn of(mesh: &TriangleMesh) -> Result<Self, MeshError> {
        mesh.validate()?;
        let weld = weld_vertices(&mesh.vertices, 0.0);
        let positions = weld.representative.iter().map(|&v| DVec3::from(mesh.vertices[v as usize])).collect();
        let join = |t: &[u32; 3]| t.map(|v| weld.welded_of[v as usize]);
        let mut triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(join).collect();
        if edges(&triangles).iter().any(|e| e.triangles == 2 && e.forward != 1) {
            triangles = orient_patches(mesh)?.mesh.triangles.iter().map(join).collect();
        }
        triangles.retain(|&[a, b, c]| a != b && b != c && c != a);
        let mut seen = BTreeSet::new();
        triangles.retain(|t| {
            let mut key = *t;
            key.sort_unstable();
            seen.insert(key)
        });
        Ok(Self { positions, triangles, original: weld.representative, joined: weld.welded_of })
    }
}
