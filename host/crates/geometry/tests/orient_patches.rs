//! Meshes with randomly reversed triangles are restored.

mod support;

use std::time::Instant;

use armature_geometry::orientation::{OrientedPatches, PatchVerdict, flipped_components, orient_patches};
use armature_geometry::surface::edges;
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{MeshError, TriangleMesh};
use proptest::prelude::*;

fn turn(mesh: &TriangleMesh, mut wants: impl FnMut(usize) -> bool) -> TriangleMesh {
    let mut turned = mesh.clone();
    for (index, triangle) in turned.triangles.iter_mut().enumerate() {
        if wants(index) {
            triangle.swap(1, 2);
        }
    }
    turned
}

/// Triangles with their smallest vertex first, keeping their direction.
fn directed(mesh: &TriangleMesh) -> Vec<[u32; 3]> {
    let first = |&[a, b, c]: &[u32; 3]| {
        if a <= b && a <= c {
            [a, b, c]
        } else if b <= c {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    mesh.triangles.iter().map(first).collect()
}

fn inconsistent_edges(mesh: &TriangleMesh) -> usize {
    edges(&mesh.triangles).iter().filter(|e| e.triangles == 2 && e.forward != 1).count()
}

fn join(parts: &[(&TriangleMesh, [f64; 3], f64)]) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for (part, at, size) in parts {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend(part.vertices.iter().map(|v| [0, 1, 2].map(|k| at[k] + size * v[k])));
        mesh.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + first)));
    }
    mesh
}

/// A strip of `count` quads bent into a ring, with a half twist if `twisted`.
fn ring(count: u32, twisted: bool) -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    for k in 0..count {
        let angle = std::f64::consts::TAU * f64::from(k) / f64::from(count);
        let lean = if twisted { 0.5 * angle } else { 0.0 };
        for side in [-0.3, 0.3] {
            let radius = 1.0 + side * lean.cos();
            mesh.vertices.push([radius * angle.cos(), radius * angle.sin(), side * lean.sin()]);
        }
        let [a, b] = [2 * k, 2 * k + 1];
        let [c, d] = if k + 1 < count {
            [a + 2, b + 2]
        } else if twisted {
            [1, 0]
        } else {
            [0, 1]
        };
        mesh.triangles.extend([[a, c, b], [b, c, d]]);
    }
    mesh
}

#[test]
fn a_random_half_of_the_triangles_comes_back() {
    let mut meshes = vec![("sphere", support::sphere(3))];
    for file in ["armadillo.obj", "cow.off", "spot.obj", "elephant.obj"] {
        meshes.extend(support::shared_triangles(file).map(|mesh| (file, mesh)));
    }
    for (name, mesh) in meshes {
        let mut noise = support::noise();
        let mut wanted = Vec::new();
        let half = turn(&mesh, |index| {
            let wants = noise() > 0.0;
            wanted.extend(wants.then_some(index as u32));
            wants
        });
        let start = Instant::now();
        let oriented = orient_patches(&half).unwrap();
        println!("{name}: {} triangles in {:.3} s", mesh.triangles.len(), start.elapsed().as_secs_f64());
        assert!(oriented.patches.iter().all(|p| p.verdict == PatchVerdict::Decided), "{name}: {:?}", oriented.patches);
        assert!(directed(&oriented.mesh) == directed(&mesh), "{name}");
        assert!(oriented.turned == wanted, "{name}");
        assert_eq!(oriented.patches.iter().map(|p| p.turned).sum::<usize>(), wanted.len());
        assert!(oriented.contradictions.is_empty());
        // There is nothing left to do, and nothing to do on a sound mesh.
        assert!(orient_patches(&oriented.mesh).unwrap().turned.is_empty(), "{name}");
        assert!(orient_patches(&mesh).unwrap().turned.is_empty(), "{name}");
    }
}

#[test]
fn whole_components_cavities_and_parts_within() {
    let sphere = support::sphere(2);
    let inward = turn(&sphere, |_| true);
    // Inside out; a cavity in a solid; an eye in a head.
    let (one, two, three) = ([0.0; 3], [5.0, 0.0, 0.0], [10.0, 0.0, 0.0]);
    let parts = [
        (&inward, one, 1.0),
        (&sphere, two, 1.1),
        (&inward, two, 0.5),
        (&sphere, three, 1.2),
        (&sphere, [10.9, 0.0, 0.0], 0.4),
    ];
    let mesh = join(&parts);
    let oriented = orient_patches(&mesh).unwrap();
    let count = sphere.triangles.len();
    assert_eq!(oriented.turned, (0..count as u32).collect::<Vec<_>>());
    assert_eq!(oriented.undecided().count(), 0);
    assert!((oriented.patches[0].mean_winding.unwrap() - 0.5).abs() < 0.01, "{:?}", oriented.patches);
    assert_eq!(oriented.mesh, flipped_components(&mesh).unwrap().corrected(&mesh));
    // Half of the cavity's triangles reversed: there is no telling whether it is a cavity or a separate part.
    let half = turn(&mesh, |index| (2 * count..3 * count).contains(&index) && index % 2 == 0);
    let oriented = orient_patches(&half).unwrap();
    assert_eq!(oriented.undecided().collect::<Vec<_>>(), [2]);
    assert_eq!(oriented.patches[2].verdict, PatchVerdict::Within);
    assert_eq!(inconsistent_edges(&oriented.mesh), 0);
}

#[test]
fn open_sheets_agree_and_keep_the_side_of_most_of_their_area() {
    let mut mesh = TriangleMesh::default();
    for index in 0..100_u32 {
        mesh.vertices.push([f64::from(index % 10), f64::from(index / 10), 0.0]);
        if index % 10 < 9 && index < 90 {
            mesh.triangles.extend([[index, index + 1, index + 11], [index, index + 11, index + 10]]);
        }
    }
    let mut noise = support::noise();
    let some = turn(&mesh, |_| noise() > 0.4);
    let oriented = orient_patches(&some).unwrap();
    assert_eq!(directed(&oriented.mesh), directed(&mesh));
    assert_eq!(oriented.patches.len(), 1);
    assert_eq!(oriented.patches[0].verdict, PatchVerdict::Open);
    // A bowl is open as well, but has an inside.
    let sphere = support::sphere(3);
    let bowl = TriangleMesh {
        triangles: sphere
            .triangles
            .iter()
            .copied()
            .filter(|t| t.iter().all(|&v| sphere.vertices[v as usize][1] < 0.5))
            .collect(),
        vertices: sphere.vertices,
    };
    let oriented = orient_patches(&turn(&bowl, |_| noise() > 0.0)).unwrap();
    assert_eq!((directed(&oriented.mesh), oriented.patches[0].verdict), (directed(&bowl), PatchVerdict::Decided));
}

#[test]
fn a_moebius_strip_is_said_to_have_one_side() {
    let strip = ring(40, true);
    let oriented = orient_patches(&strip).unwrap();
    assert_eq!(oriented.patches.len(), 1);
    assert_eq!(oriented.patches[0].verdict, PatchVerdict::OneSided);
    assert_eq!(oriented.contradictions.len(), 1, "a strip is cut open at one edge: {:?}", oriented.contradictions);
    assert_eq!(inconsistent_edges(&oriented.mesh), 1);
    let plain = ring(40, false);
    let oriented = orient_patches(&turn(&plain, |index| index % 5 == 0)).unwrap();
    assert!(oriented.contradictions.is_empty() && oriented.patches[0].verdict == PatchVerdict::Open);
    assert_eq!(directed(&oriented.mesh), directed(&plain));
}

#[test]
fn copies_follow_the_first_and_degenerate_triangles_stay() {
    let sphere = support::sphere(2);
    let mut mesh = sphere.clone();
    mesh.triangles.extend(sphere.triangles.iter().step_by(3).map(|&[a, b, c]| [b, c, a]));
    mesh.triangles.push([0, 0, 1]);
    let mut noise = support::noise();
    let turned = turn(&mesh, |index| index + 1 < mesh.triangles.len() && noise() > 0.0);
    let oriented = orient_patches(&turned).unwrap();
    assert_eq!(directed(&oriented.mesh), directed(&mesh));
    assert_eq!(oriented.patches.len(), 1);
    assert_eq!(oriented.patches[0].triangles + 1, mesh.triangles.len());
    assert_eq!(oriented.patch_of.last(), Some(&OrientedPatches::NO_PATCH));
}

#[test]
fn a_wall_inside_a_solid_does_not_turn_its_skin() {
    // Two chambers with a wall between them, whose rim has edges with three triangles.
    let mut mesh = TriangleMesh::default();
    for x in 0..3_u32 {
        mesh.vertices.extend([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[y, z]| [f64::from(x), y, z]));
    }
    let mut quad = |[a, b, c, d]: [u32; 4]| mesh.triangles.extend([[a, b, c], [a, c, d]]);
    for first in [0, 4] {
        for k in 0..4 {
            let (at, next) = (first + k, first + (k + 1) % 4);
            quad([at, next, next + 4, at + 4]);
        }
    }
    quad([0, 1, 2, 3].map(|k| 3 - k));
    quad([8, 9, 10, 11]);
    quad([4, 5, 6, 7]);
    assert_eq!(edges(&mesh.triangles).iter().filter(|e| e.triangles == 3).count(), 4);
    let skin = mesh.triangles.len() - 2;
    let outward = orient_patches(&mesh).unwrap();
    assert!(outward.turned.is_empty(), "{:?}", outward.turned);
    let mut noise = support::noise();
    for _ in 0..20 {
        let oriented = orient_patches(&turn(&mesh, |_| noise() > 0.0)).unwrap();
        assert_eq!(directed(&oriented.mesh)[..skin], directed(&outward.mesh)[..skin]);
        assert_eq!(oriented.patches.len(), 3);
        assert_eq!(oriented.undecided().collect::<Vec<_>>(), [2]);
        assert_eq!(inconsistent_edges(&oriented.mesh), 0);
        let centres =
            [[0.5; 3], [1.5, 0.5, 0.5]].map(|p| FastWindingNumber::precompute(&oriented.mesh).unwrap().evaluate(p));
        assert!(centres.iter().all(|w| *w > 0.5), "{centres:?}");
    }
}

#[test]
fn the_truck_gets_better() {
    let Some(truck) = support::shared_triangles("truck.obj") else { return };
    let (low, high) = truck.bounds().unwrap();
    let mut noise = support::noise();
    let points: Vec<[f64; 3]> = (0..20_000)
        .map(|_| std::array::from_fn(|k| f64::midpoint(low[k], high[k]) + 0.5 * noise() * (high[k] - low[k])))
        .collect();
    let inside_out = |mesh: &TriangleMesh| {
        let winding = FastWindingNumber::precompute(mesh).unwrap().evaluate_many(&points);
        winding.iter().filter(|&&w| w < -0.25).count()
    };
    let oriented = orient_patches(&truck).unwrap();
    let by_components = inside_out(&flipped_components(&truck).unwrap().corrected(&truck));
    let (before, after) = (inside_out(&truck), inside_out(&oriented.mesh));
    println!(
        "truck: {before} points of 20,000 inside out, {by_components} with components reversed, {after} with patches; {} patches, {} undecided, {} triangles reversed",
        oriented.patches.len(),
        oriented.undecided().count(),
        oriented.turned.len()
    );
    assert!(after * 5 < before && after * 5 < by_components, "{before}, {by_components}, {after}");
}

#[test]
fn bad_meshes_are_refused() {
    assert_eq!(orient_patches(&TriangleMesh::default()).unwrap_err(), MeshError::Empty);
    let mut mesh = support::sphere(1);
    mesh.vertices[2][0] = f64::NAN;
    assert_eq!(orient_patches(&mesh).unwrap_err(), MeshError::NotFinite { vertex: 2 });
}

proptest! {
    /// Triangles between few vertices: edges with many triangles, duplicates, degenerate ones.
    #[test]
    fn soups_come_back_whole(
        vertices in prop::collection::vec(prop::array::uniform3(-1.0..1.0_f64), 3..40),
        corners in prop::collection::vec(prop::array::uniform3(0_u32..1000), 1..300),
    ) {
        let count = vertices.len() as u32;
        let mesh = TriangleMesh { vertices, triangles: corners.iter().map(|t| t.map(|v| v % count)).collect() };
        let oriented = orient_patches(&mesh).unwrap();
        let turned: std::collections::BTreeSet<u32> = oriented.turned.iter().copied().collect();
        prop_assert_eq!(&oriented.mesh, &turn(&mesh, |index| turned.contains(&(index as u32))));
        let members: usize = oriented.patches.iter().map(|p| p.triangles).sum();
        let outside = oriented.patch_of.iter().filter(|&&p| p == OrientedPatches::NO_PATCH).count();
        prop_assert_eq!(members + outside, mesh.triangles.len());
    }
}
