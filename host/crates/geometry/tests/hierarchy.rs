//! The hierarchy against brute force over all triangles, and all of geometry against random soups.

mod support;

use armature_geometry::TriangleMesh;
use armature_geometry::operators::{Lumping, cotangent_laplacian, intrinsic_delaunay_laplacian, lumped_mass};
use armature_geometry::search::{TriangleHierarchy, closest_on_segment};
use armature_geometry::surface::diagnose;
use glam::{DMat3, DVec3};
use proptest::prelude::*;

fn corners(mesh: &TriangleMesh, triangle: usize) -> [DVec3; 3] {
    mesh.triangles[triangle].map(|v| DVec3::from(mesh.vertices[v as usize]))
}

/// Where a segment meets a triangle's plane within the triangle, by solving three equations.
fn meets([a, b, c]: [DVec3; 3], from: DVec3, to: DVec3) -> Option<f64> {
    let system = DMat3::from_cols(b - a, c - a, from - to);
    if system.determinant() == 0.0 {
        return None;
    }
    let x = system.inverse() * (from - a);
    (x.x >= 0.0 && x.y >= 0.0 && x.x + x.y <= 1.0 && (0.0..=1.0).contains(&x.z)).then_some(x.z)
}

#[test]
fn segments_and_closest_points_agree_with_brute_force() {
    let mut noise = support::noise();
    let mut point = |size: f64| [noise() * size, noise() * size, noise() * size];
    let mut vertices = Vec::new();
    for _ in 0..400 {
        let at = point(1.0);
        vertices.extend((0..3).map(|_| (DVec3::from(at) + 0.2 * DVec3::from(point(1.0))).to_array()));
    }
    let triangles = (0..400).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    let mesh = TriangleMesh { vertices, triangles };
    let hierarchy = TriangleHierarchy::new(&mesh).unwrap();
    let mut hits = 0;
    for _ in 0..500 {
        let (from, to) = (point(1.5), point(1.5));
        let all = (0..400).filter_map(|t| meets(corners(&mesh, t), from.into(), to.into()).map(|along| (along, t)));
        let first = all.min_by(|a, b| a.0.total_cmp(&b.0));
        let got = hierarchy.first_hit(from, to);
        assert_eq!(got.map(|h| h.triangle as usize), first.map(|(_, t)| t));
        assert_eq!(hierarchy.segment_is_blocked(from, to, 0.0, |_| false), first.is_some());
        assert!(!hierarchy.segment_is_blocked(from, to, 0.0, |_| true));
        hits += usize::from(first.is_some());
        let closest = hierarchy.closest_point(from).unwrap();
        let nearest = (0..400).map(|t| brute_distance(corners(&mesh, t), from.into())).fold(f64::INFINITY, f64::min);
        assert!((closest.distance_squared.sqrt() - nearest).abs() < 1e-3, "{closest:?} is not {nearest} away");
        assert!(closest.distance_squared.sqrt() <= nearest + 1e-12);
    }
    assert!(hits > 100, "the test needs hits, not {hits}");
}

/// Distance by sampling lines across the triangle.
fn brute_distance([a, b, c]: [DVec3; 3], query: DVec3) -> f64 {
    (0..=400)
        .map(|k| {
            let t = f64::from(k) / 400.0;
            query.distance(closest_on_segment(query, a + (b - a) * t, a + (c - a) * t))
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn equal_triangles_by_the_thousand_do_not_grow_the_tree_deep() {
    let mesh =
        TriangleMesh { vertices: vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], triangles: vec![[0, 1, 2]; 50_000] };
    let hierarchy = TriangleHierarchy::new(&mesh).unwrap();
    let hit = hierarchy.first_hit([0.2, 0.2, 1.0], [0.2, 0.2, -1.0]).unwrap();
    assert_eq!((hit.triangle, hit.along), (0, 0.5));
    assert!(hierarchy.first_hit([2.0, 2.0, 1.0], [2.0, 2.0, -1.0]).is_none());
    assert!(hierarchy.closest_point([f64::NAN; 3]).is_none());
}

#[test]
fn nothing_slips_through_between_triangles_of_a_closed_surface() {
    let mesh = support::sphere(3);
    let hierarchy = TriangleHierarchy::new(&mesh).unwrap();
    for (index, vertex) in mesh.vertices.iter().enumerate() {
        // Through vertices and through the midpoints of edges, where six or two triangles share the hit.
        let [a, b, _] = mesh.triangles[index];
        let middle = DVec3::from(mesh.vertices[a as usize]) + DVec3::from(mesh.vertices[b as usize]);
        for target in [DVec3::from(*vertex), middle] {
            assert!(hierarchy.segment_is_blocked([0.0; 3], (target * 2.0).to_array(), 0.0, |_| false));
        }
    }
}

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -1.0..1.0,
        2 => (-2_i32..3).prop_map(f64::from),
        1 => prop_oneof![Just(1e-300), Just(1e60), Just(-1e30), Just(1e-160)],
    ]
}

fn soup() -> impl Strategy<Value = TriangleMesh> {
    (3_usize..12).prop_flat_map(|n| {
        let vertex = [coordinate(), coordinate(), coordinate()];
        let triangle = proptest::array::uniform3(0..n as u32);
        (proptest::collection::vec(vertex, n), proptest::collection::vec(triangle, 1..30))
            .prop_map(|(vertices, triangles)| TriangleMesh { vertices, triangles })
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_soup_gives_finite_symmetric_operators(mesh in soup()) {
        let laplacian = cotangent_laplacian(&mesh).unwrap();
        prop_assert!(laplacian.matrix.values().iter().all(|v| v.is_finite()));
        prop_assert_eq!(&laplacian.matrix, &laplacian.matrix.transpose());
        let intrinsic = intrinsic_delaunay_laplacian(&mesh, Lumping::VoronoiHybrid).unwrap();
        for column in 0..mesh.vertices.len() {
            for (row, value) in intrinsic.matrix.column(column) {
                prop_assert!(value.is_finite() && (row == column || value >= 0.0), "{} at {} {}", value, row, column);
            }
        }
        for mass in [lumped_mass(&mesh, Lumping::Barycentric).unwrap(), intrinsic.mass] {
            prop_assert!(mass.iter().all(|m| *m >= 0.0), "{:?}", mass);
        }
        diagnose(&mesh).unwrap();
        let hierarchy = TriangleHierarchy::new(&mesh).unwrap();
        hierarchy.closest_point([0.1, 0.2, 0.3]);
        hierarchy.first_hit([-3.0, 0.1, 0.2], [3.0, 0.2, 0.1]);
    }

    #[test]
    fn nan_and_bad_indices_are_errors_everywhere(mut mesh in soup(), which in 0_usize..3) {
        match which {
            0 => mesh.vertices[1][2] = f64::NAN,
            1 => mesh.triangles[0][1] = 99,
            _ => mesh.triangles.clear(),
        }
        let expected = mesh.validate().unwrap_err();
        prop_assert_eq!(cotangent_laplacian(&mesh).unwrap_err(), expected.clone());
        prop_assert_eq!(lumped_mass(&mesh, Lumping::Barycentric).unwrap_err(), expected.clone());
        prop_assert_eq!(intrinsic_delaunay_laplacian(&mesh, Lumping::Barycentric).unwrap_err(), expected.clone());
        prop_assert_eq!(TriangleHierarchy::new(&mesh).unwrap_err(), expected.clone());
        prop_assert_eq!(diagnose(&mesh).unwrap_err(), expected);
    }
}
