//! A function with only the prescribed extrema, whose order says along which edges others have to rise (thesis 5.3.3).

use armature_geometry::operators::SparseMatrix;

use super::directed_edges::Given;
use super::error::MonotoneError;
use super::prescribed::Role;
use crate::extrema::{MonotoneOrder, Neighbours, order_with_extrema};
use crate::harmonic::{HarmonicProblem, harmonic_function, positive_conductances};

/// An order of the vertices, and what it took.
#[derive(Clone, Debug)]
pub(crate) struct Representative {
    pub(crate) order: MonotoneOrder,
    /// Vertices at edges whose conductance had to be raised; zero where the given Laplacian was good enough.
    pub(crate) raised: usize,
}

/// The harmonic function that is zero at minima and one at maxima (thesis eqs. 5.15 to 5.17), and between at other given
/// vertices. Where obtuse elements or rounding give it extrema of its own, conductances are made positive; what is left
/// (a long appendage, where all values are equal to the last digit) is put in order without values.
pub(crate) fn harmonic_representative(
    neighbours: &Neighbours,
    laplacian: &SparseMatrix,
    given: &[Option<Given>],
) -> Result<Representative, MonotoneError> {
    let prescribed = || given.iter().enumerate().filter_map(|(vertex, given)| given.map(|given| (vertex, given)));
    let lowest = prescribed().map(|(_, given)| given.value).fold(f64::INFINITY, f64::min);
    let highest = prescribed().map(|(_, given)| given.value).fold(f64::NEG_INFINITY, f64::max);
    let height = |given: Given| match given.role {
        Role::Minimum => 0.0,
        Role::Between => ((given.value - lowest) / (highest - lowest)).clamp(0.0, 1.0),
        Role::Maximum => 1.0,
    };
    let fixed: Vec<usize> = prescribed().map(|(vertex, _)| vertex).collect();
    let values: Vec<f64> = prescribed().map(|(_, given)| height(given)).collect();
    let solve = |laplacian: &SparseMatrix| {
        let problem = HarmonicProblem { laplacian, fixed: &fixed, values: &values, flux: &[] };
        let heights = harmonic_function(&problem)?.values;
        order_of(neighbours, &heights, given)
    };
    // An indefinite Laplacian cannot be factorised; one with positive conductances can.
    if let Ok(order) = solve(laplacian)
        && order.mended == 0
    {
        return Ok(Representative { order, raised: 0 });
    }
    let positive = positive_conductances(laplacian);
    Ok(Representative { order: solve(&positive.matrix)?, raised: positive.vertices })
}

/// The order of any function, with only the prescribed extrema.
pub(crate) fn order_of(
    neighbours: &Neighbours,
    values: &[f64],
    given: &[Option<Given>],
) -> Result<MonotoneOrder, MonotoneError> {
    let with = |role: Role| -> Vec<usize> {
        (0..given.len()).filter(|&vertex| given[vertex].is_some_and(|given| given.role == role)).collect()
    };
    Ok(order_with_extrema(neighbours, values, &with(Role::Minimum), &with(Role::Maximum))?)
}
