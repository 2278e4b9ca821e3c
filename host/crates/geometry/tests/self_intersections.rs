//! Pairs of triangles that meet, against all pairs checked in floating-point arithmetic.

mod support;

use armature_geometry::TriangleMesh;
use armature_geometry::surface::{diagnose, self_intersections};
use glam::{DMat3, DVec3};

fn segment_meets([a, b, c]: [DVec3; 3], from: DVec3, to: DVec3) -> bool {
    let x = DMat3::from_cols(b - a, c - a, from - to).inverse() * (from - a);
    x.x >= 0.0 && x.y >= 0.0 && x.x + x.y <= 1.0 && (0.0..=1.0).contains(&x.z)
}

fn meet(s: [DVec3; 3], t: [DVec3; 3]) -> bool {
    (0..3).any(|k| segment_meets(s, t[k], t[(k + 1) % 3]) || segment_meets(t, s[k], s[(k + 1) % 3]))
}

#[test]
fn random_triangles_meet_as_algebra_says() {
    let mut noise = support::noise();
    let mut mesh = TriangleMesh::default();
    for t in 0..500_u32 {
        let centre = [noise(), noise(), noise()];
        mesh.vertices.extend((0..3).map(|_| centre.map(|c| c + 0.2 * noise())).collect::<Vec<_>>());
        mesh.triangles.push([3 * t, 3 * t + 1, 3 * t + 2]);
    }
    let corners = |t: usize| mesh.triangles[t].map(|v| DVec3::from(mesh.vertices[v as usize]));
    let mut expected = Vec::new();
    for s in 0..500 {
        expected.extend((s + 1..500).filter(|&t| meet(corners(s), corners(t))).map(|t| [s as u32, t as u32]));
    }
    let found = self_intersections(&mesh).unwrap();
    assert!(expected.len() > 100, "the test needs intersections, not {}", expected.len());
    assert_eq!((found.pairs, found.complete), (expected, true));
}

#[test]
fn sound_meshes_do_not_cross_themselves_and_the_truck_does() {
    assert!(self_intersections(&support::sphere(4)).unwrap().pairs.is_empty());
    for (file, expected) in [("armadillo.obj", 0), ("elephant.obj", 0), ("truck.obj", 424)] {
        let Some(mesh) = support::shared_triangles(file) else { continue };
        assert_eq!(diagnose(&mesh).unwrap().self_intersections, expected, "{file}");
    }
}

#[test]
fn two_spheres_cross_along_a_closed_ring() {
    let (mut mesh, other) = (support::sphere(3), support::sphere(3));
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(other.vertices.iter().map(|&[x, y, z]| [x + 0.7, y + 0.1, z - 0.2]));
    mesh.triangles.extend(other.triangles.iter().map(|t| t.map(|v| v + first)));
    let pairs = self_intersections(&mesh).unwrap().pairs;
    let half = other.triangles.len() as u32;
    assert!(pairs.len() > 60 && pairs.iter().all(|&[a, b]| a < half && b >= half), "{}", pairs.len());
}
