//! The monotone problem as the paper solves it: in conic form (thesis 2.2.4, 5.7; eqs. 2.92 to 2.95), by an interior point
//! method, with Clarabel (and its own sparse solver, QDLDL) in place of MOSEK. It shares nothing with
//! [`monotone_functions`](super::monotone_functions) but the directed edges, and serves to check it.

use clarabel::algebra::CscMatrix;
use clarabel::solver::SupportedConeT::{NonnegativeConeT, SecondOrderConeT, ZeroConeT};
use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus};

/// `min ½ ‖F f‖² + cᵀ f` where `f` is given at some places and rises by `margin` from the first to the second of every
/// pair.
#[derive(Clone, Debug, Default)]
pub struct ConicProblem {
    /// Number of values.
    pub count: usize,
    /// Entries `(row, column, value)` of F: the forms (5.19) and (5.20), or any other square root of an energy.
    pub root: Vec<(usize, usize, f64)>,
    /// Rows of F.
    pub rows: usize,
    /// c; empty for none.
    pub linear: Vec<f64>,
    /// Places and their values.
    pub fixed: Vec<(usize, f64)>,
    /// Pairs of lower and higher places.
    pub rising: Vec<[usize; 2]>,
    /// How much higher.
    pub margin: f64,
}

/// How the interior point method ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ConicOutcome {
    /// To its tolerances.
    Converged,
    /// To weaker ones; the residuals say how far.
    AlmostConverged,
    /// Too many iterations, or no progress.
    LimitReached,
    /// No values meet the conditions.
    Infeasible,
    /// It failed numerically, or the problem has no lower bound.
    Failed,
}

/// What it found.
#[derive(Clone, Debug)]
pub struct ConicSolution {
    /// The values.
    pub values: Vec<f64>,
    /// The energy there, as computed from F.
    pub energy: f64,
    /// How far conditions are missed, and how far from optimal, in its own relative measures.
    pub primal_residual: f64,
    /// See `primal_residual`.
    pub dual_residual: f64,
    /// Difference of the primal and dual energies.
    pub gap: f64,
    /// Iterations, each with a factorisation.
    pub iterations: u32,
    /// How it ended.
    pub outcome: ConicOutcome,
}

/// Why Clarabel did not take the problem.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the conic problem is malformed: {0}")]
pub struct ConicError(String);

/// Solves `min v + cᵀ f` subject to `F f - t = 0`, `2 v ≥ tᵀ t` and the conditions on `f`.
pub fn interior_point(problem: &ConicProblem) -> Result<ConicSolution, ConicError> {
    let ConicProblem { count, root, rows, linear, fixed, rising, margin } = problem;
    let (count, rows) = (*count, *rows);
    let named = |place: usize| place < count;
    let good = root.iter().all(|&(row, column, value)| row < rows && named(column) && value.is_finite())
        && fixed.iter().all(|&(place, value)| named(place) && value.is_finite())
        && rising.iter().flatten().all(|&place| named(place))
        && (linear.is_empty() || linear.len() == count);
    if !good {
        return Err(ConicError("a place does not exist, or a number is not finite".to_owned()));
    }
    // Columns: f, t, v. Clarabel wants `A x + s = b` with `s` in a cone.
    let (first_t, v) = (count, count + rows);
    let mut entries: Vec<(usize, usize, f64)> = root.clone();
    entries.extend((0..rows).map(|row| (row, first_t + row, -1.0)));
    let mut right = vec![0.0; rows];
    let mut put = |terms: &[(usize, f64)], bound: f64| {
        entries.extend(terms.iter().map(|&(column, value)| (right.len(), column, value)));
        right.push(bound);
    };
    fixed.iter().for_each(|&(place, value)| put(&[(place, 1.0)], value));
    rising.iter().for_each(|&[low, high]| put(&[(low, 1.0), (high, -1.0)], -margin));
    // 2 v ≥ tᵀt as ‖(√2 t, v - 1)‖ ≤ v + 1.
    put(&[(v, -1.0)], 1.0);
    put(&[(v, -1.0)], -1.0);
    (0..rows).for_each(|row| put(&[(first_t + row, -std::f64::consts::SQRT_2)], 0.0));
    let mut objective = vec![0.0; v + 1];
    objective[..linear.len()].copy_from_slice(linear);
    objective[v] = 1.0;
    let matrix = CscMatrix::new_from_triplets(
        right.len(),
        v + 1,
        entries.iter().map(|entry| entry.0).collect(),
        entries.iter().map(|entry| entry.1).collect(),
        entries.iter().map(|entry| entry.2).collect(),
    );
    let cones = [ZeroConeT(rows + fixed.len()), NonnegativeConeT(rising.len()), SecondOrderConeT(rows + 2)];
    let settings = DefaultSettingsBuilder::default()
        .verbose(false)
        .tol_gap_abs(1e-11)
        .tol_gap_rel(1e-11)
        .tol_feas(1e-11)
        .build()
        .map_err(|error| ConicError(error.to_string()))?;
    let none = CscMatrix::zeros((v + 1, v + 1));
    let mut solver = DefaultSolver::new(&none, &objective, &matrix, &right, &cones, settings)
        .map_err(|error| ConicError(error.to_string()))?;
    solver.solve();
    let solution = &solver.solution;
    let outcome = match solution.status {
        SolverStatus::Solved => ConicOutcome::Converged,
        SolverStatus::AlmostSolved => ConicOutcome::AlmostConverged,
        SolverStatus::MaxIterations | SolverStatus::MaxTime | SolverStatus::InsufficientProgress => {
            ConicOutcome::LimitReached
        }
        SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => ConicOutcome::Infeasible,
        _ => ConicOutcome::Failed,
    };
    let values = solution.x[..count].to_vec();
    let mut image = vec![0.0; rows];
    root.iter().for_each(|&(row, column, value)| image[row] += value * values[column]);
    let bent = 0.5 * image.iter().map(|value| value * value).sum::<f64>();
    let pulled: f64 = linear.iter().zip(&values).map(|(a, b)| a * b).sum();
    Ok(ConicSolution {
        energy: bent + pulled,
        values,
        primal_residual: solution.r_prim,
        dual_residual: solution.r_dual,
        gap: (solution.obj_val - solution.obj_val_dual).abs(),
        iterations: solution.iterations,
        outcome,
    })
}
