//! Bounded biharmonic weights for handles of all kinds on the worst meshes and handles, and properties that hold
//! wherever handles lie.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::operators::{
    Lumping, SparseMatrix, cotangent_laplacian, cotangent_laplacian_tetrahedra, lumped_mass, lumped_mass_tetrahedra,
};
use armature_geometry::{TetrahedralMesh, TriangleMesh};
use armature_weights::WeightMatrix;
use armature_weights::biharmonic::{
    BiharmonicError, BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings, BiharmonicWeights,
    ExactPartitionSettings, bounded_biharmonic_weights, exact_partition_weights,
};
use armature_weights::finish::{follow_nearest_handle, normalise};
use armature_weights::handles::{CageFacet, Handle, HandleBoundary, HandleError, HandleKind, handle_boundary};
use proptest::prelude::*;
use support::block;

/// A mesh's operators and its fixed weights.
struct Setup {
    vertices: Vec<[f64; 3]>,
    laplacian: SparseMatrix,
    mass: Vec<f64>,
    boundary: HandleBoundary,
}

impl Setup {
    fn solid(mesh: &TetrahedralMesh, handles: &[Handle]) -> Self {
        Self {
            vertices: mesh.vertices.clone(),
            laplacian: cotangent_laplacian_tetrahedra(mesh).unwrap().matrix,
            mass: lumped_mass_tetrahedra(mesh, Lumping::Barycentric).unwrap(),
            boundary: handle_boundary(&mesh.vertices, handles, &[]).unwrap(),
        }
    }

    fn problem(&self) -> BiharmonicProblem<'_> {
        BiharmonicProblem {
            laplacian: &self.laplacian,
            mass: &self.mass,
            fixed: &self.boundary.fixed,
            fixed_weights: &self.boundary.fixed_weights,
            handles: self.boundary.handles,
            shape_preservation: None,
        }
    }

    /// Certified weights, after checking what must hold for any.
    fn solve(&self) -> BiharmonicWeights {
        let settings = BiharmonicSettings::certified();
        let solved =
            bounded_biharmonic_weights(&self.problem(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
        for (handle, report) in solved.reports.iter().enumerate() {
            assert_eq!(report.outcome, BiharmonicOutcome::Converged, "{report:?}");
            assert!(report.error_bound <= settings.error_bound && report.gap >= -1e-12 * report.energy, "{report:?}");
            assert!(solved.weights.column(handle).all(|(_, weight)| (0.0..=1.0).contains(&weight)));
        }
        self.assert_interpolated(&solved.weights);
        solved
    }

    fn assert_interpolated(&self, weights: &WeightMatrix) {
        let count = self.boundary.fixed.len();
        for (k, given) in self.boundary.fixed_weights.iter().enumerate() {
            assert!((weights.weight(self.boundary.fixed[k % count], k / count) - given).abs() == 0.0);
        }
    }
}

fn own(vertices: &[usize]) -> Handle {
    Handle { kind: HandleKind::Own, vertices: vertices.to_vec() }
}

fn bone(vertices: &[usize]) -> Handle {
    Handle { kind: HandleKind::Bone, vertices: vertices.to_vec() }
}

fn largest_difference(a: &WeightMatrix, b: &WeightMatrix) -> f64 {
    let pairs = |bone: usize| a.bone(bone).into_iter().zip(b.bone(bone));
    (0..a.bones()).flat_map(pairs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn assert_sums_to_one(weights: &WeightMatrix) {
    for vertex in 0..weights.vertices() {
        let sum: f64 = weights.vertex(vertex).sum();
        assert!((sum - 1.0).abs() < 1e-12, "{sum} at {vertex}");
    }
}

const CELLS: [usize; 3] = [6, 4, 3];

fn number([x, y, z]: [usize; 3]) -> usize {
    x + (CELLS[0] + 1) * (y + (CELLS[1] + 1) * z)
}

fn plain_block() -> TetrahedralMesh {
    block(CELLS, |p| p)
}

fn two_points_and_a_bone() -> [Handle; 3] {
    [own(&[number([1, 2, 1])]), own(&[number([5, 2, 2])]), bone(&[number([3, 0, 0]), number([3, 1, 0])])]
}

/// Least mass over the largest mass.
fn mass_ratio(setup: &Setup) -> f64 {
    let (least, most) = setup.mass.iter().fold((f64::INFINITY, 0.0_f64), |(l, m), &mass| (l.min(mass), m.max(mass)));
    least / most
}

/// How far weights on the block's own vertices are from those without the addition.
fn difference_to_plain(setup: &Setup) -> f64 {
    let plain = Setup::solid(&plain_block(), &two_points_and_a_bone()).solve().weights;
    let solved = setup.solve().weights;
    let pairs = |handle: usize| plain.bone(handle).into_iter().zip(solved.bone(handle));
    (0..3).flat_map(pairs).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The block with flat tetrahedra on a few facets of its face z = 0; the tips are this high above the middle.
fn with_flat_tetrahedra(height: f64) -> TetrahedralMesh {
    let mut mesh = plain_block();
    for (x, y) in [(0, 0), (2, 1), (4, 3), (2, 2)] {
        let corners = [[x, y, 0], [x + 1, y + 1, 0], [x + 1, y, 0]].map(number);
        let middle: [f64; 3] = std::array::from_fn(|k| corners.iter().map(|&v| mesh.vertices[v][k]).sum::<f64>() / 3.0);
        mesh.tetrahedra.push([corners[0], corners[1], corners[2], mesh.vertices.len()].map(|v| v as u32));
        mesh.vertices.push([middle[0], middle[1], middle[2] - height]);
    }
    mesh
}

#[test]
fn slivers_change_nothing_beside_them() {
    let setup = Setup::solid(&with_flat_tetrahedra(1e-3), &two_points_and_a_bone());
    assert!(mass_ratio(&setup) < 1e-3);
    let difference = difference_to_plain(&setup);
    assert!(difference < 1e-3, "{difference}");
}

#[test]
fn slivers_too_flat_for_the_energy_are_named() {
    let setup = Setup::solid(&with_flat_tetrahedra(4e-8), &two_points_and_a_bone());
    let settings = BiharmonicSettings::certified();
    let refused = bounded_biharmonic_weights(&setup.problem(), &settings, &mut |_, _| ControlFlow::Continue(()));
    let told = refused.unwrap_err();
    assert!(matches!(told, BiharmonicError::Factorisation(_)), "{told:?}");
    assert!(told.to_string().contains("degenerate elements"), "{told}");
}

#[test]
fn what_is_a_thousand_times_smaller_follows_what_it_hangs_on() {
    let mut mesh = plain_block();
    let (joint, first) = (number([6, 4, 3]), mesh.vertices.len());
    let speck = block([2, 2, 2], |p| std::array::from_fn(|k| mesh.vertices[joint][k] + 1e-3 * p[k]));
    let renumber = |v: u32| if v == 0 { joint as u32 } else { v - 1 + first as u32 };
    mesh.tetrahedra.extend(speck.tetrahedra.iter().map(|corners| corners.map(renumber)));
    mesh.vertices.extend(&speck.vertices[1..]);
    let setup = Setup::solid(&mesh, &two_points_and_a_bone());
    assert!(mass_ratio(&setup) < 1e-9, "{}", mass_ratio(&setup));
    let difference = difference_to_plain(&setup);
    assert!(difference < 1e-4, "{difference}");
    let weights = setup.solve().weights;
    for handle in 0..3 {
        let there = weights.weight(joint, handle);
        let farthest = (first..mesh.vertices.len()).map(|v| (weights.weight(v, handle) - there).abs());
        assert!(farthest.fold(0.0, f64::max) < 1e-2, "{there}");
    }
}

/// A bone of a prop that the mesh does not hold: its vertices are in no element, and nothing hangs on them.
#[test]
fn a_handle_away_from_the_mesh_weighs_nothing_on_it() {
    let mut mesh = block([4, 3, 3], |p| p);
    let [near, far] = [mesh.vertices.len(), mesh.vertices.len() + 1];
    mesh.vertices.extend([[9.0, 1.0, 1.0], [12.0, 1.0, 1.0]]);
    let held = |vertices: Vec<usize>| Handle { kind: HandleKind::Bone, vertices };
    // One bone from within the mesh to the prop, one of the prop alone.
    let handles = [held(vec![0, 1]), held(vec![4, near]), held(vec![near, far])];
    let mut setup = Setup::solid(&mesh, &handles);
    let solved = setup.solve();
    assert_eq!(solved.weights.column(2).collect::<Vec<_>>(), [(near, 0.5), (far, 1.0)]);
    assert_eq!((solved.reports[2].energy, solved.reports[2].error_bound), (0.0, 0.0));
    assert!(solved.unreached.is_empty());
    // The others are as without it.
    setup.boundary = handle_boundary(&mesh.vertices, &handles[..2], &[]).unwrap();
    let without = setup.solve();
    for handle in 0..2 {
        let inside = |solved: &BiharmonicWeights| solved.weights.bone(handle)[..near].to_vec();
        assert_eq!(inside(&solved), inside(&without));
    }
    let exact = exact_partition_weights(
        &Setup::solid(&mesh, &handles).problem(),
        &ExactPartitionSettings::default(),
        &mut |_, _| ControlFlow::Continue(()),
    );
    // Together they sum to one, whatever becomes of the one that nothing holds.
    let exact = exact.unwrap().weights;
    let mut sums = vec![0.0; near];
    for handle in 0..3 {
        exact.column(handle).filter(|(vertex, _)| *vertex < near).for_each(|(vertex, weight)| sums[vertex] += weight);
    }
    assert!(sums.iter().all(|sum| (sum - 1.0_f64).abs() < 1e-9), "{sums:?}");
}

#[test]
fn a_bone_of_zero_length_is_a_point() {
    let at = number([2, 2, 1]);
    let others = [bone(&[number([5, 1, 1]), number([5, 2, 1])]), own(&[number([0, 4, 3])])];
    let with = |first: Handle| Setup::solid(&plain_block(), &[&[first], &others[..]].concat()).solve();
    assert_eq!(with(bone(&[at])), with(own(&[at])));
    assert_eq!(with(bone(&[at, at])), with(own(&[at])), "held twice");
}

#[test]
fn handles_at_one_place_share_it_or_are_named() {
    let place = [number([2, 2, 1]), number([3, 2, 1])];
    let other = bone(&[number([6, 0, 0]), number([6, 1, 0])]);
    let setup = Setup::solid(&plain_block(), &[bone(&place), bone(&place), other.clone()]);
    let mut weights = setup.solve().weights;
    assert_eq!(weights.bone(0), weights.bone(1));
    normalise(&mut weights);
    assert_sums_to_one(&weights);
    // Together they are what one would be.
    let mut alone = Setup::solid(&plain_block(), &[bone(&place), other]).solve().weights;
    normalise(&mut alone);
    assert!((weights.weight(place[0], 0), weights.weight(place[0], 1)) == (0.5, 0.5));
    assert!((alone.weight(place[0], 0) - 1.0).abs() == 0.0);
    let points = [own(&place[..1]), own(&place[..1])];
    let named = handle_boundary(&setup.vertices, &points, &[]);
    assert_eq!(named, Err(HandleError::TwoHandles { vertex: place[0], first: 0, second: 1 }));
}

#[test]
fn a_handle_moves_only_the_piece_it_lies_in() {
    let mut mesh = plain_block();
    let away = mesh.vertices.len();
    let second = block([2, 2, 2], |p| p.map(|x| x + 20.0));
    mesh.tetrahedra.extend(second.tetrahedra.iter().map(|corners| corners.map(|v| v + away as u32)));
    mesh.vertices.extend(second.vertices);
    let third = mesh.vertices.len();
    mesh.vertices.push([21.0, 40.0, 20.0]);
    let setup = Setup::solid(&mesh, &[own(&[number([1, 1, 1])]), own(&[away + 13]), own(&[number([5, 4, 3])])]);
    let mut solved = setup.solve();
    assert!(solved.weights.column(1).all(|(vertex, _)| vertex >= away));
    assert!(solved.weights.column(0).all(|(vertex, _)| vertex < away));
    assert!((away..third).all(|vertex| solved.weights.weight(vertex, 1) > 1.0 - 1e-4), "no other handle holds it");
    assert_eq!(solved.unreached, [vec![third]]);
    let followed = follow_nearest_handle(&mut solved.weights, &solved.unreached, &setup.boundary, &setup.vertices);
    assert_eq!(followed, [1]);
    let report = normalise(&mut solved.weights);
    assert!(report.unweighted.is_empty());
    assert_sums_to_one(&solved.weights);
}

/// A square of triangles inside a closed cage, with two points in it.
fn caged_square() -> Setup {
    const SIDE: usize = 12;
    let at = |x: usize, y: usize| x + (SIDE + 1) * y;
    let vertices: Vec<[f64; 3]> = (0..=SIDE)
        .flat_map(|y| (0..=SIDE).map(move |x| [x as f64 / SIDE as f64, y as f64 / SIDE as f64, 0.0]))
        .collect();
    let cell = |k: usize| {
        let (x, y) = (k % SIDE, k / SIDE);
        let [a, b, c, d] = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)].map(|v| v as u32);
        [[a, b, c], [a, c, d]]
    };
    let mesh = TriangleMesh { triangles: (0..SIDE * SIDE).flat_map(cell).collect(), vertices };
    let corners = [at(1, 1), at(11, 1), at(11, 11), at(1, 11)];
    let points = [at(4, 6), at(8, 5)];
    let handles: Vec<Handle> = corners.iter().chain(&points).map(|&vertex| own(&[vertex])).collect();
    let side = |k: usize| {
        let along = |t: usize| match k {
            0 => at(t, 1),
            1 => at(11, t),
            2 => at(t, 11),
            _ => at(1, t),
        };
        CageFacet { corners: vec![k, (k + 1) % 4], vertices: (1..=11).map(along).collect() }
    };
    let facets: Vec<CageFacet> = (0..4).map(side).collect();
    Setup {
        laplacian: cotangent_laplacian(&mesh).unwrap().matrix,
        mass: lumped_mass(&mesh, Lumping::Barycentric).unwrap(),
        boundary: handle_boundary(&mesh.vertices, &handles, &facets).unwrap(),
        vertices: mesh.vertices,
    }
}

#[test]
fn a_flat_shape_takes_points_and_a_closed_cage() {
    let setup = caged_square();
    let solved = setup.solve();
    let along_side = |t: usize| solved.weights.weight(13 + t, 0);
    for t in 1..=11 {
        assert!((along_side(t) - (11 - t) as f64 / 10.0).abs() < 1e-12, "linear on the cage");
    }
    let mut normalised = solved.weights.clone();
    let report = normalise(&mut normalised);
    assert_sums_to_one(&normalised);
    assert!(report.unweighted.is_empty() && report.largest_deviation < 0.5, "{report:?}");
    let settings = ExactPartitionSettings { error_bound: 1e-3, max_steps: 40_000 };
    let exact = exact_partition_weights(&setup.problem(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    assert_eq!(exact.report.outcome, BiharmonicOutcome::Converged, "{:?}", exact.report);
    setup.assert_interpolated(&exact.weights);
    assert_sums_to_one(&exact.weights);
    let least: f64 = solved.reports.iter().map(|report| report.energy - report.gap).sum();
    assert!(exact.report.energy >= least, "a constraint more costs energy");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// `solve` checks bounds, interpolation and convergence.
    #[test]
    fn wherever_handles_lie(
        places in prop::collection::btree_set(0_usize..140, 2..12),
        kinds in prop::collection::vec(any::<bool>(), 12),
        scale in -3.0_f64..3.0,
        turn in 0.0_f64..6.3,
    ) {
        let mesh = plain_block();
        let mut handles: Vec<Handle> = Vec::new();
        for (&place, &joins) in places.iter().zip(&kinds) {
            match handles.last_mut() {
                Some(last) if joins => last.vertices.push(place),
                _ => handles.push(own(&[place])),
            }
        }
        let mut solved = Setup::solid(&mesh, &handles).solve();
        let scale = 10.0_f64.powf(scale);
        let mut moved = mesh.clone();
        for [x, y, z] in &mut moved.vertices {
            let (c, s) = (turn.cos(), turn.sin());
            (*x, *y, *z) = (scale * (c * *x - s * *y) + 5.0 * scale, scale * *z, scale * (s * *x + c * *y));
        }
        // A mirrored mesh would be inside out.
        moved.tetrahedra.iter_mut().for_each(|corners| corners.swap(0, 1));
        let again = Setup::solid(&moved, &handles).solve();
        let allowed: f64 = 2.0 * BiharmonicSettings::certified().error_bound;
        prop_assert!(largest_difference(&solved.weights, &again.weights) <= allowed);
        normalise(&mut solved.weights);
        assert_sums_to_one(&solved.weights);
        // What one handle holds no other can move.
        for (handle, held) in handles.iter().enumerate() {
            for other in (0..handles.len()).filter(|&other| other != handle) {
                prop_assert!(held.vertices.iter().all(|&vertex| solved.weights.weight(vertex, other) == 0.0));
            }
        }
    }
}
