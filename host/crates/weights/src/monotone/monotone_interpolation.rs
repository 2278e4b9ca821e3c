//! Values and colours spread from where they are given (thesis 5.4, eq. 5.2): each is blended by a monotone function that is
//! one there and zero at the others.

use std::ops::ControlFlow;

use super::error::MonotoneError;
use super::monotone_functions::{MonotoneReport, MonotoneSettings};
use super::monotone_weights::monotone_weights;
use super::problem::MonotoneProblem;
use crate::extrema::{Expected, PersistentExtremum, spurious_extrema};
use crate::finish::normalise;
use crate::handles::HandleBoundary;

/// Vertices of one value.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueSource {
    /// A point, a curve or a region.
    pub vertices: Vec<usize>,
    /// One number, or three of a colour, or as many as all others have.
    pub value: Vec<f64>,
}

/// Values everywhere.
#[derive(Clone, Debug, PartialEq)]
pub struct MonotoneInterpolation {
    /// For each number of a value, one for each vertex: within the range of the given ones.
    pub columns: Vec<Vec<f64>>,
    /// One for the blending function of each different value, in the order in which these are given first; a single one
    /// between two values.
    pub reports: Vec<MonotoneReport>,
    /// For each column, extrema away from the given values, most persistent first: blending functions have none, but three
    /// or more are scaled to sum to one.
    pub spurious: Vec<Vec<PersistentExtremum>>,
    /// Vertices in pieces of the mesh without a given value, ascending; their values are zero.
    pub unreached: Vec<usize>,
}

/// Spreads the given values. Sources with equal values are blended as one. See
/// [`monotone_functions`](super::monotone_functions) for `progress`.
pub fn monotone_interpolation(
    problem: &MonotoneProblem<'_>,
    sources: &[ValueSource],
    settings: &MonotoneSettings,
    progress: &mut dyn FnMut(&'static str, f64) -> ControlFlow<()>,
) -> Result<MonotoneInterpolation, MonotoneError> {
    let n = problem.neighbours.vertices();
    let width = sources.first().map_or(0, |source| source.value.len());
    let mut values: Vec<&[f64]> = Vec::new();
    let mut given: Vec<(usize, usize)> = Vec::new();
    for source in sources {
        if source.value.len() != width || width == 0 {
            let (what, given, wanted) = ("numbers of a value", source.value.len(), width.max(1));
            return Err(MonotoneError::Size { what, given, wanted });
        }
        if let Some(&value) = source.value.iter().find(|value| !value.is_finite()) {
            return Err(MonotoneError::BadNumber { what: "a given value", value, allowed: "finite" });
        }
        let handle = values.iter().position(|value| *value == source.value).unwrap_or_else(|| {
            values.push(&source.value);
            values.len() - 1
        });
        given.extend(source.vertices.iter().map(|&vertex| (vertex, handle)));
    }
    given.sort_unstable();
    given.dedup();
    if let Some(pair) = given.windows(2).find(|pair| pair[0].0 == pair[1].0) {
        return Err(MonotoneError::FixedTwice { vertex: pair[0].0 });
    }
    // Between two values one function says all, and nothing has to be scaled.
    let handles = if values.len() == 2 { 1..2 } else { 0..values.len() };
    let of_handle = |handle: usize| given.iter().map(move |&(_, owner)| f64::from(u8::from(owner == handle)));
    let held = HandleBoundary {
        fixed: given.iter().map(|&(vertex, _)| vertex).collect(),
        fixed_weights: handles.clone().flat_map(of_handle).collect(),
        handles: handles.len(),
    };
    let mut solved = monotone_weights(problem, &held, settings, progress)?;
    let from: Vec<f64> = if let [first, _] = values[..] {
        first.to_vec()
    } else {
        normalise(&mut solved.weights);
        vec![0.0; width]
    };
    let mut columns: Vec<Vec<f64>> = from.iter().map(|&number| vec![number; n]).collect();
    for (column, handle) in handles.enumerate() {
        for (vertex, weight) in solved.weights.column(column) {
            let numbers = columns.iter_mut().zip(values[handle]).zip(&from);
            numbers.for_each(|((column, number), from)| column[vertex] += weight * (number - from));
        }
    }
    // Sums of products round; what is given stays what it is, and so does the range.
    for (k, column) in columns.iter_mut().enumerate() {
        let low = values.iter().map(|value| value[k]).fold(f64::INFINITY, f64::min);
        let high = values.iter().map(|value| value[k]).fold(f64::NEG_INFINITY, f64::max);
        let unreached = solved.unreached.iter().flatten();
        column.iter_mut().for_each(|value| *value = value.max(low).min(high));
        unreached.for_each(|&vertex| column[vertex] = 0.0);
        given.iter().for_each(|&(vertex, handle)| column[vertex] = values[handle][k]);
    }
    let spurious = columns.iter().map(|column| spurious_extrema(problem.neighbours, column, Expected::At(&held.fixed)));
    let spurious = spurious.collect::<Result<_, _>>()?;
    let mut unreached: Vec<usize> = solved.unreached.into_iter().flatten().collect();
    unreached.sort_unstable();
    Ok(MonotoneInterpolation { columns, reports: solved.reports, spurious, unreached })
}
