//! Monotone weights that sum to one by construction: all handles are solved together, so that none has an extremum of its
//! own and nothing has to be scaled.

use std::ops::ControlFlow;

use super::error::MonotoneError;
use super::monotone_functions::{MonotoneOutcome, MonotoneSettings, check};
use super::monotone_weights::given_weights;
use super::partition_problem::{Found, PartitionProblem, SOLVING};
use super::prescribed::PrescribedFunction;
use super::problem::MonotoneProblem;
use super::shared_levels::{SharedLevels, harmonic_levels};
use crate::WeightMatrix;
use crate::extrema::local_extrema;
use crate::handles::HandleBoundary;
use crate::progress::report;

/// How good weights are that were solved together.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotonePartitionReport {
    /// The sum of all handles' energies.
    pub energy: f64,
    /// No weights that sum to one and rise along the same edges have less energy than `energy - gap`.
    pub gap: f64,
    /// No weight is farther than this from that of the best such weights.
    pub error_bound: f64,
    /// Weights rise along every directed edge by at least this much.
    pub margin: f64,
    /// The smallest rise, less the margin.
    pub slack: f64,
    /// Energy that it cost to make the smallest rises exact.
    pub repair: f64,
    /// Directed edges of all handles.
    pub edges: usize,
    /// Vertices that were put together with a neighbour, because weights differ less between them than rounding does.
    pub flattened: usize,
    /// Vertices at conductances that were raised to give the harmonic weights their maximum principle.
    pub raised: usize,
    /// Largest distance of a vertex's sum from one.
    pub largest_sum_error: f64,
    /// Steps, each with a factorisation.
    pub steps: usize,
    /// The energy after the first order and after each one taken from a result: it never rises.
    pub energies: Vec<f64>,
    /// Extrema at vertices that are not fixed, counted in the returned numbers.
    pub spurious: usize,
    /// How it ended.
    pub outcome: MonotoneOutcome,
}

/// Weights that sum to one, with their report.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotonePartition {
    /// n vertices × m handles, each within 0..=1.
    pub weights: WeightMatrix,
    /// How good they are.
    pub report: MonotonePartitionReport,
    /// Pieces of the mesh without a fixed vertex, each as a list of its vertices; their weights are zero.
    pub unreached: Vec<Vec<usize>>,
}

/// Handles times vertices that are solved together at most: three handles on 4,000 vertices take about a minute.
pub const MOST_TOGETHER: usize = 40_000;

/// Computes the weights of all handles together: smoothest among those that sum to one, are as given at the fixed
/// vertices, and rise and fall, each handle's, where its harmonic weights do. The data term of `problem` is not used.
///
/// Time and memory grow with the square of the number of handles and faster: this is for a few of them, and more than
/// [`MOST_TOGETHER`] are refused. `progress`
/// receives the current stage and the fraction of the whole that is done; returning `Break` stops the computation.
pub fn monotone_partition(
    problem: &MonotoneProblem<'_>,
    held: &HandleBoundary,
    settings: &MonotoneSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<MonotonePartition, MonotoneError> {
    report(progress, "preparing the weights", 0.0)?;
    let problem = MonotoneProblem { data: None, ..*problem };
    let given = given_weights(held)?.map(PrescribedFunction::between_extremes).collect::<Vec<_>>();
    check(&problem, &held.fixed, &given, settings)?;
    check_sums(held)?;
    let vertices = problem.neighbours.vertices();
    if vertices.saturating_mul(held.handles) > MOST_TOGETHER {
        return Err(MonotoneError::TooManyTogether { handles: held.handles, vertices, most: MOST_TOGETHER });
    }
    let first = harmonic_levels(&problem, held)?;
    let (flattened, raised) = (first.flattened, first.raised);
    let rounds = settings.convexifications + 1;
    let mut told = |round: usize, done: f64| {
        let done = 0.1 + 0.85 * (round as f64 + done) / rounds as f64;
        progress(SOLVING, done)
    };
    let mut partition = PartitionProblem::new(&problem, held, first)?;
    let mut best = partition.solve(settings, &mut |done| told(0, done))?;
    let (mut steps, mut energies) = (best.steps, vec![best.energy]);
    for round in 1..rounds {
        let levels = SharedLevels::of_weights(problem.neighbours, held, &best.columns);
        let next_partition = PartitionProblem::new(&problem, held, levels)?;
        let next = next_partition.solve(settings, &mut |done| told(round, done))?;
        steps += next.steps;
        let (before, after) = (best.energy, next.energy);
        if after < before {
            (best, partition) = (next, next_partition);
            energies.push(after);
        }
        if after >= before * (1.0 - settings.stall) {
            break;
        }
    }
    let allowed = partition.allowed(best.energy, settings);
    let error_bound = partition.error_bound(best.gap);
    let edges = partition.edges();
    let Found { columns, energy, gap, smallest_rise, margin, repair, .. } = best;
    let n = problem.neighbours.vertices();
    let mut spurious = 0;
    for column in &columns {
        spurious += local_extrema(problem.neighbours, column)?.besides(&sorted(&held.fixed)).count();
    }
    let reached = partition.reached();
    let sum_error = |vertex: usize| (columns.iter().map(|column| column[vertex]).sum::<f64>() - 1.0).abs();
    let largest_sum_error = (0..n).filter(|&vertex| reached[vertex]).map(sum_error).fold(0.0, f64::max);
    let mut unreached = problem.neighbours.pieces();
    unreached.retain(|piece| !reached[piece[0]]);
    let out_of_memory = MonotoneError::OutOfMemory { vertices: n, functions: held.handles };
    let columns = columns.into_iter().map(|column| column.into_iter().enumerate());
    let weights = WeightMatrix::from_sparse_columns(n, columns).ok_or(out_of_memory)?;
    let report = MonotonePartitionReport {
        energy,
        gap,
        error_bound,
        margin,
        slack: smallest_rise - margin,
        repair,
        edges,
        flattened,
        raised,
        largest_sum_error,
        steps,
        energies,
        spurious,
        outcome: if gap <= allowed && smallest_rise >= margin {
            MonotoneOutcome::Converged
        } else {
            MonotoneOutcome::LimitReached
        },
    };
    Ok(MonotonePartition { weights, report, unreached })
}

fn sorted(vertices: &[usize]) -> Vec<usize> {
    let mut sorted = vertices.to_vec();
    sorted.sort_unstable();
    sorted
}

/// How far from one the given weights of a vertex may sum.
const SUM_TOLERANCE: f64 = 1e-9;

/// Weights can sum to one everywhere only if the given ones do.
fn check_sums(held: &HandleBoundary) -> Result<(), MonotoneError> {
    let count = held.fixed.len();
    for (row, &vertex) in held.fixed.iter().enumerate() {
        let sum: f64 = held.fixed_weights.iter().skip(row).step_by(count).sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            return Err(MonotoneError::NoPartition { vertex, sum });
        }
    }
    Ok(())
}
