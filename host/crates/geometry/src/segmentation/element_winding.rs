//! The winding number of whole elements.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::energy::{OUTSIDE, is_plausible};
use super::error::SegmentationError;
use super::quadrature::{Rule, symmetric_rule};
use crate::progress::{Progress, stage};
/// Elements between two progress reports.
const CHUNK: usize = 8192;
const MOST_REFINEMENTS: u32 = 4;

/// When the barycentre is not enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ElementWindingSettings {
    /// An element is hard if the winding number at its barycentre is further than this from an integer. From 0 to ½; at
    /// ½ or more, none is. The default is ten times the possible error of the fast winding number.
    pub from_integer: f64,
    /// An element is hard if the winding number at its barycentre differs by more than this from a neighbour's. Above
    /// 0; at infinity none is.
    pub from_neighbour: f64,
    /// Hard elements are split into four or eight this many times, and each part is integrated with 7 points
    /// (triangles) or 14 (tetrahedra), exact for polynomials of degree 5. Up to 4.
    pub refinements: u32,
}

impl Default for ElementWindingSettings {
    fn default() -> Self {
        Self { from_integer: 0.05, from_neighbour: 0.5, refinements: 0 }
    }
}

/// Integral means of the winding number over elements.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ElementWinding {
    /// For each element `w(e) = (1/V)∫w dV`.
    pub means: Vec<f64>,
    /// Elements that needed more than the barycentre.
    pub hard: usize,
    /// How often the winding number was evaluated.
    pub evaluations: usize,
}

/// The integral mean of the winding number over each element (thesis 8.5.1): its value at the barycentre, or, where
/// that is not near an integer or differs from a neighbour's, a symmetric quadrature.
///
/// `vertices`: n×D positions; `elements`: m×K corners, triangles in the plane (D = 2, K = 3) or tetrahedra (D = 3, K =
/// 4); `neighbours`: m×K, the element across each facet, `u32::MAX` for none. Neighbours may be empty, and facets known
/// to be on the surface may be `u32::MAX`: the winding number is expected to jump there, which makes no element hard.
/// `evaluate` returns the winding number at a point and is called from several threads; the result does not depend on
/// how many. See [`Progress`] for `progress`.
pub fn element_winding<const D: usize, const K: usize>(
    vertices: &[[f64; D]],
    elements: &[[u32; K]],
    neighbours: &[[u32; K]],
    evaluate: &(impl Fn([f64; D]) -> f64 + Sync),
    settings: &ElementWindingSettings,
    progress: Progress<'_>,
) -> Result<ElementWinding, SegmentationError> {
    const { assert!(K == D + 1 && (K == 3 || K == 4), "elements are triangles in the plane or tetrahedra") };
    check(vertices, elements, neighbours, settings)?;
    let at_barycentre: Rule<K> = vec![([1.0 / K as f64; K], 1.0)];
    let mut report = stage(progress, "computing winding numbers");
    // Half of the progress each: there are few hard elements, but each is a dozen points.
    let all: Vec<usize> = (0..elements.len()).collect();
    let integrate = |rule: &Rule<K>, element: usize| mean(vertices, &elements[element], evaluate, rule);
    let mut means = in_chunks(&all, &|element| integrate(&at_barycentre, element), &mut |done| report(0.5 * done))?;
    let is_hard = |&element: &usize| {
        let w = means[element];
        let apart = |&n: &u32| n != OUTSIDE && (means[n as usize] - w).abs() > settings.from_neighbour;
        (w - w.round()).abs() > settings.from_integer
            || neighbours.get(element).is_some_and(|row| row.iter().any(apart))
    };
    let hard: Vec<usize> = all.par_iter().copied().filter(is_hard).collect();
    let rule = symmetric_rule(settings.refinements).unwrap_or(at_barycentre);
    let better = in_chunks(&hard, &|element| integrate(&rule, element), &mut |done| report(0.5 + 0.5 * done))?;
    for (&element, value) in hard.iter().zip(better) {
        means[element] = value;
    }
    Ok(ElementWinding { means, hard: hard.len(), evaluations: elements.len() + hard.len() * rule.len() })
}

/// The values of elements, in order, with a report after each chunk.
fn in_chunks(
    elements: &[usize],
    value: &(impl Fn(usize) -> f64 + Sync),
    progress: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<f64>, SegmentationError> {
    let mut values = Vec::with_capacity(elements.len());
    for chunk in elements.chunks(CHUNK) {
        if progress(values.len() as f64 / elements.len() as f64).is_break() {
            return Err(SegmentationError::Cancelled);
        }
        values.par_extend(chunk.par_iter().map(|&element| value(element)));
        let first = values.len() - chunk.len();
        if let Some(k) = values[first..].iter().position(|&w| !is_plausible(w)) {
            return Err(SegmentationError::BadWinding { element: chunk[k], value: values[first + k] });
        }
    }
    Ok(values)
}

fn mean<const D: usize, const K: usize>(
    vertices: &[[f64; D]],
    corners: &[u32; K],
    evaluate: &impl Fn([f64; D]) -> f64,
    rule: &Rule<K>,
) -> f64 {
    let point = |at: &[f64; K]| -> [f64; D] {
        std::array::from_fn(|axis| (0..K).map(|k| at[k] * vertices[corners[k] as usize][axis]).sum())
    };
    rule.iter().map(|(at, weight)| weight * evaluate(point(at))).sum()
}

fn check<const D: usize, const K: usize>(
    vertices: &[[f64; D]],
    elements: &[[u32; K]],
    neighbours: &[[u32; K]],
    settings: &ElementWindingSettings,
) -> Result<(), SegmentationError> {
    let count = elements.len();
    if count >= OUTSIDE as usize {
        return Err(SegmentationError::TooManyElements { elements: count });
    }
    for (what, value, good) in [
        ("the distance from an integer", settings.from_integer, settings.from_integer >= 0.0),
        ("the distance from a neighbour", settings.from_neighbour, settings.from_neighbour > 0.0),
        ("the number of refinements", f64::from(settings.refinements), settings.refinements <= MOST_REFINEMENTS),
    ] {
        if !good {
            return Err(SegmentationError::BadSetting { what, value });
        }
    }
    if !neighbours.is_empty() && neighbours.len() != count {
        let (what, found) = ("rows of neighbours", neighbours.len());
        return Err(SegmentationError::WrongLength { what, found, elements: count });
    }
    let known = |&n: &u32| n == OUTSIDE || (n as usize) < count;
    for (element, row) in neighbours.iter().enumerate() {
        if let Some(&neighbour) = row.iter().find(|n| !known(n)) {
            return Err(SegmentationError::BadNeighbour { element, neighbour });
        }
    }
    for (element, row) in elements.iter().enumerate() {
        for &vertex in row {
            let Some(place) = vertices.get(vertex as usize) else {
                return Err(SegmentationError::BadCorner { element, vertex, vertices: vertices.len() });
            };
            if !place.iter().all(|c| c.is_finite()) {
                return Err(SegmentationError::BadCoordinate { element, vertex });
            }
        }
    }
    Ok(())
}
