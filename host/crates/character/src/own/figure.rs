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

/// The zero set as a closed mesh with unit normals: the field's own gradients, smoother than any average over
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
    soften_creases(&mesh, &mut normals);
    (mesh, normals.iter().map(|n| n.as_vec3().to_array()).collect())
}

/// In a crease (between two fingers) the field's gradient may be that of one side only; there the mean over the
/// surrounding triangles is kept instead.
fn soften_creases(mesh: &TriangleMesh, normals: &mut [DVec3]) {
    let at = |v: u32| DVec3::from(mesh.vertices[v as usize]);
    let mut around = vec![(DVec3::ZERO, 1.0_f64); normals.len()];
    for &[a, b, c] in &mesh.triangles {
        let flat = (at(b) - at(a)).cross(at(c) - at(a)).normalize_or_zero();
        for v in [a, b, c] {
            let (sum, least) = &mut around[v as usize];
            *sum += flat;
            *least = least.min(flat.dot(normals[v as usize]));
        }
    }
    for (normal, (sum, least)) in normals.iter_mut().zip(around) {
        if least < 0.5 {
            *normal = sum.normalize_or(*normal);
        }
    }
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
