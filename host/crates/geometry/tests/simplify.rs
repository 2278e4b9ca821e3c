//! Coarse surfaces: the requested number of vertices, close to the original, and never touching where that did not.

#![allow(clippy::unwrap_used, reason = "a helper of a test that cannot go on has to fail it")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::simplify::{Simplified, SimplifyError, SimplifyOutcome, simplify};
use armature_geometry::surface::{boundary_edges, connected_components, edges, self_intersections, weld_vertices};
use armature_geometry::{MeshError, TriangleMesh};
use glam::DVec3;
use proptest::prelude::*;

fn coarse(mesh: &TriangleMesh, vertices: usize) -> Simplified {
    let simplified = simplify(mesh, vertices, &mut |_, _| ControlFlow::Continue(())).unwrap();
    check(mesh, &simplified);
    simplified
}

/// What holds for any mesh.
fn check(mesh: &TriangleMesh, simplified: &Simplified) {
    simplified.mesh.validate().unwrap();
    assert_eq!(simplified.place.len(), mesh.vertices.len());
    let mut largest: f64 = 0.0;
    for (place, vertex) in simplified.place.iter().zip(&mesh.vertices) {
        assert!(place.barycentric.iter().all(|b| *b >= 0.0), "{place:?}");
        assert!((place.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{place:?}");
        largest = largest.max(at(simplified, place.triangle, place.barycentric).distance(DVec3::from(*vertex)));
    }
    let size = size(mesh);
    assert!((largest - simplified.largest_distance).abs() < 1e-9 * size, "{largest} {}", simplified.largest_distance);
    assert!(simplified.mean_distance <= simplified.largest_distance);
}

fn at(simplified: &Simplified, triangle: u32, barycentric: [f64; 3]) -> DVec3 {
    let corners = simplified.mesh.triangles[triangle as usize];
    (0..3).map(|k| DVec3::from(simplified.mesh.vertices[corners[k] as usize]) * barycentric[k]).sum()
}

fn size(mesh: &TriangleMesh) -> f64 {
    let (low, high) = mesh.bounds().unwrap();
    DVec3::from(low).distance(DVec3::from(high))
}

fn meeting(mesh: &TriangleMesh) -> usize {
    self_intersections(mesh).unwrap().pairs.len()
}

fn euler(mesh: &TriangleMesh) -> i64 {
    mesh.vertices.len() as i64 - edges(&mesh.triangles).len() as i64 + mesh.triangles.len() as i64
}

fn volume(mesh: &TriangleMesh) -> f64 {
    let corners = |t: &[u32; 3]| t.map(|v| DVec3::from(mesh.vertices[v as usize]));
    mesh.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
}

/// A box from `low` to `high` with square cells of at most `cell` on its sides.
fn cuboid(low: DVec3, high: DVec3, cell: f64) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for axis in 0..3 {
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        let count = [u, v].map(|k| (((high - low)[k] / cell).ceil() as u32).max(1));
        for side in [low, high] {
            let first = mesh.vertices.len() as u32;
            for i in 0..=count[0] {
                for j in 0..=count[1] {
                    let mut p = side;
                    p[u] = low[u] + (high - low)[u] * f64::from(i) / f64::from(count[0]);
                    p[v] = low[v] + (high - low)[v] * f64::from(j) / f64::from(count[1]);
                    mesh.vertices.push(p.to_array());
                }
            }
            for (i, j) in (0..count[0]).flat_map(|i| (0..count[1]).map(move |j| (i, j))) {
                let corner = |di: u32, dj: u32| first + (i + di) * (count[1] + 1) + j + dj;
                let square = [[corner(0, 0), corner(1, 0), corner(1, 1)], [corner(0, 0), corner(1, 1), corner(0, 1)]];
                let is_low = side == low;
                mesh.triangles.extend(square.map(|[a, b, c]| if is_low { [a, c, b] } else { [a, b, c] }));
            }
        }
    }
    mesh
}

fn join(parts: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for part in parts {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&part.vertices);
        all.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    all
}

/// Bends a mesh, so that facing sheets stay at their distance but are no longer flat.
fn bent(mut mesh: TriangleMesh) -> TriangleMesh {
    for p in &mut mesh.vertices {
        p[1] += 0.08 * (7.0 * p[0]).sin() + 0.05 * (9.0 * p[2] + 1.0).cos();
    }
    mesh
}

/// Two slabs separated by a hundredth of their size.
fn slabs() -> TriangleMesh {
    let slab = |y: f64| cuboid(DVec3::new(0.0, y, 0.0), DVec3::new(1.0, y + 0.03, 1.0), 0.025);
    bent(join(&[slab(0.0), slab(0.04)]))
}

/// Fingers with gaps of a hundredth of the size between them.
fn fingers() -> TriangleMesh {
    let finger = |k: u32| {
        let x = 0.11 * f64::from(k);
        cuboid(DVec3::new(x, 0.0, 0.0), DVec3::new(x + 0.1, 0.1, 1.0), 0.0125)
    };
    bent(join(&(0..5).map(finger).collect::<Vec<_>>()))
}

#[test]
fn a_coarse_sphere_is_a_sphere() {
    let mesh = support::sphere(5);
    let simplified = coarse(&mesh, 600);
    assert_eq!((simplified.outcome, simplified.mesh.vertices.len()), (SimplifyOutcome::Reached, 600));
    assert_eq!((euler(&simplified.mesh), meeting(&simplified.mesh)), (2, 0));
    // An ideal sphere of 600 vertices loses 0.6 % of its volume if they lie on it.
    let share = volume(&simplified.mesh) / volume(&mesh);
    assert!((share - 1.0).abs() < 0.01, "{share}");
    assert!(simplified.largest_distance < 0.02, "{}", simplified.largest_distance);
}

#[test]
fn facing_sheets_stay_apart() {
    for (name, mesh, parts, targets) in [("slabs", slabs(), 2, [500, 1200]), ("fingers", fingers(), 5, [250, 900])] {
        assert_eq!(meeting(&mesh), 0, "{name}: touching from the start");
        for target in targets {
            let simplified = coarse(&mesh, target);
            assert_eq!(simplified.outcome, SimplifyOutcome::Reached, "{name}");
            assert_eq!(meeting(&simplified.mesh), 0, "{name} at {target}");
            let components = connected_components(simplified.mesh.vertices.len(), &simplified.mesh.triangles);
            assert_eq!((components.count, boundary_edges(&simplified.mesh).len()), (parts, 0), "{name}");
            // No vertex has jumped to another part.
            let welded = weld_vertices(&mesh.vertices, 0.0);
            let before = connected_components(mesh.vertices.len(), &weld(&mesh).triangles).of_vertex;
            let mut part_of = std::collections::BTreeMap::new();
            for (vertex, place) in simplified.place.iter().enumerate() {
                let first = welded.representative[welded.welded_of[vertex] as usize];
                let part = components.of_vertex[simplified.mesh.triangles[place.triangle as usize][0] as usize];
                assert_eq!(*part_of.entry(before[first as usize]).or_insert(part), part, "{name}, vertex {vertex}");
            }
            assert_eq!(part_of.len(), parts, "{name}");
        }
    }
}

#[test]
fn a_gap_that_needs_more_vertices_keeps_them() {
    let simplified = coarse(&slabs(), 100);
    let left = simplified.mesh.vertices.len();
    let SimplifyOutcome::Blocked { vertices, by_geometry, .. } = simplified.outcome else {
        panic!("bent sheets this close to each other need more than a hundred vertices: {:?}", simplified.outcome)
    };
    assert!(vertices == left && left < 600 && by_geometry > 100, "{:?}", simplified.outcome);
    assert_eq!(meeting(&simplified.mesh), 0);
}

fn weld(mesh: &TriangleMesh) -> TriangleMesh {
    let weld = weld_vertices(&mesh.vertices, 0.0);
    let first = |v: u32| weld.representative[weld.welded_of[v as usize] as usize];
    TriangleMesh { vertices: mesh.vertices.clone(), triangles: mesh.triangles.iter().map(|t| t.map(first)).collect() }
}

#[test]
fn animals_keep_their_shape() {
    for (file, target, near) in
        [("armadillo.obj", 10_000, 0.002), ("elephant.obj", 1500, 0.005), ("spot.obj", 700, 0.008)]
    {
        let Some(mesh) = support::shared_triangles(file) else { continue };
        let simplified = coarse(&mesh, target);
        assert_eq!(simplified.outcome, SimplifyOutcome::Reached, "{file}");
        assert_eq!(meeting(&simplified.mesh), 0, "{file}");
        assert_eq!((euler(&simplified.mesh), boundary_edges(&simplified.mesh).len()), (2, 0), "{file}");
        let share = simplified.largest_distance / size(&mesh);
        assert!(share < near, "{file}: {share}");
    }
    let Some(cow) = support::shared_triangles("cow.off") else { return };
    let simplified = coarse(&cow, 700);
    assert_eq!(simplified.outcome, SimplifyOutcome::Reached);
    assert!(meeting(&simplified.mesh) <= meeting(&cow), "the cow intersects itself, but no more than before");
}

#[test]
fn messes_are_simplified_as_far_as_they_go() {
    let Some(truck) = support::shared_triangles("truck.obj") else { return };
    let pieces = |mesh: &TriangleMesh| {
        let welded = weld(mesh);
        let of_vertex = connected_components(welded.vertices.len(), &welded.triangles).of_vertex;
        let used: std::collections::BTreeSet<u32> =
            welded.triangles.iter().flatten().map(|&v| of_vertex[v as usize]).collect();
        used.len()
    };
    let simplified = coarse(&truck, 1500);
    assert_eq!(simplified.outcome, SimplifyOutcome::Reached);
    assert!(meeting(&simplified.mesh) <= meeting(&truck));
    assert_eq!(pieces(&simplified.mesh), pieces(&truck), "no piece is lost and none joined");
    let least = coarse(&truck, 100);
    assert!(
        matches!(least.outcome, SimplifyOutcome::Blocked { vertices, .. } if vertices == least.mesh.vertices.len())
    );
    for file in ["truck.obj", "elephant.obj"] {
        let Some(mesh) = support::shared_triangles(file) else { continue };
        for (name, mess) in messes(&mesh) {
            let simplified = coarse(&mess, 1500);
            let left = simplified.mesh.vertices.len();
            assert_eq!(simplified.outcome == SimplifyOutcome::Reached, left <= 1500, "{file}, {name}");
            assert!(meeting(&simplified.mesh) <= meeting(&mess), "{file}, {name}");
        }
    }
}

fn messes(mesh: &TriangleMesh) -> Vec<(&'static str, TriangleMesh)> {
    let with = |triangles: Vec<[u32; 3]>| TriangleMesh { vertices: mesh.vertices.clone(), triangles };
    let deleted = mesh.triangles.iter().enumerate().filter(|(k, _)| k % 10 != 3).map(|(_, t)| *t).collect();
    let repeated = mesh.triangles.iter().step_by(10).map(|&[a, b, c]| [c, a, b]);
    let turned = mesh.triangles.iter().skip(3).step_by(10).map(|&[a, b, c]| [b, a, c]);
    let degenerate = mesh.triangles.iter().skip(5).step_by(10).map(|&[a, b, _]| [a, b, b]);
    let duplicated = mesh.triangles.iter().copied().chain(repeated).chain(turned).chain(degenerate).collect();
    let mut noise = support::noise();
    let mut jittered = mesh.clone();
    let step = 0.002 * size(mesh);
    jittered.vertices.iter_mut().flatten().for_each(|c| *c += step * noise());
    vec![("deleted", with(deleted)), ("duplicated", with(duplicated)), ("jittered", jittered)]
}

#[test]
fn a_soup_is_called_one() {
    let sphere = support::sphere(3);
    let mut noise = support::noise();
    let mut soup = TriangleMesh::default();
    for triangle in &sphere.triangles {
        let first = soup.vertices.len() as u32;
        soup.vertices.extend(triangle.map(|v| sphere.vertices[v as usize].map(|c| c + 0.01 * noise())));
        soup.triangles.push([first, first + 1, first + 2]);
    }
    let simplified = coarse(&soup, 200);
    assert_eq!(simplified.outcome, SimplifyOutcome::NoConnectivity { vertices: soup.vertices.len() });
    assert_eq!(simplified.mesh.triangles.len(), soup.triangles.len(), "nothing is lost");
}

#[test]
fn a_flat_sheet_keeps_its_rim() {
    let mut mesh = TriangleMesh::default();
    for (i, j) in (0..41_u32).flat_map(|i| (0..41_u32).map(move |j| (i, j))) {
        mesh.vertices.push([f64::from(i) / 40.0, f64::from(j) / 40.0, 0.0]);
        if i > 0 && j > 0 {
            let here = i * 41 + j;
            mesh.triangles.extend([[here, here - 41, here - 42], [here, here - 42, here - 1]]);
        }
    }
    let simplified = coarse(&mesh, 100);
    assert_eq!(simplified.outcome, SimplifyOutcome::Reached);
    let area: f64 = armature_geometry::surface::triangle_areas(&simplified.mesh).unwrap().iter().sum();
    assert!((area - 1.0).abs() < 0.01, "{area}");
    assert!(simplified.mesh.vertices.iter().all(|p| p[2].abs() < 1e-9));
}

#[test]
fn hostile_input_has_typed_errors() {
    let go = |mesh: &TriangleMesh, count: usize| simplify(mesh, count, &mut |_, _| ControlFlow::Continue(()));
    let mut mesh = support::sphere(3);
    assert_eq!(go(&TriangleMesh::default(), 9), Err(SimplifyError::Mesh(MeshError::Empty)));
    assert_eq!(go(&mesh, 3), Err(SimplifyError::TooFew { asked: 3 }));
    let degenerate = TriangleMesh { vertices: mesh.vertices.clone(), triangles: vec![[0, 1, 1], [2, 2, 2]] };
    assert_eq!(go(&degenerate, 9), Err(SimplifyError::NoArea));
    assert_eq!(simplify(&mesh, 9, &mut |_, _| ControlFlow::Break(())), Err(SimplifyError::Cancelled));
    let everything = go(&mesh, usize::MAX).unwrap();
    assert_eq!((everything.mesh.vertices.len(), everything.outcome), (mesh.vertices.len(), SimplifyOutcome::Reached));
    mesh.vertices.push([0.3, 0.2, 5.0]);
    let stray = coarse(&mesh, 100);
    assert!((stray.largest_distance - (0.13_f64 + 25.0).sqrt() + 1.0).abs() < 0.1, "a vertex without triangle");
    mesh.vertices[7][1] = f64::NAN;
    assert_eq!(go(&mesh, 9), Err(SimplifyError::Mesh(MeshError::NotFinite { vertex: 7 })));
}

#[test]
fn size_and_place_do_not_matter() {
    let mesh = support::sphere(4);
    let small = coarse(&mesh, 300);
    for scale in [2.0_f64.powi(-150), 2.0_f64.powi(150)] {
        let mut scaled = mesh.clone();
        scaled.vertices.iter_mut().flatten().for_each(|c| *c *= scale);
        let simplified = coarse(&scaled, 300);
        assert_eq!(simplified.mesh.triangles, small.mesh.triangles);
    }
}

#[test]
fn threads_do_not_matter() {
    let Some(mesh) = support::shared_triangles("elephant.obj") else { return };
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| coarse(&mesh, 1000))
    };
    assert_eq!(on(1), on(3));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn random_triangles_neither_panic_nor_meet_more(
        places in prop::collection::vec(prop::array::uniform3(-3_i32..4), 4..40),
        picks in prop::collection::vec(prop::array::uniform3(0_usize..40), 1..80),
        target in 4_usize..20,
    ) {
        let vertices: Vec<[f64; 3]> = places.iter().map(|p| p.map(f64::from)).collect();
        let triangles = picks.iter().map(|t| t.map(|v| (v % vertices.len()) as u32)).collect();
        let mesh = TriangleMesh { vertices, triangles };
        match simplify(&mesh, target, &mut |_, _| ControlFlow::Continue(())) {
            Ok(simplified) => {
                check(&mesh, &simplified);
                prop_assert!(meeting(&simplified.mesh) <= meeting(&mesh));
            }
            Err(why) => prop_assert_eq!(why, SimplifyError::NoArea),
        }
    }
}
