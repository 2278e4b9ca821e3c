//! The surface that heat diffuses on: the mesh at its own scale, welded and cleaned.

use armature_geometry::surface::{Components, connected_components, edges, weld_vertices};
use armature_geometry::{MeshError, TriangleMesh};
use glam::DVec3;

/// The mesh scaled to a box of half-width one around the origin, so that no number below depends on its unit, with
/// coincident vertices joined and triangles dropped that repeat a vertex or another triangle.
pub(crate) struct HeatSurface {
    pub(crate) mesh: TriangleMesh,
    /// For every vertex of the original mesh, its vertex here.
    pub(crate) welded_of: Vec<u32>,
    pub(crate) components: Components,
    /// For every component +1 if its triangles run counter-clockwise seen from outside, -1 if clockwise, 0 if
    /// undecidable.
    pub(crate) orientation: Vec<f64>,
    pub(crate) collapsed_triangles: usize,
    pub(crate) duplicate_triangles: usize,
    centre: DVec3,
    half_width: f64,
}

impl HeatSurface {
    /// `weld_ratio` is a fraction of the largest half-width of the mesh's box.
    pub(crate) fn new(mesh: &TriangleMesh, weld_ratio: f64) -> Result<Self, MeshError> {
        mesh.validate()?;
        let (low, high) = mesh.bounds().ok_or(MeshError::Empty)?;
        // Halved before adding, so that coordinates near the largest f64 do not overflow.
        let (low, high) = (0.5 * DVec3::from(low), 0.5 * DVec3::from(high));
        let centre = low + high;
        let half_width = (high - low).max_element();
        let half_width = if half_width > 0.0 { half_width } else { 1.0 };
        let scaled: Vec<[f64; 3]> =
            mesh.vertices.iter().map(|&v| ((DVec3::from(v) - centre) / half_width).to_array()).collect();
        let weld = weld_vertices(&scaled, weld_ratio);
        let vertices: Vec<[f64; 3]> = weld.representative.iter().map(|&v| scaled[v as usize]).collect();
        let welded = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize]));
        let whole: Vec<[u32; 3]> = welded.filter(|[a, b, c]| a != b && b != c && c != a).collect();
        let triangles = without_repetition(&whole);
        let components = connected_components(vertices.len(), &triangles);
        let orientation = orientation(&vertices, &triangles, &components);
        Ok(Self {
            collapsed_triangles: mesh.triangles.len() - whole.len(),
            duplicate_triangles: whole.len() - triangles.len(),
            mesh: TriangleMesh { vertices, triangles },
            welded_of: weld.welded_of,
            components,
            orientation,
            centre,
            half_width,
        })
    }

    /// Maps a point from the original mesh's space to this one.
    pub(crate) fn here(&self, point: [f64; 3]) -> DVec3 {
        (DVec3::from(point) - self.centre) / self.half_width
    }
}

/// For each set of three vertices, the first triangle on them, in order.
fn without_repetition(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut keys: Vec<([u32; 3], u32)> = triangles
        .iter()
        .enumerate()
        .map(|(index, &triangle)| {
            let mut key = triangle;
            key.sort_unstable();
            (key, index as u32)
        })
        .collect();
    keys.sort_unstable();
    keys.dedup_by_key(|(key, _)| *key);
    let mut kept: Vec<u32> = keys.into_iter().map(|(_, index)| index).collect();
    kept.sort_unstable();
    kept.into_iter().map(|index| triangles[index as usize]).collect()
}

/// The sign of each component's volume by the divergence theorem. It is 0 for a component whose triangles are not
/// consistently oriented, and for an open one that is nearly flat.
fn orientation(vertices: &[[f64; 3]], triangles: &[[u32; 3]], components: &Components) -> Vec<f64> {
    let count = components.count;
    let component_of = |v: u32| components.of_vertex[v as usize] as usize;
    let mut consistent = vec![true; count];
    let mut closed = vec![true; count];
    for edge in edges(triangles) {
        let component = component_of(edge.vertices[0]);
        consistent[component] &= edge.triangles == 1 || 2 * edge.forward == edge.triangles;
        closed[component] &= edge.triangles != 1;
    }
    let mut sums = vec![(DVec3::ZERO, 0_u32); count];
    for (vertex, &position) in vertices.iter().enumerate() {
        let sum = &mut sums[component_of(vertex as u32)];
        *sum = (sum.0 + DVec3::from(position), sum.1 + 1);
    }
    let (mut volume, mut area) = (vec![0.0; count], vec![0.0; count]);
    for corners in triangles {
        let component = component_of(corners[0]);
        let centre = sums[component].0 / f64::from(sums[component].1);
        let [a, b, c] = corners.map(|v| DVec3::from(vertices[v as usize]) - centre);
        volume[component] += a.dot(b.cross(c)) / 6.0;
        area[component] += 0.5 * (b - a).cross(c - a).length();
    }
    (0..count)
        .map(|component| {
            // A ball reaches 0.094 of its area to the power 3/2; an open shell as deep as a saucer about 0.01.
            let flat = if closed[component] { 1e-9 } else { 0.01 };
            let told = volume[component].abs() > flat * area[component] * area[component].sqrt();
            if consistent[component] && told { volume[component].signum() } else { 0.0 }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    #[test]
    fn orientation_is_told_where_it_can_be() {
        let mut mesh = tetrahedron();
        assert_eq!(HeatSurface::new(&mesh, 0.0).unwrap().orientation, [1.0]);
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        assert_eq!(HeatSurface::new(&mesh, 0.0).unwrap().orientation, [-1.0]);
        mesh.triangles[0].swap(0, 1);
        assert_eq!(HeatSurface::new(&mesh, 0.0).unwrap().orientation, [0.0]);
        mesh.triangles.truncate(1);
        assert_eq!(HeatSurface::new(&mesh, 0.0).unwrap().orientation, [0.0; 2]);
    }

    #[test]
    fn repetitions_and_seams_go() {
        let mut mesh = tetrahedron();
        mesh.vertices.push([1.0, 0.0, 0.0]);
        mesh.triangles[3] = [4, 2, 3];
        mesh.triangles.extend([[2, 1, 3], [0, 0, 3], [1, 4, 2]]);
        let surface = HeatSurface::new(&mesh, 1e-9).unwrap();
        assert_eq!(surface.welded_of, [0, 1, 2, 3, 1]);
        assert_eq!((surface.duplicate_triangles, surface.collapsed_triangles), (1, 2));
        assert_eq!(surface.orientation, [1.0]);
    }
}
