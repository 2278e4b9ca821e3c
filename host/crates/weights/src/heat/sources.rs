//! Which bones heat which vertices: nearest, and visible through the inside of the shape.

use armature_geometry::MeshError;
use armature_geometry::search::{TriangleHierarchy, closest_on_segment};
use armature_geometry::surface::{NormalWeighting, vertex_normals, vertex_triangles};
use glam::DVec3;
use rayon::prelude::*;

use super::settings::{BoneHeatSettings, Visibility};
use super::surface::HeatSurface;

/// A vertex closer than this to a bone (in units of half the mesh's box) counts as this far away, so heat stays finite.
/// The product of heat and vertex area is then at most about 1e8 on the coarsest mesh, which a Cholesky factorisation
/// in f64 handles easily.
const NEAREST: f64 = 1e-5;

/// The line to a bone may leave the vertex this far outward from the surface (sine of the angle): vertex normals of
/// coarse meshes lean, and a line that really leaves the shape has to come back in through a wall.
const OUTWARD: f64 = 0.2;

/// The search for walls skips this fraction of the line at both ends, so that a bone that ends on the surface, or a
/// vertex that touches a triangle without being its corner, is not hidden.
const MARGIN: f64 = 1e-6;

/// Bones near one vertex.
#[derive(Clone, Debug, Default)]
pub(crate) struct Nearest {
    /// Distance to the nearest bone, never below a small positive bound.
    pub(crate) distance: f64,
    /// All bones that near, in order.
    pub(crate) bones: Vec<u16>,
    /// Those of them that the vertex sees.
    pub(crate) visible: Vec<u16>,
}

/// Vertices between two progress reports.
const ROUND: usize = 1 << 14;

/// The bones near every vertex of the surface; `bones` are at the surface's scale. `between` receives the fraction done
/// now and then and may stop the search by returning `false`; what has been found by then is returned.
pub(crate) fn nearest_bones(
    surface: &HeatSurface,
    bones: &[(DVec3, DVec3)],
    settings: &BoneHeatSettings,
    mut between: impl FnMut(f64) -> bool,
) -> Result<Vec<Nearest>, MeshError> {
    let vertices = &surface.mesh.vertices;
    let mut found = Vec::with_capacity(vertices.len());
    if !between(0.0) {
        return Ok(found);
    }
    // A mesh whose triangles have all collapsed has no wall to hide behind.
    let walls = match settings.visibility {
        Visibility::Inside if !surface.mesh.triangles.is_empty() => Some(Walls::new(surface)?),
        _ => None,
    };
    let bones_of = |vertex: usize| {
        let position = DVec3::from(vertices[vertex]);
        let mut nearest = equally_near(position, bones, settings.tie_ratio);
        nearest.visible = nearest.bones.clone();
        if let Some(walls) = &walls {
            nearest.visible.retain(|&bone| {
                let (head, tail) = bones[usize::from(bone)];
                walls.let_through(vertex, position, closest_on_segment(position, head, tail))
            });
        }
        nearest
    };
    while found.len() < vertices.len() {
        let round = found.len()..vertices.len().min(found.len() + ROUND);
        found.par_extend(round.into_par_iter().map(bones_of));
        if !between(found.len() as f64 / vertices.len() as f64) {
            break;
        }
    }
    Ok(found)
}

fn equally_near(position: DVec3, bones: &[(DVec3, DVec3)], tie: f64) -> Nearest {
    let distance = |&(head, tail): &(DVec3, DVec3)| position.distance(closest_on_segment(position, head, tail));
    let distances: Vec<f64> = bones.iter().map(distance).collect();
    let least = distances.iter().copied().fold(f64::INFINITY, f64::min).max(NEAREST);
    let bones = (0..bones.len()).filter(|&b| distances[b] <= least * (1.0 + tie)).map(|b| b as u16).collect();
    Nearest { distance: least, bones, visible: Vec::new() }
}

struct Walls<'a> {
    surface: &'a HeatSurface,
    hierarchy: TriangleHierarchy,
    outward: Vec<[f64; 3]>,
    fans: armature_geometry::surface::Fans,
}

impl<'a> Walls<'a> {
    fn new(surface: &'a HeatSurface) -> Result<Self, MeshError> {
        let mesh = &surface.mesh;
        Ok(Self {
            surface,
            hierarchy: TriangleHierarchy::new(mesh)?,
            outward: vertex_normals(mesh, NormalWeighting::Angle)?,
            fans: vertex_triangles(mesh.vertices.len(), &mesh.triangles),
        })
    }

    /// Whether the line from a vertex to `to` starts inward and meets no triangle except those at the vertex.
    fn let_through(&self, vertex: usize, from: DVec3, to: DVec3) -> bool {
        let way = to - from;
        if way.length() <= NEAREST {
            return true;
        }
        let component = self.surface.components.of_vertex[vertex] as usize;
        let outward = self.surface.orientation[component] * DVec3::from(self.outward[vertex]);
        if way.dot(outward) > OUTWARD * way.length() {
            return false;
        }
        let own = self.fans.of(vertex);
        !self.hierarchy.segment_is_blocked(from.to_array(), to.to_array(), MARGIN, |t| own.contains(&t))
    }
}
