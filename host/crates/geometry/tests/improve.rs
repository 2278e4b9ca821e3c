//! Sliver removal and smoothing: what must hold afterwards on all kinds of meshes, and how much better they become.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;
#[path = "support/volume.rs"]
mod volume;

use std::collections::BTreeSet;
use std::ops::ControlFlow;

use armature_geometry::delaunay::delaunay_tetrahedra;
use armature_geometry::improve::{
    BoundaryGive, ImproveError, ImproveOutcome, ImproveSettings, Improvement, dihedral_angles, improve_tetrahedra,
    improve_with_boundary,
};
use armature_geometry::{MeshError, TetrahedralMesh};
use proptest::prelude::*;
use robust::{Coord3D, orient3d};
use volume::volume_of;

const FACETS: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

fn improve(mesh: &mut TetrahedralMesh, fixed: &[bool], locked: &[[u32; 3]]) -> Result<Improvement, ImproveError> {
    improve_tetrahedra(mesh, fixed, locked, &ImproveSettings::default(), &mut |_, _| ControlFlow::Continue(()))
}

fn free(mesh: &TetrahedralMesh) -> Vec<bool> {
    vec![false; mesh.vertices.len()]
}

fn facets(mesh: &TetrahedralMesh) -> impl Iterator<Item = [u32; 3]> {
    mesh.tetrahedra.iter().flat_map(|t| FACETS.map(|f| f.map(|k| t[k])))
}

/// Facets without a partner, each turned to its smallest corner.
fn boundary(mesh: &TetrahedralMesh) -> BTreeSet<[u32; 3]> {
    let mut all: Vec<[u32; 3]> = facets(mesh).map(turned).collect();
    all.sort_unstable();
    assert!(all.windows(2).all(|two| two[0] != two[1]), "two tetrahedra on the same side of a facet");
    all.iter().filter(|[a, b, c]| all.binary_search(&turned([*a, *c, *b])).is_err()).copied().collect()
}

fn turned([a, b, c]: [u32; 3]) -> [u32; 3] {
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap()
}

/// Sum of the volumes times six, with compensated rounding (Neumaier).
fn six_volumes(mesh: &TetrahedralMesh) -> f64 {
    let (mut sum, mut lost) = (0.0_f64, 0.0);
    for t in &mesh.tetrahedra {
        let [a, b, c, d] = t.map(|v| glam::DVec3::from(mesh.vertices[v as usize]));
        let volume = (b - a).dot((c - a).cross(d - a));
        let next = sum + volume;
        lost += if sum.abs() >= volume.abs() { (sum - next) + volume } else { (volume - next) + sum };
        sum = next;
    }
    sum + lost
}

/// Everything that must hold for any mesh.
fn check(before: &TetrahedralMesh, fixed: &[bool], locked: &[[u32; 3]]) -> (TetrahedralMesh, Improvement) {
    let mut after = before.clone();
    let improvement = improve(&mut after, fixed, locked).unwrap();
    for t in &after.tetrahedra {
        let [a, b, c, d] = t.map(|v| {
            let [x, y, z] = after.vertices[v as usize];
            Coord3D { x, y, z }
        });
        // The predicate's orientation is the opposite of ours.
        assert!(orient3d(a, b, c, d) < 0.0, "{t:?} is flat or inside out");
    }
    let (was, is) = (six_volumes(before), six_volumes(&after));
    assert!((was - is).abs() <= 1e-12 * was, "volume {was} became {is}");
    let outside = boundary(before);
    assert_eq!(outside, boundary(&after));
    let stay: BTreeSet<u32> = outside.iter().chain(locked).flatten().copied().collect();
    let added = before.vertices.len()..after.vertices.len();
    assert_eq!(added.len(), improvement.vertices_added);
    for (v, (was, is)) in before.vertices.iter().zip(&after.vertices).enumerate() {
        let may_move = !fixed[v] && !stay.contains(&(v as u32));
        assert!(may_move || was.map(f64::to_bits) == is.map(f64::to_bits), "vertex {v} moved");
    }
    let used: BTreeSet<u32> = after.tetrahedra.iter().flatten().copied().collect();
    let candidates = before.tetrahedra.iter().flatten().copied().chain(added.map(|v| v as u32));
    let unused: BTreeSet<u32> = candidates.filter(|v| !used.contains(v)).collect();
    assert_eq!(improvement.vertices_unreferenced, unused.iter().copied().collect::<Vec<u32>>());
    assert!(unused.iter().all(|v| !stay.contains(v) && fixed.get(*v as usize) != Some(&true)));
    let sorted = |mut f: [u32; 3]| {
        f.sort_unstable();
        f
    };
    if !locked.is_empty() {
        let all: BTreeSet<[u32; 3]> = facets(&after).map(sorted).collect();
        assert!(locked.iter().all(|&f| all.contains(&sorted(f))));
    }
    assert_eq!(improvement.before, dihedral_angles(before).unwrap());
    assert_eq!(improvement.after, dihedral_angles(&after).unwrap());
    let small = |histogram: [usize; 180]| histogram[..5].iter().sum::<usize>();
    assert!(small(improvement.after.histogram) <= small(improvement.before.histogram));
    assert_eq!(improvement.outcome == ImproveOutcome::Reached, improvement.bad_after == 0);
    (after, improvement)
}

/// Every `step`-th interior facet.
fn some_inner_facets(mesh: &TetrahedralMesh, step: usize) -> Vec<[u32; 3]> {
    let outside = boundary(mesh);
    facets(mesh).step_by(step).filter(|&f| !outside.contains(&turned(f))).collect()
}

#[test]
fn volumes_of_models_lose_their_slivers() {
    for (name, interior) in [("spot.obj", 1000), ("elephant.obj", 2000), ("armadillo.obj", 20_000)] {
        let Some(surface) = support::shared_triangles(name) else { continue };
        let mesh = volume_of(&surface, interior);
        let (_, improvement) = check(&mesh, &free(&mesh), &[]);
        let share = |share: f64| 100.0 * share;
        let (before, after) = (&improvement.before, &improvement.after);
        println!(
            "{name}: {} tetrahedra, {:.3} % below 5°, now {:.4} %, smallest {:.2}°, {:?}",
            mesh.tetrahedra.len(),
            share(before.share_below(5)),
            share(after.share_below(5)),
            after.smallest.to_degrees(),
            improvement.outcome
        );
        assert!(before.share_below(5) > 0.003 && after.share_below(5) < 1e-5);
        assert!(improvement.bad_after * 200 < improvement.bad_before);
        assert!(improvement.operations.edge_removals > 100 && improvement.operations.facet_removals > 10);
    }
}

#[test]
fn finished_tetrahedral_meshes_become_no_worse() {
    for name in ["hand.mesh", "octopus-low.mesh"] {
        let Some(mesh) = support::shared_tetrahedra(name) else { continue };
        let (_, improvement) = check(&mesh, &free(&mesh), &[]);
        println!(
            "{name}: smallest {:.2}° then {:.2}°, bad {} then {}, {:?}",
            improvement.before.smallest.to_degrees(),
            improvement.after.smallest.to_degrees(),
            improvement.bad_before,
            improvement.bad_after,
            improvement.outcome
        );
        assert!(improvement.bad_after <= improvement.bad_before);
        assert!(improvement.after.smallest >= improvement.before.smallest);
    }
}

#[test]
fn locked_facets_and_fixed_vertices_stay() {
    let mesh = volume_of(&support::sphere(3), 600);
    let locked = some_inner_facets(&mesh, 37);
    let fixed: Vec<bool> = (0..mesh.vertices.len()).map(|v| v % 3 == 0).collect();
    let (_, some) = check(&mesh, &fixed, &locked);
    assert!(some.bad_after < some.bad_before / 2, "{} of {}", some.bad_after, some.bad_before);
    // With every facet locked there is nothing to do, and the outcome says so.
    let (after, nothing) = check(&mesh, &fixed, &some_inner_facets(&mesh, 1));
    assert_eq!((nothing.outcome, nothing.bad_after), (ImproveOutcome::NothingMoreHelps, nothing.bad_before));
    assert_eq!(nothing.bad_without_free_corner, nothing.bad_after);
    assert_eq!(after, mesh);
}

#[test]
fn slivers_of_a_nearly_exact_lattice_vanish() {
    let mut noise = support::noise();
    let points: Vec<[f64; 3]> = (0..12 * 12 * 12)
        .map(|i| [i % 12, i / 12 % 12, i / 144].map(f64::from))
        .map(|p| p.map(|c| if c > 0.0 && c < 11.0 { c + 1e-7 * noise() } else { c }))
        .collect();
    let tetrahedra = delaunay_tetrahedra(&points, &mut |_, _| ControlFlow::Continue(())).unwrap().tetrahedra;
    let mesh = TetrahedralMesh { vertices: points, tetrahedra };
    let (_, improvement) = check(&mesh, &free(&mesh), &[]);
    assert!(improvement.before.smallest < 1e-6 && improvement.before.share_below(5) > 0.01);
    assert_eq!(improvement.outcome, ImproveOutcome::Reached);
    assert!(improvement.after.smallest.to_degrees() >= 11.99);
}

#[test]
fn a_flat_tetrahedron_at_the_boundary_is_reported() {
    let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.4, 0.3, 1e-12]];
    let mesh = TetrahedralMesh { vertices, tetrahedra: vec![[0, 1, 2, 3]] };
    let (after, improvement) = check(&mesh, &[false; 4], &[]);
    assert_eq!(improvement.flat_at_boundary, [0]);
    assert_eq!(improvement.outcome, ImproveOutcome::NothingMoreHelps);
    assert_eq!(after, mesh);
}

#[test]
fn the_same_again_gives_the_same_at_any_scale() {
    let mesh = volume_of(&support::sphere(3), 300);
    let (one, _) = check(&mesh, &free(&mesh), &[]);
    let (two, _) = check(&mesh, &free(&mesh), &[]);
    assert_eq!(one, two);
    for scale in [(2.0_f64).powi(150), (2.0_f64).powi(-150)] {
        let scaled = |mesh: &TetrahedralMesh| TetrahedralMesh {
            vertices: mesh.vertices.iter().map(|p| p.map(|c| c * scale)).collect(),
            tetrahedra: mesh.tetrahedra.clone(),
        };
        let mut far = scaled(&mesh);
        improve(&mut far, &free(&mesh), &[]).unwrap();
        assert_eq!(far, scaled(&one));
    }
}

#[test]
fn cancelling_leaves_the_mesh_as_it_was() {
    let mesh = volume_of(&support::sphere(3), 600);
    let settings = ImproveSettings { smallest_dihedral: 0.6, ..ImproveSettings::default() };
    for stop_at in 0..3 {
        let mut after = mesh.clone();
        let (mut calls, mut last) = (0, 0.0);
        let mut progress = |_: &str, fraction: f64| {
            assert!(fraction >= last && fraction <= 1.0);
            (calls, last) = (calls + 1, fraction);
            if calls > stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let cancelled = improve_tetrahedra(&mut after, &free(&mesh), &[], &settings, &mut progress);
        assert_eq!(cancelled, Err(ImproveError::Cancelled));
        assert_eq!(after, mesh);
    }
}

#[test]
fn hostile_input_gives_errors_that_name_it() {
    let vertices =
        vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0], [0.1, 0.1, -2.0]];
    let refused = |vertices: &[[f64; 3]], tetrahedra: &[[u32; 4]], locked: &[[u32; 3]]| {
        let mut mesh = TetrahedralMesh { vertices: vertices.to_vec(), tetrahedra: tetrahedra.to_vec() };
        let before = format!("{mesh:?}");
        let error = improve(&mut mesh, &vec![false; vertices.len()], locked).unwrap_err();
        assert_eq!(before, format!("{mesh:?}"));
        error
    };
    let good = [0, 1, 2, 3];
    assert_eq!(refused(&[], &[], &[]), MeshError::Empty.into());
    assert_eq!(refused(&vertices, &[], &[]), MeshError::Empty.into());
    assert_eq!(
        refused(&vertices, &[good, [0, 1, 2, 9]], &[]),
        MeshError::IndexOutOfRange { element: 1, vertex: 9, vertex_count: 6 }.into()
    );
    let mut broken = vertices.clone();
    broken[4][1] = f64::NAN;
    assert_eq!(refused(&broken, &[good], &[]), MeshError::NotFinite { vertex: 4 }.into());
    let tiny: Vec<[f64; 3]> = vertices.iter().map(|p| p.map(|c| c * 1e-300)).collect();
    assert_eq!(refused(&tiny, &[good], &[]), ImproveError::TooSmall);
    assert_eq!(refused(&[[0.0; 3]; 4], &[good], &[]), ImproveError::TooSmall);
    assert_eq!(refused(&vertices, &[[1, 0, 2, 3]], &[]), ImproveError::NotPositive { tetrahedron: 0 });
    assert_eq!(refused(&vertices, &[good, [0, 0, 2, 3]], &[]), ImproveError::NotPositive { tetrahedron: 1 });
    assert_eq!(refused(&vertices, &[good, good], &[]), ImproveError::SameSide { facet: [0, 1, 2] });
    assert_eq!(
        refused(&vertices, &[good, [1, 0, 2, 4], [1, 0, 2, 5]], &[]),
        ImproveError::CrowdedFacet { facet: [0, 1, 2], tetrahedra: 3 }
    );
    for facet in [[0, 1, 4], [7, 8, 9], [0, 0, 1], [u32::MAX; 3]] {
        assert_eq!(
            refused(&vertices, &[good], &[[2, 1, 0], facet]),
            ImproveError::LockedFacetMissing { index: 1, facet }
        );
    }
    let mut mesh = TetrahedralMesh { vertices, tetrahedra: vec![good] };
    assert_eq!(improve(&mut mesh, &[true], &[]), Err(ImproveError::FixedLength { given: 1, vertices: 6 }));
    for radians in [0.0, -1.0, 2.0, f64::NAN, f64::INFINITY] {
        let settings = ImproveSettings { smallest_dihedral: radians, ..ImproveSettings::default() };
        let error = improve_tetrahedra(&mut mesh, &[false; 6], &[], &settings, &mut |_, _| ControlFlow::Continue(()));
        assert!(matches!(error, Err(ImproveError::BadGoal { .. })));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn random_points_on_and_off_lattices(
        points in prop::collection::vec([0..6_i32, 0..6_i32, 0..6_i32], 8..160),
        jitter in prop::sample::select(vec![0.0, 1e-12, 1e-4, 0.3]),
        step in 1..60_usize,
        fixed_every in 1..9_usize,
    ) {
        let mut noise = support::noise();
        let vertices: Vec<[f64; 3]> =
            points.iter().map(|p| p.map(|c| f64::from(c) + jitter * noise())).collect();
        if let Ok(delaunay) = delaunay_tetrahedra(&vertices, &mut |_, _| ControlFlow::Continue(())) {
            let mesh = TetrahedralMesh { vertices, tetrahedra: delaunay.tetrahedra };
            let locked = some_inner_facets(&mesh, step);
            let fixed: Vec<bool> = (0..mesh.vertices.len()).map(|v| v % fixed_every == 1).collect();
            check(&mesh, &fixed, &locked);
        }
    }

    /// Any subset of positive tetrahedra: facets, edges and vertices meet in every possible way, and may overlap.
    #[test]
    fn tetrahedra_at_random_are_improved_or_refused(
        points in prop::collection::vec([-4..5_i32, -4..5_i32, -4..5_i32], 5..14),
        corners in prop::collection::vec([0..14_u32, 0..14_u32, 0..14_u32, 0..14_u32], 1..40),
    ) {
        let vertices: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let tetrahedra = corners.iter().map(|t| t.map(|v| v % vertices.len() as u32)).collect();
        let mut mesh = TetrahedralMesh { vertices, tetrahedra };
        let upright = |t: &[u32; 4]| {
            let [a, b, c, d] = t.map(|v| glam::DVec3::from(mesh.vertices[v as usize]));
            (b - a).dot((c - a).cross(d - a)) > 0.0
        };
        let mut sides = BTreeSet::new();
        let kept: Vec<[u32; 4]> = mesh.tetrahedra.iter().filter(|t| upright(t)).filter(|t| {
            let own = FACETS.map(|f| turned(f.map(|k| t[k])));
            let new = own.iter().all(|f| !sides.contains(f));
            if new {
                sides.extend(own);
            }
            new
        }).copied().collect();
        mesh.tetrahedra = kept;
        if !mesh.tetrahedra.is_empty() {
            let before = mesh.clone();
            match improve(&mut mesh, &free(&before), &[]) {
                Ok(_) => { check(&before, &free(&before), &[]); }
                Err(error) => {
                    prop_assert_eq!(error, ImproveError::Overlapping);
                    prop_assert_eq!(mesh, before);
                }
            }
        }
    }
}

/// A box of tetrahedra whose uppermost layer is next to nothing in the middle.
fn with_bad_boundary() -> TetrahedralMesh {
    let mut mesh = support::box_of_tetrahedra(5, 0.0);
    let mut noise = support::noise();
    for place in mesh.vertices.iter_mut().filter(|p| p[2] > 0.99 && p[0] > 0.01 && p[0] < 0.99) {
        place[2] = 0.803 + 0.002 * noise();
    }
    let at = |v: u32| glam::DVec3::from(mesh.vertices[v as usize]);
    for t in &mut mesh.tetrahedra {
        let [a, b, c, d] = t.map(at);
        if (b - a).dot((c - a).cross(d - a)) < 0.0 {
            t.swap(0, 1);
        }
    }
    mesh
}

fn give_way(mesh: &mut TetrahedralMesh, fixed: &[bool], far: f64) -> Result<Improvement, ImproveError> {
    let (recede, bulge) = (vec![far; mesh.vertices.len()], vec![0.0; mesh.vertices.len()]);
    let give = BoundaryGive { recede: &recede, bulge: &bulge };
    improve_with_boundary(mesh, fixed, &give, &ImproveSettings::default(), &mut |_, _| ControlFlow::Continue(()))
}

#[test]
fn a_boundary_that_gives_way_leaves_no_slivers() {
    let before = with_bad_boundary();
    let mut stays = before.clone();
    improve(&mut stays, &free(&before), &[]).unwrap();
    let stuck = dihedral_angles(&stays).unwrap();
    assert!(stuck.share_below(5) > 0.0, "the boundary alone has to cause slivers");
    let mut gives = before.clone();
    let done = give_way(&mut gives, &free(&before), 0.02).unwrap();
    let after = dihedral_angles(&gives).unwrap();
    assert!(after.smallest.to_degrees() > 5.0, "{} {done:?}", after.smallest.to_degrees());
    assert!(done.operations.dropped + done.operations.boundary_contractions + done.operations.boundary_smoothings > 0);
    // It receded, by less than it may: no more than that off all of the surface.
    let (was, is) = (six_volumes(&before), six_volumes(&gives));
    assert!(is <= was && is > was - 6.0 * 6.0 * 0.02, "{is} of {was}");
    boundary(&gives);
    for &[lost, place] in &done.vertices_merged {
        assert!(!gives.tetrahedra.iter().flatten().any(|&v| v == lost));
        assert!(gives.tetrahedra.iter().flatten().any(|&v| v == place));
    }
}

#[test]
fn what_may_not_give_way_stays() {
    let before = with_bad_boundary();
    // Nothing may give way: as with a boundary that stays.
    let mut stays = before.clone();
    give_way(&mut stays, &free(&before), 0.0).unwrap();
    assert!((six_volumes(&stays) - six_volumes(&before)).abs() < 1e-9);
    let on_boundary: BTreeSet<u32> = boundary(&before).into_iter().flatten().collect();
    let fixed: Vec<bool> = (0..before.vertices.len() as u32).map(|v| on_boundary.contains(&v)).collect();
    let mut fixed_too = before.clone();
    give_way(&mut fixed_too, &fixed, 0.02).unwrap();
    for &v in &on_boundary {
        let [was, is] = [&before, &fixed_too].map(|mesh| mesh.vertices[v as usize].map(f64::to_bits));
        assert_eq!(was, is);
        assert!(fixed_too.tetrahedra.iter().flatten().any(|&u| u == v), "vertex {v} is gone");
    }
    let give = BoundaryGive { recede: &[0.1], bulge: &[] };
    let settings = ImproveSettings::default();
    let error = improve_with_boundary(&mut before.clone(), &free(&before), &give, &settings, &mut |_, _| {
        ControlFlow::Continue(())
    });
    assert!(matches!(error, Err(ImproveError::GiveLength { given: 1, .. })));
}
