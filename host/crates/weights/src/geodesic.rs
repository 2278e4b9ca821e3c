//! Distances along a surface, as data to be smoothed: they have cusps opposite their source, and maxima that matter
//! (thesis 5.4, figure 5.13).
//!
//! ```
//! use armature_geometry::TriangleMesh;
//! use armature_weights::geodesic::geodesic_distance;
//!
//! let vertices = vec![[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [3.0, 4.0, 0.0]];
//! let square = TriangleMesh { vertices, triangles: vec![[0, 1, 2], [1, 3, 2]] };
//! let distances = geodesic_distance(&square, &[0])?;
//! assert!((distances[3] - 5.0).abs() < 1e-12, "through the edge between the triangles");
//! # Ok::<(), armature_weights::geodesic::GeodesicError>(())
//! ```

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use armature_geometry::surface::vertex_triangles;
use armature_geometry::{MeshError, TriangleMesh};
use glam::{DVec2, DVec3};

/// Why there are no distances.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum GeodesicError {
    /// The mesh is malformed.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A source is no vertex.
    #[error("vertex {vertex} does not exist: there are {vertices}")]
    NoSuchVertex {
        /// The source.
        vertex: usize,
        /// How many vertices there are.
        vertices: usize,
    },
}

/// The distance of every vertex from the nearest source along the surface (mesh unit), infinite in pieces without one.
/// Fast marching (Kimmel & Sethian 1998) with circular waves (Novotni & Klein 2002): exact where the surface between is
/// flat and its triangles are not obtuse, otherwise better the finer the mesh is. Vertices at one place are not joined.
pub fn geodesic_distance(mesh: &TriangleMesh, sources: &[usize]) -> Result<Vec<f64>, GeodesicError> {
    mesh.validate()?;
    let n = mesh.vertices.len();
    let mut distances = vec![f64::INFINITY; n];
    for &vertex in sources {
        *distances.get_mut(vertex).ok_or(GeodesicError::NoSuchVertex { vertex, vertices: n })? = 0.0;
    }
    let around = vertex_triangles(n, &mesh.triangles);
    let mut settled = vec![false; n];
    let mut open: BinaryHeap<Reverse<(u64, usize)>> = sources.iter().map(|&vertex| Reverse((0, vertex))).collect();
    while let Some(Reverse((_, vertex))) = open.pop() {
        if std::mem::replace(&mut settled[vertex], true) {
            continue;
        }
        for &triangle in around.of(vertex) {
            let corners = mesh.triangles[triangle as usize].map(|corner| corner as usize);
            for (to, other) in [(0, 1), (1, 2), (2, 0), (1, 0), (2, 1), (0, 2)].map(|(a, b)| (corners[a], corners[b])) {
                if to == vertex || other == vertex || settled[to] {
                    continue;
                }
                let place = |vertex: usize| DVec3::from(mesh.vertices[vertex]);
                let mut found = distances[vertex] + place(vertex).distance(place(to));
                if settled[other] {
                    let ends = [vertex, other].map(|end| (place(end), distances[end]));
                    found = across(place(to), ends).unwrap_or(f64::INFINITY).min(found);
                }
                if found < distances[to] {
                    distances[to] = found;
                    // Bits of numbers that are not negative are in their order.
                    open.push(Reverse((found.to_bits(), to)));
                }
            }
        }
    }
    Ok(distances)
}

/// The distance of a corner from the point in the triangle's plane that is as far from the two others as their distances
/// say, on their far side; `None` if the line does not pass between them.
fn across(corner: DVec3, [(a, from_a), (b, from_b)]: [(DVec3, f64); 2]) -> Option<f64> {
    let along = b - a;
    let length = along.length();
    let axis = along / length;
    let source_x = 0.5 * (length + (from_a - from_b) * (from_a + from_b) / length);
    let source = DVec2::new(source_x, -(from_a * from_a - source_x * source_x).max(0.0).sqrt());
    let to = corner - a;
    let x = to.dot(axis);
    let corner = DVec2::new(x, (to - x * axis).length());
    let height = corner.y - source.y;
    let crossing = source.x + (corner.x - source.x) * -source.y / height;
    // At an end the way is along the edge.
    let reachable = (from_a - from_b).abs() <= length && from_a + from_b >= length;
    (reachable && crossing > 0.0 && crossing < length).then(|| corner.distance(source))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of right triangles, placed by `place`.
    fn grid(cells: u32, place: impl Fn(f64, f64) -> [f64; 3]) -> TriangleMesh {
        let at = |x: u32, y: u32| x + (cells + 1) * y;
        let share = |k: u32| f64::from(k) / f64::from(cells);
        let all = |count: u32| (0..count).flat_map(move |y| (0..count).map(move |x| (x, y)));
        let squares = all(cells).flat_map(|(x, y)| {
            let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)];
            if (x + y) % 2 == 0 { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
        });
        let triangles = squares.collect();
        TriangleMesh { vertices: all(cells + 1).map(|(x, y)| place(share(x), share(y))).collect(), triangles }
    }

    #[test]
    fn flat_and_rolled_sheets_have_the_distances_of_the_plane() {
        let flat = grid(40, |x, y| [x, y, 0.0]);
        let rolled = grid(40, |x, y| [x.sin(), y, x.cos()]);
        for (mesh, allowed) in [(flat, 0.004), (rolled, 0.004)] {
            let distances = geodesic_distance(&mesh, &[0]).unwrap();
            let exact = |v: usize| ((v % 41) as f64 / 40.0).hypot((v / 41) as f64 / 40.0);
            let worst = (0..distances.len()).map(|v| (distances[v] - exact(v)).abs()).fold(0.0, f64::max);
            println!("worst {worst}");
            assert!(worst < allowed, "{worst}");
        }
    }

    #[test]
    fn distances_on_a_sphere_come_closer_to_great_circles_on_finer_meshes() {
        let mut before = f64::INFINITY;
        for cells in [10, 20, 40] {
            // A quarter of the sphere around the x axis, without poles.
            let place = |x: f64, y: f64| {
                let (longitude, latitude) = (1.5 * (x - 0.5), 1.5 * (y - 0.5));
                [latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin()]
            };
            let mesh = grid(cells, place);
            let middle = (mesh.vertices.len() - 1) / 2;
            let distances = geodesic_distance(&mesh, &[middle]).unwrap();
            let exact = |v: usize| DVec3::from(mesh.vertices[v]).angle_between(DVec3::from(mesh.vertices[middle]));
            let worst = (0..distances.len()).map(|v| (distances[v] - exact(v)).abs()).fold(0.0, f64::max);
            println!("{cells} cells: {worst}");
            assert!(worst < 0.7 * before, "{cells} cells: {worst} after {before}");
            before = worst;
        }
        assert!(before < 0.004, "{before}");
    }

    #[test]
    fn nonsense_is_named_and_other_pieces_are_far() {
        let mut mesh = grid(2, |x, y| [x, y, 0.0]);
        mesh.vertices.extend([[5.0; 3], [6.0, 5.0, 5.0], [5.0, 6.0, 5.0]]);
        mesh.triangles.push([9, 10, 11]);
        let distances = geodesic_distance(&mesh, &[8, 0]).unwrap();
        assert!(distances[9].is_infinite() && distances[8] == 0.0 && distances[0] == 0.0);
        assert_eq!(geodesic_distance(&mesh, &[12]), Err(GeodesicError::NoSuchVertex { vertex: 12, vertices: 12 }));
    }
}
