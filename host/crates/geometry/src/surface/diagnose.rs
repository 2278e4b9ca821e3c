//! What is wrong with a mesh, in numbers an animator can act on: the first part of `armature inspect`.

use glam::DVec3;

use super::self_intersections::self_intersections;
use super::topology::{connected_components, edges, vertex_triangles};
use super::weld::weld_vertices;
use crate::vectors::DEGENERATE;
use crate::{MeshError, TriangleMesh};

/// Counts are taken after merging vertices at exactly one place, so that the seams of texture coordinates and the loose
/// triangles of an STL file do not look like holes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Diagnosis {
    /// Vertices as given.
    pub vertices: usize,
    /// Triangles as given.
    pub triangles: usize,
    /// Vertices that lie exactly where an earlier one lies.
    pub duplicate_vertices: usize,
    /// Vertices (after merging) in no triangle.
    pub isolated_vertices: usize,
    /// Connected pieces made of at least one triangle.
    pub components: usize,
    /// Triangles with two corners at one place, or with almost no area.
    pub degenerate_triangles: usize,
    /// Triangles with the same three corners as an earlier one, in either orientation.
    pub duplicate_triangles: usize,
    /// Edges with one triangle.
    pub boundary_edges: usize,
    /// Edges with three triangles or more.
    pub non_manifold_edges: usize,
    /// Edges whose two triangles run along them the same way: one of the two is inside out.
    pub inconsistent_edges: usize,
    /// Vertices whose triangles form several fans that share only the vertex.
    pub non_manifold_vertices: usize,
    /// Pairs of triangles that meet anywhere except in the corners and edges they share.
    pub self_intersections: usize,
    /// Whether those are all; the search is cut short if very many triangles are on top of each other.
    pub self_intersections_complete: bool,
    /// `V - E + F` of the merged mesh without isolated vertices: 2 for each closed piece without handles.
    pub euler_characteristic: i64,
    /// Total area, mesh unit squared.
    pub area: f64,
    /// By the divergence theorem, mesh unit cubed: positive if triangles run counter-clockwise seen from outside,
    /// negative if the mesh is inside out. Meaningless unless `closed`.
    pub signed_volume: f64,
    /// Whether every edge has two triangles that run along it opposite ways: the mesh bounds a volume, although it may
    /// still intersect itself.
    pub closed: bool,
    /// Smallest corner of the box around all vertices.
    pub low: [f64; 3],
    /// Largest corner of the box around all vertices.
    pub high: [f64; 3],
}

/// Counts what is wrong.
pub fn diagnose(mesh: &TriangleMesh) -> Result<Diagnosis, MeshError> {
    mesh.validate()?;
    let (low, high) = mesh.bounds().ok_or(MeshError::Empty)?;
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let welded_count = weld.representative.len();
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(|v| weld.welded_of[v as usize])).collect();
    let centre = 0.5 * DVec3::from(low) + 0.5 * DVec3::from(high);
    let position = |v: u32| DVec3::from(mesh.vertices[weld.representative[v as usize] as usize]) - centre;
    let mut diagnosis = Diagnosis {
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        duplicate_vertices: mesh.vertices.len() - welded_count,
        low,
        high,
        ..Diagnosis::default()
    };
    for &corners in &triangles {
        let [a, b, c] = corners.map(position);
        let area_2 = (b - a).cross(c - a).length();
        let longest = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        diagnosis.degenerate_triangles += usize::from(area_2 <= DEGENERATE * longest);
        diagnosis.area += 0.5 * area_2;
        diagnosis.signed_volume += a.dot(b.cross(c)) / 6.0;
    }
    diagnosis.duplicate_triangles = duplicates(&triangles);
    let meeting = self_intersections(mesh)?;
    diagnosis.self_intersections = meeting.pairs.len();
    diagnosis.self_intersections_complete = meeting.complete;
    let edges = edges(&triangles);
    for edge in &edges {
        diagnosis.boundary_edges += usize::from(edge.triangles == 1);
        diagnosis.non_manifold_edges += usize::from(edge.triangles > 2);
        diagnosis.inconsistent_edges += usize::from(edge.triangles == 2 && edge.forward != 1);
    }
    diagnosis.closed = edges.iter().all(|e| e.triangles == 2 && e.forward == 1);
    let fans = vertex_triangles(welded_count, &triangles);
    diagnosis.isolated_vertices = (0..welded_count).filter(|&v| fans.of(v).is_empty()).count();
    diagnosis.non_manifold_vertices =
        (0..welded_count).filter(|&v| fan_count(v as u32, fans.of(v), &triangles) > 1).count();
    diagnosis.components = connected_components(welded_count, &triangles).count - diagnosis.isolated_vertices;
    let used = welded_count - diagnosis.isolated_vertices;
    diagnosis.euler_characteristic = used as i64 - edges.len() as i64 + triangles.len() as i64;
    Ok(diagnosis)
}

fn duplicates(triangles: &[[u32; 3]]) -> usize {
    let mut keys: Vec<[u32; 3]> = triangles.to_vec();
    for key in &mut keys {
        key.sort_unstable();
    }
    keys.sort_unstable();
    keys.windows(2).filter(|pair| pair[0] == pair[1]).count()
}

/// How many groups the triangles around a vertex form when joined along edges at the vertex.
fn fan_count(vertex: u32, fan: &[u32], triangles: &[[u32; 3]]) -> usize {
    // Every triangle joins its two other corners; the groups are the components of those corners.
    let rims: Vec<[u32; 2]> = fan
        .iter()
        .filter_map(|&t| {
            let mut others = triangles[t as usize].into_iter().filter(|&v| v != vertex);
            Some([others.next()?, others.next()?])
        })
        .collect();
    let mut corners: Vec<u32> = rims.iter().flatten().copied().collect();
    corners.sort_unstable();
    corners.dedup();
    // A degenerate triangle for each pair keeps this a plain union of small lists.
    let local = |v: u32| corners.binary_search(&v).unwrap_or(0) as u32;
    let small: Vec<[u32; 3]> = rims.iter().map(|&[a, b]| [local(a), local(b), local(b)]).collect();
    connected_components(corners.len(), &small).count
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
    fn sound_mesh_has_nothing_to_report() {
        let d = diagnose(&tetrahedron()).unwrap();
        assert!(d.closed && d.self_intersections_complete);
        assert_eq!(d.self_intersections, 0);
        assert!((d.signed_volume - 1.0 / 6.0).abs() < 1e-15);
        assert!((d.area - (1.5 + 0.75_f64.sqrt())).abs() < 1e-15);
        assert_eq!((d.components, d.euler_characteristic, d.boundary_edges), (1, 2, 0));
        assert_eq!((d.degenerate_triangles, d.duplicate_triangles, d.non_manifold_vertices), (0, 0, 0));
    }

    #[test]
    fn faults_are_counted_one_by_one() {
        let mut mesh = tetrahedron();
        mesh.vertices.extend([[0.0; 3], [5.0; 3], [9.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
        mesh.triangles[0].swap(0, 1);
        mesh.triangles.extend([[3, 2, 1], [4, 7, 1], [6, 6, 7]]);
        let d = diagnose(&mesh).unwrap();
        assert_eq!((d.duplicate_vertices, d.isolated_vertices), (1, 1));
        assert_eq!((d.duplicate_triangles, d.degenerate_triangles), (1, 2));
        assert!(!d.closed && d.inconsistent_edges > 0 && d.non_manifold_edges >= 3);
    }

    #[test]
    fn two_cones_on_one_tip_share_a_non_manifold_vertex() {
        let mut mesh = tetrahedron();
        mesh.vertices.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
        mesh.triangles.extend([[0, 4, 5], [0, 6, 4], [0, 5, 6], [4, 6, 5]]);
        let d = diagnose(&mesh).unwrap();
        assert_eq!((d.non_manifold_vertices, d.components, d.non_manifold_edges), (1, 1, 0));
        assert!(d.closed);
    }

    #[test]
    fn inside_out_is_seen_by_the_sign() {
        let mut mesh = tetrahedron();
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        let d = diagnose(&mesh).unwrap();
        assert!(d.closed && d.signed_volume < 0.0);
    }
}
