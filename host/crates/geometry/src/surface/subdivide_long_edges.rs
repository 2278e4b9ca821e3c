//! A finer surface of the same shape: edges that are too long get a vertex in their middle.

use std::collections::HashMap;

use glam::DVec3;

use crate::TriangleMesh;

/// A surface with shorter edges.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Subdivided {
    /// The original vertices, in their order, then the new ones.
    pub(crate) mesh: TriangleMesh,
    /// For each triangle of `mesh`, the original triangle that it is part of.
    pub(crate) triangle_of: Vec<u32>,
}

/// Repeatedly cuts edges longer than `longest` of their ends (mesh unit) at their midpoints, until none is left or there
/// are `most_vertices`; triangles that share an edge also share its parts. Those that are longest compared with what
/// they may be are cut first.
pub(crate) fn subdivide_long_edges(
    mesh: &TriangleMesh,
    longest: impl Fn([DVec3; 2]) -> f64,
    most_vertices: usize,
) -> Subdivided {
    let mut done = Subdivided { mesh: mesh.clone(), triangle_of: (0..mesh.triangles.len() as u32).collect() };
    loop {
        let middles = cut_longest(&mut done.mesh, &longest, most_vertices);
        if middles.is_empty() {
            return done;
        }
        let before = std::mem::take(&mut done.mesh.triangles);
        let triangle_of = std::mem::take(&mut done.triangle_of);
        for (triangle, whole) in before.into_iter().zip(triangle_of) {
            for part in parts(triangle, &middles) {
                done.mesh.triangles.push(part);
                done.triangle_of.push(whole);
            }
        }
    }
}

/// New vertices at the midpoints of the edges that are both too long and at least half as much so as the one that is
/// most: others may no longer need it once those are cut.
fn cut_longest(
    mesh: &mut TriangleMesh,
    longest: &impl Fn([DVec3; 2]) -> f64,
    most_vertices: usize,
) -> HashMap<[u32; 2], u32> {
    let ends = |edge: [u32; 2]| edge.map(|v| DVec3::from(mesh.vertices[v as usize]));
    let excess = |edge: [u32; 2]| {
        let [a, b] = ends(edge);
        a.distance(b) / longest([a, b])
    };
    let mut edges: Vec<[u32; 2]> = mesh
        .triangles
        .iter()
        .flat_map(|t| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .filter(|[a, b]| a != b)
        .collect();
    edges.sort_unstable();
    edges.dedup();
    let mut long: Vec<(f64, [u32; 2])> = edges
        .into_iter()
        .map(|edge| (excess(edge), edge))
        .filter(|&(excess, edge)| excess > 1.0 && ends(edge)[0].distance(ends(edge)[1]).is_finite())
        .collect();
    long.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let bound = long.first().map_or(0.0, |l| 0.5 * l.0);
    let mut middles = HashMap::new();
    for (excess, edge) in long {
        let [a, b] = edge.map(|v| DVec3::from(mesh.vertices[v as usize]));
        let middle = 0.5 * a + 0.5 * b;
        if excess < bound || mesh.vertices.len() >= most_vertices || middle == a || middle == b {
            break;
        }
        middles.insert(edge, mesh.vertices.len() as u32);
        mesh.vertices.push(middle.to_array());
    }
    middles
}

/// The parts of a triangle some of whose edges have a middle.
fn parts(triangle: [u32; 3], middles: &HashMap<[u32; 2], u32>) -> Vec<[u32; 3]> {
    let middle = |k: usize| {
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        middles.get(&[a.min(b), a.max(b)]).copied()
    };
    let [ab, bc, ca] = [middle(0), middle(1), middle(2)];
    let [a, b, c] = triangle;
    match (ab, bc, ca) {
        (None, None, None) => vec![triangle],
        (Some(m), None, None) => vec![[a, m, c], [m, b, c]],
        (None, Some(m), None) => vec![[b, m, a], [m, c, a]],
        (None, None, Some(m)) => vec![[c, m, b], [m, a, b]],
        (Some(m), Some(n), None) => vec![[m, b, n], [a, m, n], [a, n, c]],
        (None, Some(m), Some(n)) => vec![[m, c, n], [b, m, n], [b, n, a]],
        (Some(n), None, Some(m)) => vec![[m, a, n], [c, m, n], [c, n, b]],
        (Some(m), Some(n), Some(o)) => vec![[a, m, o], [m, b, n], [o, n, c], [m, n, o]],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::support;
    use crate::surface::diagnose;

    #[test]
    fn a_sphere_keeps_its_shape_and_stays_closed() {
        let sphere = support::sphere(0);
        let before = diagnose(&sphere).unwrap();
        let finer = subdivide_long_edges(&sphere, |_| 0.3, usize::MAX);
        let after = diagnose(&finer.mesh).unwrap();
        assert!(after.closed && after.self_intersections == 0 && after.degenerate_triangles == 0);
        assert!((after.signed_volume - before.signed_volume).abs() < 1e-12);
        assert!((after.area - before.area).abs() < 1e-12);
        assert_eq!(finer.mesh.vertices[..12], sphere.vertices);
        assert_eq!(finer.triangle_of.len(), finer.mesh.triangles.len());
        for t in &finer.mesh.triangles {
            for k in 0..3 {
                let [a, b] = [t[k], t[(k + 1) % 3]].map(|v| DVec3::from(finer.mesh.vertices[v as usize]));
                assert!(a.distance(b) <= 0.3);
            }
        }
    }

    #[test]
    fn it_stops_at_the_number_of_vertices_and_survives_nonsense() {
        let finer = subdivide_long_edges(&support::sphere(0), |_| 0.0, 100);
        assert_eq!(finer.mesh.vertices.len(), 100);
        let bad =
            TriangleMesh { vertices: vec![[f64::NAN; 3], [0.0; 3], [1.0; 3]], triangles: vec![[0, 1, 2], [1, 1, 1]] };
        assert_eq!(
            subdivide_long_edges(&bad, |_| 0.1, 50).mesh.triangles.len(),
            subdivide_long_edges(&bad, |_| 0.1, 50).triangle_of.len()
        );
        assert_eq!(subdivide_long_edges(&TriangleMesh::default(), |_| 0.1, 50), Subdivided::default());
    }
}
