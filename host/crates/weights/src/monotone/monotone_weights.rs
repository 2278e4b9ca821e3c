//! Weights of handles without spurious extrema (thesis 5.3.4).

use std::ops::ControlFlow;

use super::error::MonotoneError;
use super::monotone_functions::{MonotoneFunction, MonotoneReport, MonotoneSettings, monotone_functions};
use super::prescribed::{PrescribedFunction, Role};
use super::problem::MonotoneProblem;
use crate::WeightMatrix;
use crate::handles::HandleBoundary;

/// Weights with their reports.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneWeights {
    /// n vertices × m handles, each within 0..=1, not normalised: scaling weights to sum to one may make new extrema.
    pub weights: WeightMatrix,
    /// One for every handle.
    pub reports: Vec<MonotoneReport>,
    /// Pieces of the mesh without a fixed vertex, each as a list of its vertices; their weights are zero.
    pub unreached: Vec<Vec<usize>>,
}

/// Computes each handle's weights: highest where the handle holds the shape alone, lowest where others do, and with no
/// other extrema. What several bones share (a joint's ½) lies between. See [`monotone_functions`] for `progress`.
pub fn monotone_weights(
    problem: &MonotoneProblem<'_>,
    held: &HandleBoundary,
    settings: &MonotoneSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<MonotoneWeights, MonotoneError> {
    let n = problem.neighbours.vertices();
    let given = given_weights(held)?;
    let pieces = problem.neighbours.pieces();
    let mut piece_of = vec![0_usize; n];
    for (index, piece) in pieces.iter().enumerate() {
        piece.iter().for_each(|&vertex| piece_of[vertex] = index);
    }
    let functions: Vec<PrescribedFunction> = given.map(|given| in_pieces(given, &held.fixed, &piece_of)).collect();
    let made = monotone_functions(problem, &held.fixed, &functions, settings, progress)?;
    let (columns, reports): (Vec<_>, Vec<_>) = made
        .into_iter()
        .map(|MonotoneFunction { values, report, .. }| (values.into_iter().enumerate().collect::<Vec<_>>(), report))
        .unzip();
    let out_of_memory = MonotoneError::OutOfMemory { vertices: n, functions: held.handles };
    let weights = WeightMatrix::from_sparse_columns(n, columns).ok_or(out_of_memory)?;
    let mut has_fixed = vec![false; pieces.len()];
    held.fixed.iter().for_each(|&vertex| has_fixed[piece_of[vertex]] = true);
    let unreached = pieces.into_iter().zip(has_fixed).filter(|(_, fixed)| !fixed).map(|(piece, _)| piece).collect();
    Ok(MonotoneWeights { weights, reports, unreached })
}

/// The given weights of each handle.
pub(super) fn given_weights(held: &HandleBoundary) -> Result<impl Iterator<Item = &[f64]>, MonotoneError> {
    let (given, wanted) = (held.fixed_weights.len(), held.fixed.len().saturating_mul(held.handles));
    if given != wanted || wanted == 0 {
        return Err(MonotoneError::Size { what: "given weights", given, wanted: wanted.max(1) });
    }
    Ok(held.fixed_weights.chunks(held.fixed.len()))
}

/// One handle's given weights; in each piece of the mesh the lowest are minima and the highest maxima.
fn in_pieces(given: &[f64], fixed: &[usize], piece_of: &[usize]) -> PrescribedFunction {
    let piece = |vertex: usize| piece_of.get(vertex).copied().unwrap_or_default();
    let count = piece_of.iter().max().map_or(0, |last| last + 1).max(1);
    let (mut lowest, mut highest) = (vec![f64::INFINITY; count], vec![f64::NEG_INFINITY; count]);
    for (&vertex, &value) in fixed.iter().zip(given) {
        let at = piece(vertex);
        lowest[at] = lowest[at].min(value);
        highest[at] = highest[at].max(value);
    }
    let role = |(&vertex, &value): (&usize, &f64)| {
        if value >= highest[piece(vertex)] {
            Role::Maximum
        } else if value <= lowest[piece(vertex)] {
            Role::Minimum
        } else {
            Role::Between
        }
    };
    PrescribedFunction { values: given.to_vec(), roles: fixed.iter().zip(given).map(role).collect() }
}
