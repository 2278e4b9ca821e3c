//! Flat meshes in space.

use glam::{DAffine3, DMat3, DVec3};

use crate::{MeshError, TriangleMesh};

/// A mesh is flat if no vertex is farther from its plane than this, relative to its size.
const FLAT: f64 = 1e-9;

/// The plane of a flat mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeshPlane {
    /// Takes positions in space to positions whose third coordinate is zero up to `deviation`. Lengths are preserved,
    /// and in the plane z = 0 the first two coordinates are the mesh's own. The plane is seen from the side where its
    /// normal's largest coordinate is positive, with +Y up, or with -Z up if it is nearly horizontal.
    pub plane_from_world: DAffine3,
    /// The largest distance of a vertex from the plane, in the mesh's unit.
    pub deviation: f64,
}

/// A flat mesh seen from above.
#[derive(Clone, Debug, PartialEq)]
pub struct FlatMesh {
    /// n×2 positions in the plane, in the mesh's unit; in the order of the mesh.
    pub vertices: Vec<[f64; 2]>,
    /// m×3, as the mesh has them.
    pub triangles: Vec<[u32; 3]>,
}

impl MeshPlane {
    /// The mesh in its plane.
    pub fn flatten(&self, mesh: &TriangleMesh) -> FlatMesh {
        FlatMesh {
            vertices: mesh.vertices.iter().map(|&p| self.in_plane(p)).collect(),
            triangles: mesh.triangles.clone(),
        }
    }

    /// Coordinates in the plane of a point in space, or of the foot of its perpendicular.
    pub fn in_plane(&self, point: [f64; 3]) -> [f64; 2] {
        let p = self.plane_from_world.transform_point3(point.into());
        [p.x, p.y]
    }
}

/// The plane that contains all vertices of a mesh, to 1e-9 of its size; `None` if there is none or all are on one line.
pub fn plane_of(mesh: &TriangleMesh) -> Result<Option<MeshPlane>, MeshError> {
    mesh.validate()?;
    let at = |index: usize| DVec3::from(mesh.vertices[index]);
    let farthest = |distance: &dyn Fn(DVec3) -> f64| {
        let distances = mesh.vertices.iter().map(|&p| distance(p.into()));
        let most = |best: (usize, f64), (index, d): (usize, f64)| if d > best.1 { (index, d) } else { best };
        distances.enumerate().fold((0, 0.0), most)
    };
    let (first, _) = farthest(&|p| p.distance(at(0)));
    let (second, size) = farthest(&|p| p.distance(at(first)));
    if size <= 0.0 {
        return Ok(None);
    }
    let along = (at(second) - at(first)) / size;
    let (third, width) = farthest(&|p| along.cross(p - at(first)).length());
    if width <= FLAT * size {
        return Ok(None);
    }
    let normal = along.cross((at(third) - at(first)) / width).normalize();
    let largest = normal[normal.abs().max_position()];
    let normal = if largest < 0.0 { -normal } else { normal };
    let up = if normal.y > normal.x.abs().max(normal.z.abs()) { DVec3::NEG_Z } else { DVec3::Y };
    let right = up.cross(normal).normalize();
    let world_from_plane = DMat3::from_cols(right, normal.cross(right), normal);
    // The mean of the three keeps a mesh that is flat up to rounding on both sides of the plane.
    let height = normal.dot(at(first) / 3.0 + at(second) / 3.0 + at(third) / 3.0);
    let plane_from_world = DAffine3::from_mat3_translation(world_from_plane.transpose(), DVec3::new(0.0, 0.0, -height));
    let (_, deviation) = farthest(&|p| plane_from_world.transform_point3(p).z.abs());
    Ok((deviation <= FLAT * size).then_some(MeshPlane { plane_from_world, deviation }))
}
