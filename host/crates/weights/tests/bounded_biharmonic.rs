//! Bounded biharmonic weights against libigl and the analytic spline, and under changes that must not affect them.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::TetrahedralMesh;
use armature_geometry::operators::{Lumping, SparseMatrix, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_test_support::{read_npy, read_npy_indices, shared};
use armature_weights::biharmonic::{
    BiharmonicError, BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings, BiharmonicWeights, ExactPartition,
    ExactPartitionSettings, bounded_biharmonic_weights, exact_partition_weights,
};
use armature_weights::finish::normalise;
use support::read_mesh;

/// A mesh's operators and its fixed weights.
struct Setup {
    laplacian: SparseMatrix,
    mass: Vec<f64>,
    fixed: Vec<usize>,
    given: Vec<f64>,
    handles: usize,
}

impl Setup {
    fn new(mesh: &TetrahedralMesh, fixed: Vec<usize>, given: Vec<f64>, handles: usize) -> Self {
        let laplacian = cotangent_laplacian_tetrahedra(mesh).unwrap().matrix;
        let mass = lumped_mass_tetrahedra(mesh, Lumping::Barycentric).unwrap();
        Self { laplacian, mass, fixed, given, handles }
    }

    fn problem(&self) -> BiharmonicProblem<'_> {
        BiharmonicProblem {
            laplacian: &self.laplacian,
            mass: &self.mass,
            fixed: &self.fixed,
            fixed_weights: &self.given,
            handles: self.handles,
            shape_preservation: None,
        }
    }

    fn solve(&self, settings: &BiharmonicSettings) -> BiharmonicWeights {
        bounded_biharmonic_weights(&self.problem(), settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
    }

    fn error(&self) -> BiharmonicError {
        let settings = BiharmonicSettings::certified();
        bounded_biharmonic_weights(&self.problem(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap_err()
    }

    /// `½ wᵀ L M⁻¹ L w` of all columns.
    fn energy(&self, weights: &[f64]) -> f64 {
        let one = |column: &[f64]| {
            let curvature = self.laplacian.multiply(column);
            0.5 * curvature.iter().zip(&self.mass).map(|(c, m)| c * c / m).sum::<f64>()
        };
        weights.chunks(self.mass.len()).map(one).sum()
    }
}

fn hand() -> Option<(Setup, Vec<f64>)> {
    let mesh = read_mesh(&shared("hand.mesh")?);
    let fixed = read_npy_indices(&shared("../reference/hand-bbw-b.npy")?);
    let given = read_npy(&shared("../reference/hand-bbw-bc.npy")?);
    let reference = read_npy(&shared("../reference/hand-bbw-w.npy")?);
    Some((Setup::new(&mesh, fixed, given.values, given.columns), reference.values))
}

/// A bar of `cells` cubes of edge length `1 / cells` from x = 0 to x = 1, six tetrahedra each.
fn bar(cells: usize) -> TetrahedralMesh {
    let h = 1.0 / cells as f64;
    let mut mesh = TetrahedralMesh::default();
    for x in 0..=cells {
        for corner in 0..4 {
            mesh.vertices.push([x as f64 * h, (corner % 2) as f64 * h, (corner / 2) as f64 * h]);
        }
    }
    for x in 0..cells {
        let at = |dx: usize, dy: usize, dz: usize| (4 * (x + dx) + dy + 2 * dz) as u32;
        let (first, last) = (at(0, 0, 0), at(1, 1, 1));
        let ring = [at(1, 0, 0), at(1, 1, 0), at(0, 1, 0), at(0, 1, 1), at(0, 0, 1), at(1, 0, 1)];
        mesh.tetrahedra.extend((0..6).map(|k| [first, last, ring[k], ring[(k + 1) % 6]]));
    }
    mesh
}

/// Three handles that hold the bar's slices at x = 0, 1/4 and 1.
fn held_bar(cells: usize) -> Setup {
    let slices = [0, cells / 4, cells];
    let fixed: Vec<usize> = slices.iter().flat_map(|slice| 4 * slice..4 * slice + 4).collect();
    let given = (0..3).flat_map(|handle| (0..12).map(move |k| f64::from(u8::from(k / 4 == handle)))).collect();
    Setup::new(&bar(cells), fixed, given, 3)
}

#[test]
fn hand_is_certified_and_agrees_with_libigl() {
    let Some((setup, reference)) = hand() else { return };
    let result = setup.solve(&BiharmonicSettings::certified());
    for report in &result.reports {
        assert_eq!(report.outcome, BiharmonicOutcome::Converged);
        assert!(report.error_bound <= 2e-5 && report.gap <= 1e-10 * report.energy, "{report:?}");
        assert!(report.largest_bound_violation == 0.0 && report.largest_wrong_multiplier < 1e-5, "{report:?}");
        assert!(report.stationarity < 1e-5, "{report:?}");
    }
    let energy: f64 = result.reports.iter().map(|report| report.energy).sum();
    let libigl = setup.energy(&reference);
    assert!((libigl - 14470.63).abs() < 0.01, "{libigl}");
    assert!(energy <= libigl * (1.0 + 1e-9), "{energy} is more than libigl's {libigl}");
    assert!((setup.energy(&result.weights.to_columns().unwrap()) / energy - 1.0).abs() < 1e-12);
    let difference = largest_difference(&result.weights.to_columns().unwrap(), &reference);
    assert!(difference <= 1e-4, "{difference}");
    assert!(result.unreached.is_empty());
}

#[test]
fn interactive_weights_keep_their_error_bound() {
    let Some((setup, _)) = hand() else { return };
    let optimal = setup.solve(&BiharmonicSettings { error_bound: 1e-6, ..BiharmonicSettings::certified() });
    let quick = setup.solve(&BiharmonicSettings::interactive());
    for (handle, report) in quick.reports.iter().enumerate() {
        assert_eq!(report.outcome, BiharmonicOutcome::Converged);
        let error = largest_difference(&quick.weights.bone(handle), &optimal.weights.bone(handle));
        assert!(error <= report.error_bound + 1e-6 && report.error_bound <= 2e-3, "{error} {report:?}");
        let lost = report.energy - optimal.reports[handle].energy;
        assert!(lost <= report.gap + 1e-9 && lost >= -1e-9, "{lost} {report:?}");
    }
}

#[test]
fn bar_approaches_clamped_splines() {
    let mut last = f64::INFINITY;
    for cells in [16, 64, 256] {
        let result = held_bar(cells).solve(&BiharmonicSettings::certified());
        let mut worst: f64 = 0.0;
        for slice in 0..=cells {
            let x = slice as f64 / cells as f64;
            for corner in 0..4 {
                for handle in 0..3 {
                    let error = result.weights.weight(4 * slice + corner, handle) - clamped_spline(handle, x);
                    worst = worst.max(error.abs());
                }
            }
        }
        println!("{cells} cells: {worst:.2e}");
        for report in &result.reports {
            assert_eq!(report.outcome, BiharmonicOutcome::Converged, "{cells} cells: {report:?}");
        }
        assert!(worst < 0.5 * last && worst < 0.2, "{cells} cells: {worst} after {last}");
        last = worst;
    }
    assert!(last < 0.02, "{last}");
}

/// Between neighbouring handles the bounded weights of a bar run from one to zero with zero slope at both ends (they
/// can neither rise above one nor fall below zero), and a cubic bends least.
fn clamped_spline(handle: usize, x: f64) -> f64 {
    let fall = |t: f64| 1.0 - t * t * (3.0 - 2.0 * t);
    let (left, right) = (x / 0.25, (x - 0.25) / 0.75);
    match handle {
        0 if x < 0.25 => fall(left),
        1 if x < 0.25 => 1.0 - fall(left),
        1 => fall(right),
        2 if x >= 0.25 => 1.0 - fall(right),
        _ => 0.0,
    }
}

#[test]
fn weights_do_not_leave_their_neighbourhood() {
    let result = held_bar(32).solve(&BiharmonicSettings::certified());
    assert!(result.weights.bone(0)[4 * 9..].iter().all(|w| *w < 1e-5), "beyond the second handle");
    assert!(result.weights.bone(2)[..4 * 7].iter().all(|w| *w < 1e-5), "before the second handle");
}

#[test]
fn motion_and_scale_change_nothing() {
    let mesh = bar(16);
    let setup = held_bar(16);
    let weights = setup.solve(&BiharmonicSettings::certified());
    for scale in [1e-4, 3e5] {
        let mut moved = mesh.clone();
        for [x, y, z] in &mut moved.vertices {
            (*x, *y, *z) = (scale * (0.6 * *x - 0.8 * *y + 3.0), scale * (0.8 * *x + 0.6 * *y), scale * (*z - 7.0));
        }
        let moved =
            Setup::new(&moved, setup.fixed.clone(), setup.given.clone(), 3).solve(&BiharmonicSettings::certified());
        let difference =
            largest_difference(&moved.weights.to_columns().unwrap(), &weights.weights.to_columns().unwrap());
        assert!(difference < 1e-6, "{difference} at {scale}");
    }
}

#[test]
fn threads_change_no_bit() {
    let setup = held_bar(24);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| setup.solve(&BiharmonicSettings::certified()))
    };
    assert_eq!(on(1), on(3));
}

#[test]
fn one_handle_holds_everything() {
    let setup = Setup::new(&bar(8), vec![0], vec![1.0], 1);
    let result = setup.solve(&BiharmonicSettings::certified());
    assert_eq!(result.reports[0].outcome, BiharmonicOutcome::Converged, "{:?}", result.reports);
    assert!(result.weights.to_columns().unwrap().iter().all(|w| (w - 1.0).abs() < 1e-6));
    let all_given = Setup::new(&bar(1), (0..8).collect(), vec![0.5; 8], 1);
    let result = all_given.solve(&BiharmonicSettings::certified());
    assert_eq!(result.weights.to_columns().unwrap(), [0.5; 8]);
    assert_eq!(result.reports[0].outcome, BiharmonicOutcome::Converged, "{:?}", result.reports);
}

#[test]
fn pieces_without_a_handle_are_named() {
    let mut mesh = bar(4);
    let away = mesh.vertices.len();
    let second = bar(2);
    mesh.tetrahedra.extend(second.tetrahedra.iter().map(|corners| corners.map(|v| v + away as u32)));
    mesh.vertices.extend(second.vertices.iter().map(|[x, y, z]| [x + 5.0, *y, *z]));
    mesh.vertices.push([9.0; 3]);
    let setup = Setup::new(&mesh, vec![0, away - 1], vec![1.0, 0.0, 0.0, 1.0], 2);
    let result = setup.solve(&BiharmonicSettings::certified());
    assert_eq!(result.unreached, [(away..away + 12).collect::<Vec<_>>(), vec![away + 12]]);
    assert!(result.weights.bone(0)[away..].iter().all(|w| *w == 0.0));
}

#[test]
fn nonsense_is_named() {
    let good = || held_bar(4);
    let with = |change: &dyn Fn(&mut Setup)| {
        let mut setup = good();
        change(&mut setup);
        setup.error()
    };
    assert!(matches!(with(&|s| s.given[0] = f64::NAN), BiharmonicError::BadFixedWeight { handle: 0, vertex: 0, .. }));
    assert!(matches!(with(&|s| s.given[13] = 1.5), BiharmonicError::BadFixedWeight { handle: 1, vertex: 1, .. }));
    assert_eq!(with(&|s| s.fixed[1] = s.fixed[0]), BiharmonicError::FixedTwice { vertex: 0 });
    assert_eq!(with(&|s| s.fixed[1] = 999), BiharmonicError::NoSuchVertex { vertex: 999, vertices: 20 });
    assert_eq!(with(&|s| s.given[..12].fill(0.0)), BiharmonicError::EmptyHandle { handle: 0 });
    assert!(matches!(with(&|s| s.handles = 2), BiharmonicError::Size { what: "fixed_weights", .. }));
    assert_eq!(with(&|s| s.mass[7] = 0.0), BiharmonicError::BadMass { vertex: 7, mass: 0.0 });
    assert!(matches!(with(&|s| s.mass[7] = f64::NAN), BiharmonicError::BadMass { vertex: 7, .. }));
    assert!(matches!(with(&|s| s.laplacian.values_mut()[3] = f64::NAN), BiharmonicError::BadMatrix { .. }));
    assert!(matches!(with(&|s| s.laplacian.values_mut()[1] *= 2.0), BiharmonicError::BadMatrix { .. }));
    assert!(matches!(with(&|s| s.mass.truncate(3)), BiharmonicError::Size { what: "the Laplacian", .. }));
    assert_eq!(with(&|s| s.fixed.clear()), BiharmonicError::NoHandles);
    let settings = BiharmonicSettings { error_bound: 0.0, ..BiharmonicSettings::certified() };
    let refused = bounded_biharmonic_weights(&good().problem(), &settings, &mut |_, _| ControlFlow::Continue(()));
    assert!(matches!(refused, Err(BiharmonicError::BadSetting { name: "error_bound", .. })));
}

fn exact(setup: &Setup, error_bound: f64) -> ExactPartition {
    let settings = ExactPartitionSettings { error_bound, max_steps: 20_000 };
    exact_partition_weights(&setup.problem(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap()
}

/// With two handles, one's weights are what the other's leave, and both have the same energy, so the coupled problem is
/// the same as that of one handle alone.
#[test]
fn two_handles_sum_to_one_on_their_own() {
    let mut setup = held_bar(16);
    let (first, second) = setup.given.split_at_mut(12);
    first[8..].fill(0.25);
    first.iter().zip(second).for_each(|(a, b)| *b = 1.0 - a);
    setup.given.truncate(24);
    setup.handles = 2;
    let alone = setup.solve(&BiharmonicSettings::certified());
    let exact = exact(&setup, 1e-4);
    assert_eq!(exact.report.outcome, BiharmonicOutcome::Converged, "{:?}", exact.report);
    let difference = largest_difference(&exact.weights.to_columns().unwrap(), &alone.weights.to_columns().unwrap());
    assert!(difference <= exact.report.error_bound + 2e-5, "{difference} {:?}", exact.report);
}

#[test]
fn exact_partitions_cost_least_among_partitions() {
    let setup = held_bar(24);
    let exact = exact(&setup, 1e-3);
    assert_eq!(exact.report.outcome, BiharmonicOutcome::Converged, "{:?}", exact.report);
    assert!(exact.report.largest_sum_error < 1e-12 && exact.weights.to_columns().unwrap().iter().all(|w| *w >= 0.0));
    assert!((setup.energy(&exact.weights.to_columns().unwrap()) / exact.report.energy - 1.0).abs() < 1e-9);
    for (row, vertex) in setup.fixed.iter().enumerate() {
        assert!(exact.weights.vertex(*vertex).eq(setup.given.iter().skip(row).step_by(12).copied()));
    }
    // The handles' separate minima bound the energy from below, any other partition from above.
    let mut alone = setup.solve(&BiharmonicSettings::certified());
    let least: f64 = alone.reports.iter().map(|report| report.energy - report.gap).sum();
    normalise(&mut alone.weights);
    let normalised = setup.energy(&alone.weights.to_columns().unwrap());
    let found = exact.report.energy;
    assert!(least <= found && found - exact.report.gap <= normalised, "{least} {found} {normalised}");
}

#[test]
fn given_weights_that_do_not_sum_to_one_are_named() {
    let mut setup = held_bar(4);
    setup.given[0] = 0.5;
    let settings = ExactPartitionSettings::default();
    let refused = exact_partition_weights(&setup.problem(), &settings, &mut |_, _| ControlFlow::Continue(()));
    assert_eq!(refused.unwrap_err(), BiharmonicError::NoPartition { vertex: 0, sum: 0.5 });
    let setup = held_bar(4);
    let wanted = "solving for all handles together";
    let mut stop = |stage: &'static str, _: f64| match stage {
        stage if stage == wanted => ControlFlow::Break(()),
        _ => ControlFlow::Continue(()),
    };
    let stopped = exact_partition_weights(&setup.problem(), &settings, &mut stop);
    assert_eq!(stopped.unwrap_err(), BiharmonicError::Cancelled { stage: wanted });
}

#[test]
fn stops_when_asked() {
    let setup = held_bar(16);
    // All handles reach far here, so every stage has its turn.
    let (mut seen, mut last) = (Vec::new(), 0.0);
    let mut listen = |stage: &'static str, done: f64| {
        assert!((last..=1.0).contains(&done), "{done} after {last} while {stage}");
        last = done;
        seen.push(stage);
        ControlFlow::Continue(())
    };
    bounded_biharmonic_weights(&setup.problem(), &BiharmonicSettings::certified(), &mut listen).unwrap();
    seen.dedup();
    let stages = [
        "preparing the weights",
        "factorising the energy",
        "solving for the handles, each among the vertices near it",
        "guessing the weights that reach far",
        "refining the weights that reach far",
        "checking the weights",
    ];
    assert_eq!(seen, stages, "no stage comes back");
    for wanted in stages {
        let mut stop = |stage, _: f64| if stage == wanted { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let stopped = bounded_biharmonic_weights(&setup.problem(), &BiharmonicSettings::certified(), &mut stop);
        assert_eq!(stopped, Err(BiharmonicError::Cancelled { stage: wanted }));
    }
    let settings = BiharmonicSettings { max_active_sets: 1, guess_steps: 1, ..BiharmonicSettings::certified() };
    let early = held_bar(64).solve(&settings);
    assert!(
        early.reports.iter().any(|report| report.outcome == BiharmonicOutcome::LimitReached),
        "{:?}",
        early.reports
    );
    assert!(early.weights.to_columns().unwrap().iter().all(|w| (0.0..=1.0).contains(w)));
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
