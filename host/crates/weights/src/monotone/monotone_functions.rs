//! The smoothest functions with prescribed extrema and no others (thesis 5.3; Jacobson, Weinkauf & Sorkine 2012).

use std::ops::ControlFlow;

use super::directed_edges::{DirectedEdges, Given};
use super::energy::MonotoneEnergy;
use super::error::MonotoneError;
use super::prescribed::PrescribedFunction;
use super::problem::{Data, MonotoneProblem};
use super::representative::{Representative, harmonic_representative, order_of};
use super::rising_edges::{Ended, RisingEdges, Wanted};
use crate::extrema::{ExtremaError, Neighbours, local_extrema};
use crate::gather_reports::gather_reports;
use crate::progress::{Stopped, report};

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MonotoneSettings {
    /// A function is done once no value can be farther than this from the optimal one ...
    pub error_bound: f64,
    /// ... and no function has an energy lower by more than this fraction.
    pub relative_gap: f64,
    /// Steps before giving up on a function.
    pub most_steps: usize,
    /// The order is taken anew from the result (thesis 5.8) at most this often ...
    pub convexifications: usize,
    /// ... and until that lowers the energy by less than this fraction.
    pub stall: f64,
}

impl Default for MonotoneSettings {
    /// Every value within 2e-3 of the best one for the representative function's order.
    fn default() -> Self {
        Self { error_bound: 2e-3, relative_gap: 1e-3, most_steps: 4000, convexifications: 0, stall: 1e-3 }
    }
}

impl MonotoneSettings {
    /// Within 2e-5, energies to eight digits.
    pub const fn certified() -> Self {
        Self { error_bound: 2e-5, relative_gap: 1e-8, most_steps: 40_000, convexifications: 0, stall: 1e-3 }
    }
}

/// How the computation of one function ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MonotoneOutcome {
    /// Both bounds of the settings hold.
    Converged,
    /// The limit was reached, or steps gained nothing any more; this is the best found, and the report says how good it is.
    LimitReached,
}

/// How good one function is.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneReport {
    /// Smoothness and data.
    pub energy: f64,
    /// No function that rises along the same edges has less energy than `energy - gap`.
    pub gap: f64,
    /// No value is farther than this from that of the best such function.
    pub error_bound: f64,
    /// The function rises along every directed edge by at least this much ...
    pub margin: f64,
    /// ... and by this much more, or less if it is negative.
    pub slack: f64,
    /// Largest fall along an edge before the last sweep mended it, and the energy that cost.
    pub violation: f64,
    /// See `violation`.
    pub repair: f64,
    /// Directed edges.
    pub edges: usize,
    /// Vertices at conductances that were raised to give the representative function its maximum principle.
    pub raised: usize,
    /// Vertices where the representative function still had an extremum of its own, put in order without it.
    pub mended: usize,
    /// Steps over all convexifications.
    pub steps: usize,
    /// Factorisations for them.
    pub factorisations: usize,
    /// The energy after the first order and after each one taken from a result: it never rises.
    pub energies: Vec<f64>,
    /// Extrema other than prescribed ones, counted in the returned numbers.
    pub spurious: usize,
    /// How it ended.
    pub outcome: MonotoneOutcome,
}

/// A function and its report.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneFunction {
    /// One value for each vertex. Pieces without a fixed vertex are zero; those whose fixed values are all equal have that
    /// value.
    pub values: Vec<f64>,
    /// The directed edges, each from its lower to its higher vertex.
    pub rising: Vec<[u32; 2]>,
    /// How good it is.
    pub report: MonotoneReport,
}

const SOLVING: &str = "solving for monotone functions";

/// Computes the functions that take given values at `fixed` vertices, have their minima and maxima where these are
/// prescribed and nowhere else, and are smoothest (and closest to the data) among those that rise where a representative
/// function rises. They are the same to the last bit whatever the number of threads.
///
/// `progress` receives the current stage and the fraction of the whole that is done, 0 to 1 and never falling; returning
/// `Break` stops the computation.
pub fn monotone_functions(
    problem: &MonotoneProblem<'_>,
    fixed: &[usize],
    functions: &[PrescribedFunction],
    settings: &MonotoneSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<Vec<MonotoneFunction>, MonotoneError> {
    report(progress, "preparing the energy", 0.0)?;
    check(problem, fixed, functions, settings)?;
    let n = problem.mass.len();
    let mut is_unknown = vec![false; n];
    for piece in pieces_with(problem.neighbours, fixed) {
        piece.into_iter().for_each(|vertex| is_unknown[vertex] = true);
    }
    fixed.iter().for_each(|&vertex| is_unknown[vertex] = false);
    let energy = MonotoneEnergy::new(problem, &is_unknown)?;
    report(progress, SOLVING, 0.2)?;
    let items: Vec<(usize, &PrescribedFunction)> = functions.iter().enumerate().collect();
    let (mut done, share) = (0.2, 0.1 / items.len().max(1) as f64);
    let between = || {
        done += share * (1.0 - done);
        progress(SOLVING, done)
    };
    let solve = |(function, prescribed): (usize, &PrescribedFunction), go_on: &dyn Fn() -> bool| {
        solve(problem, &energy, fixed, (function, prescribed), settings, go_on)
    };
    let solved = gather_reports(items, solve, between).ok_or(Stopped { stage: SOLVING })?;
    solved.into_iter().map(|one| one.and_then(|one| one.ok_or(Stopped { stage: SOLVING }.into()))).collect()
}

/// The pieces that have one of these vertices.
fn pieces_with(neighbours: &Neighbours, fixed: &[usize]) -> Vec<Vec<usize>> {
    let mut pieces = neighbours.pieces();
    let mut is_fixed = vec![false; neighbours.vertices()];
    fixed.iter().for_each(|&vertex| is_fixed[vertex] = true);
    pieces.retain(|piece| piece.iter().any(|&vertex| is_fixed[vertex]));
    pieces
}

fn solve(
    problem: &MonotoneProblem<'_>,
    energy: &MonotoneEnergy,
    fixed: &[usize],
    (function, prescribed): (usize, &PrescribedFunction),
    settings: &MonotoneSettings,
    go_on: &dyn Fn() -> bool,
) -> Result<Option<MonotoneFunction>, MonotoneError> {
    let n = problem.mass.len();
    let mut given: Vec<Option<Given>> = vec![None; n];
    let mut values = vec![0.0; n];
    for (&vertex, (&value, &role)) in fixed.iter().zip(prescribed.values.iter().zip(&prescribed.roles)) {
        given[vertex] = Some(Given { value, role });
        values[vertex] = value;
    }
    let fixed_values = values.clone();
    // A piece of one value is constant, and there is nothing to order.
    let mut ordered = given.clone();
    let mut constant = Vec::new();
    for piece in pieces_with(problem.neighbours, fixed) {
        let mut here = piece.iter().filter_map(|&vertex| given[vertex]).map(|given| given.value);
        if let Some(first) = here.next()
            && here.all(|value| value - first == 0.0)
        {
            piece.iter().for_each(|&vertex| ordered[vertex] = None);
            constant.push((piece, first));
        }
    }
    let first = match problem.data {
        None => harmonic_representative(problem.neighbours, problem.laplacian, &ordered)?,
        Some(data) => Representative { order: order_of(problem.neighbours, data.values, &ordered)?, raised: 0 },
    };
    let right = energy.right_hand_side(&fixed_values);
    let mut edges = DirectedEdges::new(problem.neighbours, &first.order, &ordered, None)?;
    let wanted = Wanted {
        error_bound: settings.error_bound,
        relative_gap: settings.relative_gap,
        most_steps: settings.most_steps,
    };
    let solve_along = |edges: &DirectedEdges, start: &[f64]| {
        RisingEdges { energy, edges, order: problem.order, right: &right, fixed: &fixed_values }
            .solve(start, &wanted, go_on)
    };
    let start = start(energy, problem.order, &right, &fixed_values, prescribed)?;
    let Some(mut ended) = solve_along(&edges, &start)? else { return Ok(None) };
    let (mut steps, mut factorisations, mut energies) = (ended.steps, ended.factorisations, vec![ended.found.energy]);
    for _ in 0..settings.convexifications {
        let order = order_of(problem.neighbours, &ended.found.values, &ordered)?;
        let along = DirectedEdges::new(problem.neighbours, &order, &ordered, Some(edges.margin))?;
        let Some(next) = solve_along(&along, &ended.found.values)? else { return Ok(None) };
        steps += next.steps;
        factorisations += next.factorisations;
        let (before, after) = (ended.found.energy, next.found.energy);
        if after < before {
            (ended, edges) = (next, along);
            energies.push(after);
        }
        if after >= before * (1.0 - settings.stall) {
            break;
        }
    }
    let Ended { found, converged, .. } = ended;
    let mut values = found.values;
    if !values.iter().chain([&found.energy, &found.gap]).all(|value| value.is_finite()) {
        return Err(MonotoneError::NotFinite { function });
    }
    for (piece, value) in constant {
        piece.into_iter().for_each(|vertex| values[vertex] = value);
    }
    let extreme: Vec<usize> = (0..n).filter(|&v| ordered[v].is_some_and(|g| g.role != super::Role::Between)).collect();
    let report = MonotoneReport {
        energy: energy.of(&values),
        gap: found.gap,
        error_bound: (2.0 * found.gap * energy.largest_inverse).sqrt(),
        margin: edges.margin,
        slack: edges.slack(&values),
        violation: found.violation,
        repair: found.repair,
        edges: edges.edges.len(),
        raised: first.raised,
        mended: first.order.mended,
        steps,
        factorisations,
        energies,
        spurious: local_extrema(problem.neighbours, &values)?.besides(&extreme).count(),
        outcome: if converged { MonotoneOutcome::Converged } else { MonotoneOutcome::LimitReached },
    };
    Ok(Some(MonotoneFunction { values, rising: edges.edges, report }))
}

/// The function of least energy without inequalities, kept within the range of the given values.
fn start(
    energy: &MonotoneEnergy,
    order: usize,
    right: &[f64],
    fixed_values: &[f64],
    prescribed: &PrescribedFunction,
) -> Result<Vec<f64>, MonotoneError> {
    let mut free = right.to_vec();
    energy.factor.solve_here(&mut free).map_err(|reason| MonotoneError::Factorisation { order, reason })?;
    let lowest = prescribed.values.iter().copied().fold(f64::INFINITY, f64::min);
    let highest = prescribed.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    free.iter_mut().for_each(|value| *value = value.max(lowest).min(highest));
    let mut values = fixed_values.to_vec();
    energy.put(&free, &mut values);
    Ok(values)
}

pub(super) fn check(
    problem: &MonotoneProblem<'_>,
    fixed: &[usize],
    functions: &[PrescribedFunction],
    settings: &MonotoneSettings,
) -> Result<(), MonotoneError> {
    let n = problem.neighbours.vertices();
    let size = |what, given: usize, wanted: usize| {
        if given == wanted { Ok(()) } else { Err(MonotoneError::Size { what, given, wanted }) }
    };
    let number = |what, value: f64, good: bool, allowed| {
        if good { Ok(()) } else { Err(MonotoneError::BadNumber { what, value, allowed }) }
    };
    size("rows of the Laplacian", problem.laplacian.rows(), n)?;
    size("columns of the Laplacian", problem.laplacian.columns(), n)?;
    size("masses", problem.mass.len(), n)?;
    number("the order", problem.order as f64, (2..=4).contains(&problem.order), "2, 3 or 4")?;
    for &mass in problem.mass {
        number("a mass", mass, mass >= 0.0 && mass.is_finite(), "finite and not negative")?;
    }
    for &entry in problem.laplacian.values() {
        number("an entry of the Laplacian", entry, entry.is_finite(), "finite")?;
    }
    if let Some(blend) = problem.blend {
        size("smoothness of vertices", blend.len(), n)?;
        for &value in blend {
            number("the smoothness of a vertex", value, (0.0..=1.0).contains(&value), "between 0 and 1")?;
        }
    }
    if let Some(Data { values, fidelity }) = problem.data {
        size("data", values.len(), n)?;
        number("the fidelity", fidelity, fidelity >= 0.0 && fidelity.is_finite(), "finite and not negative")?;
        for &value in values {
            number("a value of the data", value, value.is_finite(), "finite")?;
        }
    }
    let MonotoneSettings { error_bound, relative_gap, stall, .. } = *settings;
    number("error_bound", error_bound, error_bound > 0.0, "positive")?;
    number("relative_gap", relative_gap, relative_gap > 0.0, "positive")?;
    number("stall", stall, (0.0..1.0).contains(&stall), "at least 0 and less than 1")?;
    let mut taken = vec![false; n];
    for &vertex in fixed {
        let place = taken.get_mut(vertex).ok_or(ExtremaError::NoSuchVertex { vertex, vertices: n })?;
        if std::mem::replace(place, true) {
            return Err(MonotoneError::FixedTwice { vertex });
        }
    }
    for function in functions {
        size("given values", function.values.len(), fixed.len())?;
        size("roles", function.roles.len(), fixed.len())?;
        for &value in &function.values {
            number("a given value", value, value.is_finite(), "finite")?;
        }
    }
    Ok(())
}
