//! Both weight problems against an interior point method that shares no code with ours: it eliminates nothing, chooses
//! no order and makes no guess.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on has to fail")]

mod support;

use std::ops::ControlFlow;

use armature_geometry::TetrahedralMesh;
use armature_geometry::operators::{Lumping, SparseMatrix, cotangent_laplacian_tetrahedra, lumped_mass_tetrahedra};
use armature_weights::biharmonic::{
    BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings, ExactPartitionSettings, bounded_biharmonic_weights,
    exact_partition_weights,
};
use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus};
use support::block;

/// Cells of a block of cubes along x, y and z.
const CELLS: [usize; 3] = [8, 5, 4];

fn number([x, y, z]: [usize; 3]) -> usize {
    x + (CELLS[0] + 1) * (y + (CELLS[1] + 1) * z)
}

/// A block that gets thinner along x.
fn thinning_block() -> TetrahedralMesh {
    block(CELLS, |[x, y, z]| {
        let thin = 1.0 - 0.08 * x;
        [0.25 * x, 0.2 * thin * y, 0.22 * thin * z]
    })
}

struct Setup {
    laplacian: SparseMatrix,
    mass: Vec<f64>,
    fixed: Vec<usize>,
    given: Vec<f64>,
    handles: usize,
}

impl Setup {
    /// A bone of four vertices, two points and a region.
    fn new() -> Self {
        let mesh = thinning_block();
        let held: [&[[usize; 3]]; 4] = [
            &[[1, 2, 2], [2, 2, 2], [3, 2, 2], [4, 2, 2]],
            &[[7, 4, 1]],
            &[[6, 0, 3]],
            &[[0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 1, 1]],
        ];
        let owned = held.iter().enumerate().flat_map(|(h, held)| held.iter().map(move |&at| (number(at), h)));
        let mut owned: Vec<(usize, usize)> = owned.collect();
        owned.sort_unstable();
        let one = |handle: usize| owned.iter().map(move |&(_, owner)| f64::from(u8::from(owner == handle)));
        Self {
            laplacian: cotangent_laplacian_tetrahedra(&mesh).unwrap().matrix,
            mass: lumped_mass_tetrahedra(&mesh, Lumping::Barycentric).unwrap(),
            fixed: owned.iter().map(|&(vertex, _)| vertex).collect(),
            given: (0..held.len()).flat_map(one).collect(),
            handles: held.len(),
        }
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

    /// Entries `(row, column, value)` of the upper triangle of `L M⁻¹ L`.
    fn hessian(&self) -> Vec<(usize, usize, f64)> {
        let mut entries = Vec::new();
        for column in 0..self.mass.len() {
            for (middle, value) in self.laplacian.column(column) {
                let scaled = value / self.mass[middle];
                let entry = |(row, other): (usize, f64)| (row, column, other * scaled);
                entries.extend(self.laplacian.column(middle).map(entry).filter(|&(row, ..)| row <= column));
            }
        }
        entries
    }
}

/// Constraints row by row: `A x = b` for the first `equal` rows, `A x ≤ b` for the rest.
#[derive(Default)]
struct Constraints {
    entries: Vec<(usize, usize, f64)>,
    right: Vec<f64>,
    equal: usize,
}

impl Constraints {
    fn add(&mut self, terms: impl IntoIterator<Item = (usize, f64)>, right: f64) {
        let row = self.right.len();
        self.entries.extend(terms.into_iter().map(|(column, value)| (row, column, value)));
        self.right.push(right);
    }
}

/// The least `½ xᵀ P x`, and where it is attained.
fn interior_point(count: usize, hessian: &[(usize, usize, f64)], constraints: &Constraints) -> (f64, Vec<f64>) {
    let matrix = |rows: usize, entries: &[(usize, usize, f64)]| {
        let (i, j, v): (Vec<usize>, Vec<usize>, Vec<f64>) = (
            entries.iter().map(|e| e.0).collect(),
            entries.iter().map(|e| e.1).collect(),
            entries.iter().map(|e| e.2).collect(),
        );
        CscMatrix::new_from_triplets(rows, count, i, j, v)
    };
    let rows = constraints.right.len();
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-11)
        .tol_gap_rel(1e-11)
        .tol_feas(1e-10)
        .build()
        .unwrap();
    let mut solver = DefaultSolver::new(
        &matrix(count, hessian),
        &vec![0.0; count],
        &matrix(rows, &constraints.entries),
        &constraints.right,
        &[ZeroConeT(constraints.equal), NonnegativeConeT(rows - constraints.equal)],
        settings,
    )
    .unwrap();
    solver.solve();
    assert!(matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved));
    (solver.solution.obj_val, solver.solution.x.clone())
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

/// The error in a weight that the interior point method's own tolerances allow.
const ITS_ERROR: f64 = 2e-6;

#[test]
fn each_handle_agrees_with_an_interior_point_method() {
    let setup = Setup::new();
    let n = setup.mass.len();
    let settings = BiharmonicSettings::certified();
    let ours = bounded_biharmonic_weights(&setup.problem(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let hessian = setup.hessian();
    for (handle, report) in ours.reports.iter().enumerate() {
        let mut constraints = Constraints { equal: setup.fixed.len(), ..Constraints::default() };
        for (row, &vertex) in setup.fixed.iter().enumerate() {
            constraints.add([(vertex, 1.0)], setup.given[handle * setup.fixed.len() + row]);
        }
        (0..n).for_each(|vertex| constraints.add([(vertex, -1.0)], 0.0));
        (0..n).for_each(|vertex| constraints.add([(vertex, 1.0)], 1.0));
        let (energy, weights) = interior_point(n, &hessian, &constraints);
        assert_eq!(report.outcome, BiharmonicOutcome::Converged);
        assert!((report.energy / energy - 1.0).abs() < 1e-6, "{} and {energy}", report.energy);
        let difference = largest_difference(&ours.weights.bone(handle), &weights);
        println!(
            "handle {handle}: energy {energy:.9}, differs by {:.1e}, weights by {difference:.1e}",
            report.energy - energy
        );
        assert!(difference <= report.error_bound + ITS_ERROR, "{difference} {report:?}");
    }
}

#[test]
fn an_exact_partition_agrees_with_an_interior_point_method() {
    let setup = Setup::new();
    let (n, m) = (setup.mass.len(), setup.handles);
    let settings = ExactPartitionSettings { error_bound: 1e-4, max_steps: 40_000 };
    let ours = exact_partition_weights(&setup.problem(), &settings, &mut |_, _| ControlFlow::Continue(())).unwrap();
    let of_one = setup.hessian();
    let shifted = |handle: usize| of_one.iter().map(move |&(i, j, v)| (handle * n + i, handle * n + j, v));
    let hessian: Vec<_> = (0..m).flat_map(shifted).collect();
    let free: Vec<usize> = (0..n).filter(|vertex| !setup.fixed.contains(vertex)).collect();
    let mut constraints = Constraints { equal: setup.fixed.len() * m + free.len(), ..Constraints::default() };
    for (k, &given) in setup.given.iter().enumerate() {
        let (handle, row) = (k / setup.fixed.len(), k % setup.fixed.len());
        constraints.add([(handle * n + setup.fixed[row], 1.0)], given);
    }
    free.iter().for_each(|vertex| constraints.add((0..m).map(|handle| (handle * n + vertex, 1.0)), 1.0));
    (0..m * n).for_each(|k| constraints.add([(k, -1.0)], 0.0));
    let (energy, weights) = interior_point(m * n, &hessian, &constraints);
    let report = ours.report;
    assert_eq!(report.outcome, BiharmonicOutcome::Converged, "{report:?}");
    assert!((report.energy / energy - 1.0).abs() < 1e-6, "{} and {energy}", report.energy);
    let difference = largest_difference(&ours.weights.to_columns().unwrap(), &weights);
    println!("energy {energy:.9}, differs by {:.1e}, weights by {difference:.1e}", report.energy - energy);
    assert!(difference <= report.error_bound + ITS_ERROR, "{difference} {report:?}");
}
