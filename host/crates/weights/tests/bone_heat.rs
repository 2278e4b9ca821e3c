//! Bone heat against calculus, against an independently assembled system, and on meshes in every state.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::operators::{Lumping, intrinsic_delaunay_laplacian};
use armature_geometry::{MeshError, TriangleMesh};
use armature_weights::BoneSegment;
use armature_weights::finish::sparsify;
use armature_weights::heat::{BoneHeat, BoneHeatError, BoneHeatSettings, Visibility, bone_heat};
use proptest::prelude::*;

fn heat(mesh: &TriangleMesh, bones: &[BoneSegment]) -> BoneHeat {
    heat_with(mesh, bones, &BoneHeatSettings::default())
}

fn heat_with(mesh: &TriangleMesh, bones: &[BoneSegment], settings: &BoneHeatSettings) -> BoneHeat {
    let heat =
        bone_heat(mesh, bones, settings, &mut |_, _| ControlFlow::Continue(())).expect("weights for a usable mesh");
    check_invariants(mesh, bones, &heat);
    heat
}

/// Weights lie in 0..=1 and sum to one, and nearly did so before they were corrected.
fn check_invariants(mesh: &TriangleMesh, bones: &[BoneSegment], heat: &BoneHeat) {
    assert_eq!((heat.weights.vertices(), heat.weights.bones()), (mesh.vertices.len(), bones.len()));
    assert!(heat.weights.to_columns().unwrap().iter().all(|w| (0.0..=1.0).contains(w)));
    for vertex in 0..mesh.vertices.len() {
        let sum: f64 = heat.weights.vertex(vertex).sum();
        assert!((sum - 1.0).abs() < 1e-12, "vertex {vertex} sums to {sum}");
    }
    assert!(heat.residual < 1e-12 && heat.deviation < 1e-9, "{} {}", heat.residual, heat.deviation);
    for &bone in &heat.report.cold_bones {
        assert!(heat.weights.bone(bone).iter().all(|w| *w == 0.0));
    }
}

fn largest_difference(a: &BoneHeat, b: &BoneHeat) -> f64 {
    a.weights
        .to_columns()
        .unwrap()
        .iter()
        .zip(b.weights.to_columns().unwrap())
        .map(|(x, y)| (x - y).abs())
        .fold(0.0, f64::max)
}

fn bone(head: [f64; 3], tail: [f64; 3]) -> BoneSegment {
    BoneSegment { head, tail }
}

/// An open tube around the x axis from -2 to 2, `rings` rings of 12 vertices at distance `radius`.
fn tube(rings: u32, radius: f64) -> TriangleMesh {
    let around = 12;
    let mut mesh = TriangleMesh::default();
    for index in 0..rings * around {
        let angle = f64::from(index % around) / f64::from(around) * std::f64::consts::TAU;
        let along = 4.0 * f64::from(index / around) / f64::from(rings - 1) - 2.0;
        mesh.vertices.push([along, radius * angle.cos(), radius * angle.sin()]);
    }
    for ring in 0..rings - 1 {
        for k in 0..around {
            let (a, b) = (ring * around + k, ring * around + (k + 1) % around);
            mesh.triangles.extend([[a, b, a + around], [b, b + around, a + around]]);
        }
    }
    mesh
}

fn sphere(centre: [f64; 3], radius: f64) -> TriangleMesh {
    let (rings, around) = (24, 32_u32);
    let mut mesh = TriangleMesh::default();
    let mut at = |polar: f64, turn: f64| {
        let p = [polar.sin() * turn.cos(), polar.sin() * turn.sin(), polar.cos()];
        mesh.vertices.push(std::array::from_fn(|k| centre[k] + radius * p[k]));
    };
    for ring in 1..rings {
        for k in 0..around {
            at(
                std::f64::consts::PI * f64::from(ring) / f64::from(rings),
                std::f64::consts::TAU * f64::from(k) / f64::from(around),
            );
        }
    }
    at(0.0, 0.0);
    at(std::f64::consts::PI, 0.0);
    let (north, south) = ((rings as u32 - 1) * around, (rings as u32 - 1) * around + 1);
    for k in 0..around {
        let next = (k + 1) % around;
        mesh.triangles.push([north, k, next]);
        let last = north - around;
        mesh.triangles.push([south, last + next, last + k]);
        for ring in 0..rings as u32 - 2 {
            let (a, b) = (ring * around + k, ring * around + next);
            mesh.triangles.extend([[a, a + around, b], [b, a + around, b + around]]);
        }
    }
    mesh
}

fn join(parts: &[TriangleMesh]) -> TriangleMesh {
    let mut all = TriangleMesh::default();
    for part in parts {
        let offset = all.vertices.len() as u32;
        all.vertices.extend(&part.vertices);
        all.triangles.extend(part.triangles.iter().map(|t| t.map(|v| v + offset)));
    }
    all
}

#[test]
fn tube_converges_to_the_analytic_solution() {
    // Two bones along the axis meet at 0; every vertex is `radius` away from its bone, so that
    // w'' = (c / radius²)(w - p) with a step p, and w = ½ cosh(k(2 - x)) / cosh(2k), k = √c / radius, for x > 0.
    for (c, radius) in [(1.0, 0.5), (0.22, 0.5), (1.0, 0.3)] {
        let bones = [bone([-2.0, 0.0, 0.0], [0.0; 3]), bone([0.0; 3], [2.0, 0.0, 0.0])];
        let settings = BoneHeatSettings { heat: c, ..BoneHeatSettings::default() };
        let k: f64 = f64::sqrt(c) / radius;
        let mut errors = Vec::new();
        for rings in [21, 41, 81] {
            let mesh = tube(rings, radius);
            let heat = heat_with(&mesh, &bones, &settings);
            assert_eq!((heat.report.blind_vertices, heat.report.components), (0, 1));
            let error = mesh.vertices.iter().zip(heat.weights.bone(0)).map(|(p, w)| {
                let beyond = 0.5 * (k * (2.0 - p[0].abs())).cosh() / (2.0 * k).cosh();
                (w - if p[0] > 0.0 { beyond } else { 1.0 - beyond }).abs()
            });
            errors.push(error.fold(0.0, f64::max));
        }
        assert!(errors[2] < 0.002, "c {c}: {errors:?}");
        assert!(errors.windows(2).all(|e| e[1] < 0.3 * e[0]), "c {c}: {errors:?}");
    }
}

#[test]
fn weights_solve_an_independently_assembled_system() {
    let Some((mesh, bones)) = support::shared_character("elephant") else { return };
    let settings = BoneHeatSettings { visibility: Visibility::Ignored, ..BoneHeatSettings::default() };
    let result = heat_with(&mesh, &bones, &settings);
    let operators = intrinsic_delaunay_laplacian(&mesh, Lumping::VoronoiHybrid).unwrap();
    let mut near: Vec<(f64, Vec<usize>)> = Vec::new();
    for vertex in &mesh.vertices {
        let distances: Vec<f64> = bones.iter().map(|b| sampled_distance(*vertex, b)).collect();
        let least = distances.iter().copied().fold(f64::INFINITY, f64::min);
        near.push((least, (0..bones.len()).filter(|&j| distances[j] <= least * 1.0001).collect()));
    }
    for j in 0..bones.len() {
        let w = &result.weights.bone(j);
        let lw = operators.matrix.multiply(w);
        for (i, (distance, nearest)) in near.iter().enumerate() {
            let h = settings.heat * nearest.len() as f64 / (distance * distance);
            let p = if nearest.contains(&j) { 1.0 / nearest.len() as f64 } else { 0.0 };
            let (out, into) = (-lw[i] + operators.mass[i] * h * w[i], operators.mass[i] * h * p);
            let size = -operators.matrix.get(i, i) + operators.mass[i] * h;
            assert!((out - into).abs() < 1e-9 * size, "bone {j}, vertex {i}: {out} instead of {into}");
        }
    }
}

/// Distance from a point to a bone by trisection.
fn sampled_distance(point: [f64; 3], bone: &BoneSegment) -> f64 {
    let at = |t: f64| {
        let d: f64 = (0..3).map(|k| (bone.head[k] + t * (bone.tail[k] - bone.head[k]) - point[k]).powi(2)).sum();
        d.sqrt()
    };
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..120 {
        let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
        if at(a) < at(b) { high = b } else { low = a }
    }
    at(f64::midpoint(low, high)).min(at(0.0)).min(at(1.0))
}

#[test]
fn shared_characters_keep_every_invariant() {
    // The fraction of vertices whose line to the nearest bone leaves the shape, computed once with the generalized
    // winding number (libigl 2.6.3, `fast_winding_number`) at 30 points along the line for 3000 random vertices.
    for (name, blind) in [("armadillo", 0.049), ("elephant", 0.284), ("arm", 0.291)] {
        let Some((mesh, bones)) = support::shared_character(name) else { continue };
        let result = heat(&mesh, &bones);
        assert!(result.report.cold_bones.is_empty() && result.report.blind_components.is_empty());
        assert_eq!((result.report.components, result.report.clamped_edges), (1, 0));
        let fraction = result.report.blind_vertices as f64 / mesh.vertices.len() as f64;
        assert!((fraction - blind).abs() < 0.02, "{name}: {fraction} see no bone instead of {blind}");
        let columns: Vec<u16> = (0..bones.len() as u16).collect();
        let (influences, report) = sparsify(&result.weights, 4, &columns, bones.len()).unwrap();
        assert_eq!(influences.vertex_count(), mesh.vertices.len());
        assert!(report.mean_dropped < 0.05, "{name}: {report:?}");
    }
}

#[test]
fn mean_weights_are_those_of_blender() {
    // Mean weight of each bone over all vertices by Blender 5.0.1's automatic weights, normalised at each vertex
    // (made with tests/blender_heat.py). Blender lengthens distances to bones that a vertex faces away from, so only
    // rough agreement is asked for; all weights together correlate by 0.999.
    let blender = [0.1159, 0.2621, 0.1101, 0.5119];
    let Some((mesh, bones)) = support::shared_character("arm") else { return };
    let result = heat(&mesh, &bones);
    for (bone, expected) in blender.into_iter().enumerate() {
        let mean = result.weights.bone(bone).iter().sum::<f64>() / mesh.vertices.len() as f64;
        assert!((mean - expected).abs() < 0.01, "bone {bone}: {mean} instead of {expected}");
    }
}

#[test]
fn unit_place_and_orientation_change_nothing() {
    let Some((mesh, bones)) = support::shared_character("elephant") else { return };
    let original = heat(&mesh, &bones);
    let moved = |p: [f64; 3]| [100.0 * p[0] + 7.0, 100.0 * p[1] - 300.0, 100.0 * p[2] + 0.1];
    let large = TriangleMesh { vertices: mesh.vertices.iter().map(|&p| moved(p)).collect(), ..mesh.clone() };
    let large_bones: Vec<_> = bones.iter().map(|b| bone(moved(b.head), moved(b.tail))).collect();
    let difference = largest_difference(&original, &heat(&large, &large_bones));
    assert!(difference < 1e-8, "scaling and moving changed weights by {difference}");
    let mut inside_out = mesh.clone();
    inside_out.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let difference = largest_difference(&original, &heat(&inside_out, &bones));
    assert!(difference < 1e-8, "turning inside out changed weights by {difference}");
}

#[test]
fn seams_do_not_tear_and_threads_do_not_matter() {
    let Some((mesh, bones)) = support::shared_character("elephant") else { return };
    let original = heat(&mesh, &bones);
    let torn = TriangleMesh {
        vertices: mesh.triangles.iter().flatten().map(|&v| mesh.vertices[v as usize]).collect(),
        triangles: (0..mesh.triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
    };
    let from_soup = heat(&torn, &bones);
    assert_eq!(from_soup.report.welded_vertices, mesh.vertices.len());
    for (corner, &vertex) in mesh.triangles.iter().flatten().enumerate() {
        let pairs = from_soup.weights.vertex(corner).zip(original.weights.vertex(vertex as usize));
        assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() < 1e-9));
    }
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap().install(|| heat(&mesh, &bones));
    assert_eq!(alone, original);
}

#[test]
fn bones_do_not_heat_through_walls() {
    let left = sphere([0.0; 3], 1.0);
    let mesh = join(&[left.clone(), sphere([2.2, 0.0, 0.0], 1.0)]);
    let bones = [bone([-0.8, 0.0, 0.0], [-0.8, 0.0, 0.0]), bone([1.4, 0.0, 0.0], [2.6, 0.0, 0.0])];
    let seen = heat(&mesh, &bones);
    let n = left.vertices.len();
    assert_eq!(seen.report.components, 2);
    assert!(seen.report.blind_vertices > 0 && seen.report.blind_components.is_empty());
    assert!(seen.weights.bone(0)[..n].iter().all(|w| *w > 1.0 - 1e-9));
    assert!(seen.weights.bone(1)[n..].iter().all(|w| *w > 1.0 - 1e-9));
    let settings = BoneHeatSettings { visibility: Visibility::Ignored, ..BoneHeatSettings::default() };
    let through = heat_with(&mesh, &bones, &settings);
    assert!(through.weights.bone(1)[..n].iter().any(|w| *w > 0.5));
}

#[test]
fn blind_pieces_cold_bones_and_lonely_vertices_are_reported() {
    // A button outside a head, a vertex in no triangle, a repeated triangle, a collapsed one, and a bone far outside.
    let (head, button) = (sphere([0.0; 3], 1.0), sphere([1.3, 0.0, 0.0], 0.2));
    let (n, m) = (head.vertices.len(), button.vertices.len());
    let mut mesh = join(&[head, button]);
    mesh.vertices.push([0.0, 0.9, 0.0]);
    mesh.triangles.extend([mesh.triangles[0], [5, 5, 9]]);
    let bones = [bone([-0.3, 0.0, 0.0], [0.0; 3]), bone([9.0, 0.0, 0.0], [9.0, 1.0, 0.0]), bone([0.0; 3], [0.0; 3])];
    let result = heat(&mesh, &bones);
    assert_eq!(result.report.components, 3);
    assert_eq!(result.report.blind_components, [n]);
    assert_eq!(result.report.cold_bones, [1]);
    assert_eq!(result.report.isolated_vertices, 1);
    assert_eq!((result.report.duplicate_triangles, result.report.collapsed_triangles), (1, 1));
    // Everything in the button, and the isolated vertex, is nearest to where bones 0 and 2 meet: equal shares.
    for vertex in n..=n + m {
        let weights: Vec<f64> = result.weights.vertex(vertex).collect();
        assert!((weights[0] - 0.5).abs() < 1e-9 && (weights[2] - 0.5).abs() < 1e-9, "{weights:?}");
    }
}

#[test]
fn messy_model_gets_weights_everywhere() {
    let Some(path) = armature_test_support::shared("truck.obj") else { return };
    let mesh = support::read_obj(&path);
    let (low, high) = mesh.bounds().unwrap();
    let at = |t: [f64; 3]| std::array::from_fn(|k| low[k] + t[k] * (high[k] - low[k]));
    let bones = [
        bone(at([0.5, 0.5, 0.0]), at([0.5, 0.5, 0.4])),
        bone(at([0.5, 0.5, 0.4]), at([0.5, 0.5, 1.0])),
        bone(at([0.2, 0.2, 0.2]), at([0.2, 0.2, 0.2])),
    ];
    let result = heat(&mesh, &bones);
    println!("{:?}", result.report);
    assert!(result.report.components > 10);
}

#[test]
fn one_bone_moves_everything_and_collapsed_meshes_follow_the_nearest() {
    let mesh = sphere([0.0; 3], 1.0);
    let alone = heat(&mesh, &[bone([0.0; 3], [0.0; 3])]);
    assert!(alone.weights.to_columns().unwrap().iter().all(|w| *w > 1.0 - 1e-12));
    let point = TriangleMesh { vertices: vec![[3.0; 3]; 3], triangles: vec![[0, 1, 2]] };
    let result = heat(&point, &[bone([0.0; 3], [1.0; 3]), bone([4.0; 3], [5.0; 3])]);
    assert_eq!(result.report.collapsed_triangles, 1);
    assert!(result.weights.bone(1).iter().all(|w| *w > 1.0 - 1e-12));
}

#[test]
fn flat_figures_are_heated_within_their_plane() {
    let n = 20_u32;
    let vertices = (0..=n * 2 + 1).map(|i| [f64::from(i / 2), f64::from(i % 2), 0.0]).collect();
    let triangles = (0..n).flat_map(|i| [[2 * i, 2 * i + 2, 2 * i + 1], [2 * i + 1, 2 * i + 2, 2 * i + 3]]).collect();
    let mesh = TriangleMesh { vertices, triangles };
    let bones = [bone([0.0, 0.5, 0.0], [10.0, 0.5, 0.0]), bone([10.0, 0.5, 0.0], [20.0, 0.5, 0.0])];
    let result = heat(&mesh, &bones);
    assert_eq!(result.report.blind_vertices, 0);
    assert!(result.weights.weight(0, 0) > 0.99 && result.weights.weight(2 * n as usize, 1) > 0.99);
}

#[test]
fn bones_far_away_give_constant_weights() {
    let mesh = sphere([0.0; 3], 1.0);
    for far in [1e3, 1e9, 1e40] {
        let bones = [bone([far, 0.0, 0.0], [far, 1.0, 0.0]), bone([-far, 0.0, 0.0], [-far, 0.0, 1.0])];
        let settings = BoneHeatSettings { visibility: Visibility::Ignored, ..BoneHeatSettings::default() };
        let result = bone_heat(&mesh, &bones, &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
        assert!(result.weights.to_columns().unwrap().iter().all(|w| (w - 0.5).abs() < 1e-3), "{far}");
        assert!(result.deviation < 1e-6);
    }
}

#[test]
fn every_stage_can_be_cancelled() {
    let mesh = sphere([0.0; 3], 1.0);
    let bones = [bone([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0])];
    let mut seen = Vec::new();
    let mut last = 0.0;
    bone_heat(&mesh, &bones, &BoneHeatSettings::default(), &mut |stage, done| {
        assert!(done >= last && done <= 1.0);
        last = done;
        seen.push(stage);
        ControlFlow::Continue(())
    })
    .unwrap();
    seen.dedup();
    let stages = [
        "preparing the surface",
        "looking for bones",
        "factorising the heat equation",
        "diffusing heat",
        "checking the weights",
    ];
    assert_eq!(seen, stages);
    for stop in seen {
        let result = bone_heat(&mesh, &bones, &BoneHeatSettings::default(), &mut |stage, _| {
            if stage == stop { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!(result, Err(BoneHeatError::Cancelled { stage: stop }));
    }
}

#[test]
fn nonsense_is_named() {
    let mesh = sphere([0.0; 3], 1.0);
    let good = [bone([-0.5, 0.0, 0.0], [0.5, 0.0, 0.0])];
    let try_with = |mesh: &TriangleMesh, bones: &[BoneSegment], settings: &BoneHeatSettings| {
        bone_heat(mesh, bones, settings, &mut |_, _| ControlFlow::Continue(())).unwrap_err()
    };
    let usual = BoneHeatSettings::default();
    assert_eq!(try_with(&mesh, &[], &usual), BoneHeatError::NoBones);
    let too_many = vec![good[0]; 65_536];
    assert!(matches!(try_with(&mesh, &too_many, &usual), BoneHeatError::TooManyBones { count: 65_536, .. }));
    for far in [f64::NAN, f64::INFINITY, 1e200] {
        let bones = [good[0], bone([0.0; 3], [0.0, far, 0.0])];
        assert_eq!(try_with(&mesh, &bones, &usual), BoneHeatError::BoneOutOfReach { bone: 1 });
    }
    for settings in [
        BoneHeatSettings { heat: 0.0, ..usual },
        BoneHeatSettings { heat: f64::NAN, ..usual },
        BoneHeatSettings { tie_ratio: -1.0, ..usual },
        BoneHeatSettings { weld_ratio: f64::INFINITY, ..usual },
    ] {
        assert!(matches!(try_with(&mesh, &good, &settings), BoneHeatError::BadSetting { .. }));
    }
    let mut broken = mesh.clone();
    broken.vertices[7][1] = f64::NAN;
    assert_eq!(try_with(&broken, &good, &usual), MeshError::NotFinite { vertex: 7 }.into());
    assert_eq!(try_with(&TriangleMesh::default(), &good, &usual), MeshError::Empty.into());
}

fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -1.0..1.0,
        3 => (-2_i32..3).prop_map(f64::from),
        1 => prop_oneof![Just(1e-300), Just(1e-9), Just(1e9), Just(-1e60)],
    ]
}

prop_compose! {
    fn soup()(n in 3_usize..20)(
        vertices in proptest::collection::vec([coordinate(), coordinate(), coordinate()], n),
        triangles in proptest::collection::vec(proptest::array::uniform3(0..n as u32), 1..60),
    ) -> TriangleMesh {
        TriangleMesh { vertices, triangles }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_soup_and_any_bones_give_weights_or_a_named_error(
        mesh in soup(),
        ends in proptest::collection::vec(([coordinate(), coordinate(), coordinate()], [coordinate(), coordinate(), coordinate()]), 1..6),
    ) {
        let bones: Vec<BoneSegment> = ends.into_iter().map(|(head, tail)| bone(head, tail)).collect();
        match bone_heat(&mesh, &bones, &BoneHeatSettings::default(), &mut |_, _| ControlFlow::Continue(())) {
            Ok(heat) => {
                prop_assert!(heat.weights.to_columns().unwrap().iter().all(|w| (0.0..=1.0).contains(w)));
                for vertex in 0..mesh.vertices.len() {
                    prop_assert!((heat.weights.vertex(vertex).sum::<f64>() - 1.0).abs() < 1e-9);
                }
            }
            Err(BoneHeatError::BoneOutOfReach { .. }) => {}
            Err(error) => prop_assert!(false, "{error}"),
        }
    }
}
