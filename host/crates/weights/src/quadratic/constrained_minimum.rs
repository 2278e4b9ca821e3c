//! The least value of a quadratic energy under linear equalities (thesis 2.2.2) and inequalities (2.2.3).

use std::ops::ControlFlow;

use super::interior_steps::InteriorSteps;
use super::problem::{QuadraticError, QuadraticProblem, check};
use super::solution::{QuadraticOutcome, QuadraticSolution};
use crate::progress::report;

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct QuadraticSettings {
    /// Conditions may be missed by this, relative to the largest number in them, ...
    pub feasibility: f64,
    /// ... the gradient by this, relative to its largest term, ...
    pub stationarity: f64,
    /// ... and the energy may be this far from the least, relative to itself.
    pub relative_gap: f64,
    /// Steps before giving up; fifteen to thirty are usual.
    pub most_steps: usize,
}

impl Default for QuadraticSettings {
    /// As far as double precision usually allows.
    fn default() -> Self {
        Self { feasibility: 1e-12, stationarity: 1e-9, relative_gap: 1e-9, most_steps: 100 }
    }
}

/// Solves by Lagrange multipliers if the equalities' solution meets all inequalities, and by a primal-dual interior point
/// method with predictor and corrector (Mehrotra 1992) if not. Rows with few entries are cheap. An inequality without
/// values that meet it ends with [`QuadraticOutcome::LimitReached`] and a violation.
///
/// `progress` receives the current stage and the fraction of the whole that is done; returning `Break` stops the
/// computation.
pub fn constrained_minimum(
    problem: &QuadraticProblem,
    settings: &QuadraticSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<QuadraticSolution, QuadraticError> {
    const STAGE: &str = "solving under linear conditions";
    report(progress, STAGE, 0.0)?;
    check(problem)?;
    let (problem, largest) = problem.scaled();
    let mut steps = InteriorSteps::new(&problem)?;
    let mut best = steps.solution();
    let scale = equality_scale(&problem, &best.values);
    if best.equality_residual > 1e-6 * scale {
        return Err(QuadraticError::Contradiction { miss: best.equality_residual });
    }
    if best.violation == 0.0 {
        best.outcome = QuadraticOutcome::Converged;
        return Ok(best.scaled(largest));
    }
    steps.enter_interior();
    let (mut unpaid, mut least) = (0, f64::INFINITY);
    while steps.taken < settings.most_steps && unpaid < PATIENCE {
        report(progress, STAGE, steps.taken as f64 / settings.most_steps as f64)?;
        if steps.take().is_err() {
            break;
        }
        let mut found = steps.solution();
        if !found.energy.is_finite() || !found.gap.is_finite() {
            break;
        }
        let measure = shortfall(&problem, &found, settings);
        unpaid = if measure < 0.9 * least { 0 } else { unpaid + 1 };
        let done = measure <= 1.0;
        if done {
            found.outcome = QuadraticOutcome::Converged;
        }
        if measure < least {
            (least, best) = (measure, found);
        }
        if done {
            break;
        }
    }
    best.steps = steps.taken;
    Ok(best.scaled(largest))
}

/// After this many steps in a row that made nothing better, the best is all there is.
const PATIENCE: usize = 12;

/// The largest of all residuals in units of what is allowed: done at one.
fn shortfall(problem: &QuadraticProblem, found: &QuadraticSolution, settings: &QuadraticSettings) -> f64 {
    let most = |values: &[f64]| values.iter().fold(f64::MIN_POSITIVE, |most, value| most.max(value.abs()));
    let mut pull = vec![0.0; found.values.len()];
    problem.inequalities.add_transposed(&found.inequality_multipliers, &mut pull);
    let force = most(&problem.quadratic.multiply(&found.values)).max(most(&problem.linear)).max(most(&pull));
    let reach = most(&problem.inequalities.matrix.multiply(&found.values)).max(most(&problem.inequalities.bounds));
    let miss = found.equality_residual.max(found.violation);
    (miss / (settings.feasibility * most(&found.values).max(reach)))
        .max(found.stationarity / (settings.stationarity * force))
        .max(found.gap / (settings.relative_gap * found.energy.abs().max(f64::MIN_POSITIVE)))
}

/// The largest term of an equality.
fn equality_scale(problem: &QuadraticProblem, values: &[f64]) -> f64 {
    let equalities = &problem.equalities;
    let terms = (0..values.len()).flat_map(|k| equalities.matrix.column(k).map(move |(_, entry)| entry * values[k]));
    terms.chain(equalities.bounds.iter().copied()).fold(f64::MIN_POSITIVE, |most, term| most.max(term.abs()))
}

#[cfg(test)]
mod tests {
    use armature_geometry::operators::SparseMatrix;
    use clarabel::algebra::CscMatrix;
    use clarabel::solver::SupportedConeT::{NonnegativeConeT, ZeroConeT};
    use clarabel::solver::{DefaultSettingsBuilder, DefaultSolver, IPSolver};

    use super::*;
    use crate::quadratic::{LinearConditions, QuadraticOutcome};

    fn noise(k: u32) -> f64 {
        f64::from(k.wrapping_mul(2_654_435_769) >> 8) / f64::from(1 << 23) - 1.0
    }

    /// A stiff chain with a random pull, random sparse conditions that one point meets.
    fn random_problem(seed: u32) -> QuadraticProblem {
        let n = 40_u32;
        let springs = (0..n - 1).flat_map(|k| {
            let stiffness = 10_f64.powf(3.0 * noise(seed + k));
            [(k, k, stiffness), (k + 1, k + 1, stiffness), (k, k + 1, -stiffness), (k + 1, k, -stiffness)]
        });
        let entries: Vec<_> = springs.chain((0..n).map(|k| (k, k, 1e-3))).collect();
        let at: Vec<f64> = (0..n).map(|k| noise(seed + 100 + k)).collect();
        let rows = |count: u32, first: u32, slack: &dyn Fn(u32) -> f64| {
            let entry = move |row: u32, k: u32| {
                let place = (noise(first + 7 * row + k).abs() * f64::from(n)) as u32 % n;
                (row, place, noise(first + 300 + 11 * row + k))
            };
            let entries: Vec<_> = (0..count).flat_map(|row| (0..3).map(move |k| entry(row, k))).collect();
            let matrix = SparseMatrix::from_triplets(count as usize, n as usize, &entries).unwrap();
            let mut bounds = matrix.multiply(&at);
            bounds.iter_mut().zip(0..).for_each(|(bound, row)| *bound += slack(row));
            LinearConditions { matrix, bounds }
        };
        QuadraticProblem {
            quadratic: SparseMatrix::from_triplets(n as usize, n as usize, &entries).unwrap(),
            linear: (0..n).map(|k| 10.0 * noise(seed + 200 + k)).collect(),
            constant: 0.0,
            equalities: rows(6, seed + 1000, &|_| 0.0),
            inequalities: rows(60, seed + 2000, &|row| 0.2 * noise(seed + 3000 + row).abs()),
        }
    }

    fn on(_: &'static str, _: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    #[test]
    fn values_and_energies_are_those_of_clarabel() {
        for seed in [1, 5000, 90_000] {
            let problem = random_problem(seed);
            let ours = constrained_minimum(&problem, &QuadraticSettings::default(), &mut on).unwrap();
            let csc = |rows: usize, entries: Vec<(usize, usize, f64)>| {
                let pick = |k: usize| entries.iter().map(move |e| [e.0, e.1][k]).collect::<Vec<_>>();
                let values = entries.iter().map(|entry| entry.2).collect();
                CscMatrix::new_from_triplets(rows, 40, pick(0), pick(1), values)
            };
            let all = |matrix: &SparseMatrix, below: usize| {
                (0..40)
                    .flat_map(|c| matrix.column(c).map(move |(r, v)| (below + r, c, v)).collect::<Vec<_>>())
                    .collect()
            };
            let upper: Vec<_> = all(&problem.quadratic, 0);
            let upper = csc(40, upper.into_iter().filter(|(row, column, _)| row <= column).collect());
            let both: Vec<_> = [all(&problem.equalities.matrix, 0), all(&problem.inequalities.matrix, 6)].concat();
            let bounds = [problem.equalities.bounds.clone(), problem.inequalities.bounds.clone()].concat();
            let settings = DefaultSettingsBuilder::default()
                .verbose(false)
                .tol_gap_rel(1e-11)
                .tol_gap_abs(1e-11)
                .tol_feas(1e-11)
                .build()
                .unwrap();
            let cones = [ZeroConeT(6), NonnegativeConeT(60)];
            let mut theirs =
                DefaultSolver::new(&upper, &problem.linear, &csc(66, both), &bounds, &cones, settings).unwrap();
            theirs.solve();
            let apart = ours.values.iter().zip(&theirs.solution.x).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            println!("{apart:e} apart, {} and {}", ours.energy, theirs.solution.obj_val);
            assert_eq!(ours.outcome, QuadraticOutcome::Converged);
            assert!(apart < 1e-6, "{apart}");
            assert!((ours.energy - theirs.solution.obj_val).abs() < 1e-8 * ours.energy.abs());
            assert!(ours.violation < 1e-11 && ours.equality_residual < 1e-11 && ours.gap < 1e-9 * ours.energy.abs());
            let dual = ours.inequality_multipliers.iter().zip(&theirs.solution.z[6..]).map(|(a, b)| (a - b).abs());
            assert!(dual.fold(0.0, f64::max) < 1e-4 * ours.inequality_multipliers.iter().fold(1.0, |a, b| b.max(a)));
        }
    }

    #[test]
    fn equalities_alone_need_no_steps_and_what_cannot_be_is_named() {
        let problem = QuadraticProblem { inequalities: LinearConditions::none(40), ..random_problem(3) };
        let settings = QuadraticSettings::default();
        let solved = constrained_minimum(&problem, &settings, &mut on).unwrap();
        assert_eq!((solved.outcome, solved.steps), (QuadraticOutcome::Converged, 0));
        assert!(solved.stationarity < 1e-9 && solved.equality_residual < 1e-12, "{solved:?}");
        let row = |value: f64| (0..2).flat_map(move |row| [(row, 0, 1.0), (row, 1, value)]).collect::<Vec<_>>();
        let twice = |bounds: [f64; 2]| LinearConditions {
            matrix: SparseMatrix::from_triplets(2, 40, &row(2.0)).unwrap(),
            bounds: bounds.to_vec(),
        };
        let same = QuadraticProblem { equalities: twice([1.0, 1.0]), ..problem.clone() };
        assert!(constrained_minimum(&same, &settings, &mut on).unwrap().equality_residual < 1e-9);
        let against = QuadraticProblem { equalities: twice([1.0, 2.0]), ..problem.clone() };
        let against = constrained_minimum(&against, &settings, &mut on);
        assert!(matches!(against, Err(QuadraticError::Contradiction { miss }) if miss > 0.1), "{against:?}");
        let inequalities = LinearConditions {
            matrix: SparseMatrix::from_triplets(2, 40, &[(0, 5, 1.0), (1, 5, -1.0)]).unwrap(),
            bounds: vec![0.0, -1.0],
        };
        let none = constrained_minimum(&QuadraticProblem { inequalities, ..problem.clone() }, &settings, &mut on);
        let none = none.unwrap();
        assert!(none.outcome == QuadraticOutcome::LimitReached && none.violation > 1e-3, "{none:?}");
        let nan = QuadraticProblem { linear: vec![f64::NAN; 40], ..problem.clone() };
        assert!(matches!(constrained_minimum(&nan, &settings, &mut on), Err(QuadraticError::NotFinite { .. })));
        let short = QuadraticProblem { linear: vec![0.0; 39], ..problem.clone() };
        assert!(matches!(constrained_minimum(&short, &settings, &mut on), Err(QuadraticError::Size { .. })));
        let lopsided = SparseMatrix::from_triplets(40, 40, &[(0, 1, 1.0)]).unwrap();
        let lopsided = QuadraticProblem { quadratic: lopsided, ..problem.clone() };
        assert!(matches!(constrained_minimum(&lopsided, &settings, &mut on), Err(QuadraticError::NotSymmetric { .. })));
        let stopped = constrained_minimum(&problem, &settings, &mut |_, _| ControlFlow::Break(()));
        assert!(matches!(stopped, Err(QuadraticError::Cancelled { .. })));
    }
}
