//! From a field to a closed triangle mesh with normals.

use armature_geometry::TriangleMesh;
use glam::DVec3;
use rayon::prelude::*;

use super::field::Field;
use super::polygonise::polygonise;
use super::remesh::{Sizes, remesh};

/// How finely a field is sampled and how large its triangles become.
#[derive(Clone, Copy, Debug)]
pub(super) struct Detail {
    /// Cell size of the first sampling; thin gaps need a few cells.
    pub(super) spacing: f64,
    /// Triangle sizes at the end.
    pub(super) sizes: Sizes,
}

/// The zero set as a closed mesh, and its unit normals: the field's own gradients, smoother than any average over
/// triangles.
pub(super) fn figure(field: &Field, detail: Detail) -> (TriangleMesh, Vec<[f32; 3]>) {
    let surface = remesh(field, polygonise(field, detail.spacing), detail.sizes);
    let (mut positions, mut triangles) = surface.compact();
    let mut normals: Vec<DVec3> =
        positions.par_iter().map(|&p| field.gradient(p, 0.3 * detail.sizes.min).normalize_or(DVec3::Y)).collect();
    if field.symmetric {
        mirror(&mut positions, &mut normals, &mut triangles);
    }
    let mesh = TriangleMesh { vertices: positions.iter().map(DVec3::to_array).collect(), triangles };
    (mesh, normals.iter().map(|n| n.as_vec3().to_array()).collect())
}

/// Adds the mirror image in x; vertices at exactly x = 0 are shared.
fn mirror(positions: &mut Vec<DVec3>, normals: &mut Vec<DVec3>, triangles: &mut Vec<[u32; 3]>) {
    let flip = |p: DVec3| DVec3::new(-p.x, p.y, p.z);
    let mut twins = Vec::with_capacity(positions.len());
    for v in 0..positions.len() {
        if positions[v].x == 0.0 {
            normals[v] = DVec3::new(0.0, normals[v].y, normals[v].z).normalize_or(DVec3::Y);
            twins.push(v as u32);
        } else {
            twins.push(positions.len() as u32);
            positions.push(flip(positions[v]));
            normals.push(flip(normals[v]));
        }
    }
    let images: Vec<[u32; 3]> = triangles.iter().map(|&[a, b, c]| [a, c, b].map(|v| twins[v as usize])).collect();
    triangles.extend(images);
}
