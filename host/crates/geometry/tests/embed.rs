//! Points in volumes: found where they are, placed back where they were, and not moved across gaps.

#![allow(clippy::unwrap_used, reason = "a helper of a test that cannot go on has to fail it")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::delaunay::delaunay_tetrahedra;
use armature_geometry::embed::{EmbedError, Embedding, SurfacePlaceHint, embed_points};
use armature_geometry::simplify::simplify;
use armature_geometry::winding::FastWindingNumber;
use armature_geometry::{MeshError, TetrahedralMesh, TriangleMesh};
use glam::DVec3;
use proptest::prelude::*;

fn place(mesh: &TetrahedralMesh, embedding: &Embedding, point: usize) -> DVec3 {
    let corners = mesh.tetrahedra[embedding.tetrahedra[point] as usize];
    let at = embedding.barycentric[point];
    (0..4).map(|k| DVec3::from(mesh.vertices[corners[k] as usize]) * at[k]).sum()
}

/// What holds for any points in any mesh.
fn check(mesh: &TetrahedralMesh, points: &[[f64; 3]], embedding: &Embedding) {
    assert_eq!(embedding.tetrahedra.len(), points.len());
    let size = mesh.vertices.iter().chain(points).flatten().fold(0.0, |most: f64, c| most.max(c.abs()));
    for (point, position) in points.iter().enumerate() {
        let at = embedding.barycentric[point];
        assert!(at.iter().all(|b| *b >= 0.0) && (at.iter().sum::<f64>() - 1.0).abs() < 1e-12, "{at:?}");
        let off = place(mesh, embedding, point).distance(DVec3::from(*position));
        let expected = embedding.distance[point];
        assert!((off - expected).abs() <= 1e-12 * size, "point {point} is {off} off, not {expected}");
    }
}

fn embed(mesh: &TetrahedralMesh, points: &[[f64; 3]]) -> Embedding {
    let embedding = embed_points(mesh, points, None).unwrap();
    check(mesh, points, &embedding);
    assert_eq!(embedding.searched_everywhere, points.len());
    embedding
}

#[test]
fn distances_from_a_box_are_known() {
    let mesh = support::box_of_tetrahedra(6, 0.3);
    let mut noise = support::noise();
    let points: Vec<[f64; 3]> = (0..3000).map(|_| std::array::from_fn(|_| 0.5 + 0.8 * noise())).collect();
    let embedding = embed(&mesh, &points);
    for (point, p) in points.iter().enumerate() {
        let expected = DVec3::from(*p).distance(DVec3::from(*p).clamp(DVec3::ZERO, DVec3::ONE));
        assert!((embedding.distance[point] - expected).abs() < 1e-12, "{p:?}");
    }
    let exactly: Vec<[f64; 3]> = mesh.vertices.clone();
    assert!(embed(&mesh, &exactly).distance.iter().all(|&d| d == 0.0), "vertices are inside");
    // Points with hints end up in the same places.
    let hints: Vec<SurfacePlaceHint> = (0..points.len() as u32)
        .map(|k| SurfacePlaceHint { vertices: [k % 343, SurfacePlaceHint::UNKNOWN, (7 * k) % 343] })
        .collect();
    let hinted = embed_points(&mesh, &points, Some(&hints)).unwrap();
    check(&mesh, &points, &hinted);
    assert_eq!(hinted.searched_everywhere, 0);
    let same = (0..points.len()).filter(|&k| (hinted.distance[k] - embedding.distance[k]).abs() < 1e-12).count();
    assert_eq!(same, points.len(), "in a convex volume every walk arrives");
}

#[test]
fn orientation_pieces_and_slivers_do_not_matter() {
    let mut mesh = support::box_of_tetrahedra(3, 0.2);
    let other = mesh.clone();
    mesh.tetrahedra.iter_mut().step_by(2).for_each(|t| t.swap(0, 1));
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(other.vertices.iter().map(|&[x, y, z]| [x + 1.5, y, z]));
    mesh.tetrahedra.extend(other.tetrahedra.iter().map(|t| t.map(|v| v + first)));
    mesh.tetrahedra.push([0, 1, 2, 3]);
    let points = [[0.2, 0.3, 0.4], [1.2, 0.5, 0.5], [1.3, 0.5, 0.5], [2.0, 0.9, 0.1], [3.0, 0.5, 0.5]];
    let distance = embed(&mesh, &points).distance;
    for (found, expected) in distance.into_iter().zip([0.0, 0.2, 0.2, 0.0, 0.5]) {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    }
    let flat = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1e-13]];
    let sliver = TetrahedralMesh { vertices: flat, tetrahedra: vec![[0, 1, 2, 3]] };
    embed(&sliver, &[[0.5, 0.5, 1e-14], [0.5, 0.5, 0.0], [0.2, 0.9, 1.0]]);
    let none = TetrahedralMesh { vertices: vec![[0.0; 3]; 4], tetrahedra: vec![[0, 1, 2, 3]] };
    assert!((embed(&none, &[[3.0, 0.0, 4.0]]).distance[0] - 5.0).abs() < 1e-12);
}

#[test]
fn hints_keep_points_on_their_side_of_a_gap() {
    let lower = support::box_of_tetrahedra(4, 0.0);
    let mut mesh = lower.clone();
    let first = mesh.vertices.len() as u32;
    mesh.vertices.extend(lower.vertices.iter().map(|&[x, y, z]| [x, y, z + 1.01]));
    mesh.tetrahedra.extend(lower.tetrahedra.iter().map(|t| t.map(|v| v + first)));
    let nearest = |vertices: &[[f64; 3]], p: [f64; 3]| {
        let distance = |q: &[f64; 3]| DVec3::from(*q).distance(DVec3::from(p));
        let found = (0..vertices.len()).min_by(|&i, &j| distance(&vertices[i]).total_cmp(&distance(&vertices[j])));
        found.unwrap() as u32
    };
    let mut noise = support::noise();
    // Hints place these points in the lower box, although they are above it, some of them inside the upper box.
    let points: Vec<[f64; 3]> =
        (0..500).map(|_| [0.5 + 0.5 * noise(), 0.5 + 0.5 * noise(), 1.015 + 0.015 * noise()]).collect();
    let hint = |p: &[f64; 3]| SurfacePlaceHint { vertices: [nearest(&lower.vertices, *p); 3] };
    let hints: Vec<SurfacePlaceHint> = points.iter().map(hint).collect();
    let embedding = embed_points(&mesh, &points, Some(&hints)).unwrap();
    check(&mesh, &points, &embedding);
    let is_lower = |t: u32| (t as usize) < lower.tetrahedra.len();
    for (point, p) in points.iter().enumerate() {
        assert!(is_lower(embedding.tetrahedra[point]), "{p:?}");
        assert!((embedding.distance[point] - (p[2] - 1.0)).abs() < 1e-12, "{p:?}");
    }
    assert!(embed(&mesh, &points).tetrahedra.iter().any(|&t| !is_lower(t)), "without hints some change sides");
}

/// The Delaunay tetrahedra of a surface's vertices whose barycentres are inside.
fn rough_volume(surface: &TriangleMesh) -> TetrahedralMesh {
    let all = delaunay_tetrahedra(&surface.vertices, &mut |_, _| ControlFlow::Continue(())).unwrap().tetrahedra;
    let middle = |t: &[u32; 4]| {
        let corners = t.map(|v| DVec3::from(surface.vertices[v as usize]));
        (0.25 * corners.into_iter().sum::<DVec3>()).to_array()
    };
    let winding = FastWindingNumber::precompute(surface).unwrap();
    let numbers = winding.evaluate_many(&all.iter().map(middle).collect::<Vec<_>>());
    let tetrahedra = all.into_iter().zip(numbers).filter(|(_, number)| *number > 0.5).map(|(t, _)| t).collect();
    TetrahedralMesh { vertices: surface.vertices.clone(), tetrahedra }
}

#[test]
fn the_armadillo_rides_in_a_coarse_volume() {
    for (file, target, most) in [("armadillo.obj", 10_000, 0.004), ("elephant.obj", 1500, 0.012)] {
        let Some(fine) = support::shared_triangles(file) else { continue };
        let simplified = simplify(&fine, target, &mut |_, _| ControlFlow::Continue(())).unwrap();
        let volume = rough_volume(&simplified.mesh);
        let hints = simplified.hints(Some);
        let hinted = embed_points(&volume, &fine.vertices, Some(&hints)).unwrap();
        check(&volume, &fine.vertices, &hinted);
        let free = embed(&volume, &fine.vertices);
        let (low, high) = fine.bounds().unwrap();
        let diagonal = DVec3::from(low).distance(DVec3::from(high));
        let mut apart = 0;
        for point in 0..fine.vertices.len() {
            let (near, nearest) = (hinted.distance[point], free.distance[point]);
            assert!(near >= nearest - 1e-12 * diagonal, "nearer than the nearest place");
            assert!(near < most * diagonal, "{file}, vertex {point}: {}", near / diagonal);
            apart += usize::from(near > nearest + 1e-9 * diagonal);
        }
        println!("{file}: {apart} of {} stay on another side than the nearest", fine.vertices.len());
        assert!(apart * 100 < fine.vertices.len(), "{file}: {apart}");
        assert!(hinted.searched_everywhere * 1000 <= fine.vertices.len(), "{}", hinted.searched_everywhere);
    }
}

#[test]
fn hostile_input_has_typed_errors() {
    let mesh = support::box_of_tetrahedra(1, 0.0);
    let empty = TetrahedralMesh::default();
    assert_eq!(embed_points(&empty, &[[0.0; 3]], None), Err(EmbedError::Mesh(MeshError::Empty)));
    let points = [[0.5; 3], [0.0, f64::NAN, 0.0]];
    assert_eq!(embed_points(&mesh, &points, None), Err(EmbedError::NotFinite { point: 1 }));
    assert_eq!(embed_points(&mesh, &[[1e70, 0.0, 0.0]], None), Err(EmbedError::TooFar { point: 0 }));
    let hints = [SurfacePlaceHint { vertices: [0, 8, 1] }];
    let counted = EmbedError::HintCount { points: 2, hints: 1 };
    assert_eq!(embed_points(&mesh, &[[0.5; 3]; 2], Some(&hints)), Err(counted));
    let named = EmbedError::HintOutOfRange { point: 0, vertex: 8, vertex_count: 8 };
    assert_eq!(embed_points(&mesh, &[[0.5; 3]], Some(&hints)), Err(named));
    let mut twice = mesh.clone();
    twice.tetrahedra.extend(mesh.tetrahedra.clone());
    assert_eq!(embed_points(&twice, &[[0.5; 3]], None).map(|e| e.distance), Ok(vec![0.0]));
    assert_eq!(embed_points(&mesh, &[], None), Ok(Embedding::default()));
}

#[test]
fn size_does_not_matter() {
    let mut noise = support::noise();
    let points: Vec<[f64; 3]> = (0..300).map(|_| std::array::from_fn(|_| 0.5 + 0.8 * noise())).collect();
    let mesh = support::box_of_tetrahedra(3, 0.2);
    let plain = embed(&mesh, &points);
    for scale in [2.0_f64.powi(-400), 2.0_f64.powi(190)] {
        let mut scaled = mesh.clone();
        scaled.vertices.iter_mut().flatten().for_each(|c| *c *= scale);
        let far: Vec<[f64; 3]> = points.iter().map(|p| p.map(|c| c * scale)).collect();
        let embedding = embed(&scaled, &far);
        assert_eq!((&embedding.tetrahedra, &embedding.barycentric), (&plain.tetrahedra, &plain.barycentric));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn random_tetrahedra_hold_what_they_should(
        places in prop::collection::vec(prop::array::uniform3(-3_i32..4), 4..20),
        picks in prop::collection::vec(prop::array::uniform4(0_usize..20), 1..30),
        queries in prop::collection::vec(prop::array::uniform3(-8_i32..9), 1..40),
        start in 0_usize..20,
    ) {
        let vertices: Vec<[f64; 3]> = places.iter().map(|p| p.map(f64::from)).collect();
        let tetrahedra = picks.iter().map(|t| t.map(|v| (v % vertices.len()) as u32)).collect();
        let mesh = TetrahedralMesh { vertices, tetrahedra };
        let points: Vec<[f64; 3]> = queries.iter().map(|p| p.map(|c| 0.5 * f64::from(c))).collect();
        let hints = vec![SurfacePlaceHint { vertices: [(start % mesh.vertices.len()) as u32; 3] }; points.len()];
        for hints in [None, Some(&hints[..])] {
            match embed_points(&mesh, &points, hints) {
                Ok(embedding) => check(&mesh, &points, &embedding),
                Err(why) => {
                    let known = matches!(why, EmbedError::NoBoundary { .. });
                    prop_assert!(known, "{}", why);
                }
            }
        }
    }
}
