//! Dirichlet and Neumann conditions on the Laplace and Poisson equations (thesis 2.1 and 2.1.1).

use armature_geometry::operators::SparseMatrix;

use crate::sparse::cholesky::{CholeskyError, SparseCholesky};

/// Steps of iterative refinement: on meshes with slivers the first solution has lost digits.
const REFINEMENTS: usize = 2;

/// `Δu = 0` inside, `u` given at some vertices and the flux `∂u/∂n` at others; where neither is given there is no flux.
#[derive(Clone, Copy, Debug)]
pub struct HarmonicProblem<'a> {
    /// n×n Laplacian, as [`armature_geometry::operators`] builds it: symmetric, conductances off the diagonal, rows that
    /// sum to zero.
    pub laplacian: &'a SparseMatrix,
    /// Vertices whose values are given, each once.
    pub fixed: &'a [usize],
    /// Their values.
    pub values: &'a [f64],
    /// Flux into the domain at a vertex, `∫ g φ` over its part of the boundary (thesis eq. 2.25); or of a source inside.
    pub flux: &'a [(usize, f64)],
}

/// The solution.
#[derive(Clone, Debug, PartialEq)]
pub struct HarmonicFunction {
    /// One value for each vertex; zero in pieces without a given value.
    pub values: Vec<f64>,
    /// Largest imbalance of flux at a free vertex, over the largest flux along any edge or given.
    pub residual: f64,
    /// Vertices in pieces without a given value, ascending.
    pub unreached: Vec<usize>,
}

/// Why a harmonic function cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HarmonicError {
    /// Arrays do not fit each other.
    #[error("{what}: {given} entries where {wanted} are needed")]
    Size {
        /// Which.
        what: &'static str,
        /// Its length.
        given: usize,
        /// The length it should have.
        wanted: usize,
    },
    /// A vertex does not exist.
    #[error("vertex {vertex} does not exist: there are {vertices}")]
    NoSuchVertex {
        /// The vertex.
        vertex: usize,
        /// How many there are.
        vertices: usize,
    },
    /// A vertex has two given values.
    #[error("vertex {vertex} is given two values")]
    FixedTwice {
        /// The vertex.
        vertex: usize,
    },
    /// A given number is not finite.
    #[error("{what} at vertex {vertex} is not a finite number")]
    NotFinite {
        /// A value, a flux or the Laplacian.
        what: &'static str,
        /// The vertex.
        vertex: usize,
    },
    /// Flux alone leaves a constant undetermined, and does not balance.
    #[error("vertex {vertex} is given a flux, but no vertex of its piece of the mesh a value; give one there")]
    FluxWithoutValue {
        /// The vertex.
        vertex: usize,
    },
    /// The Laplacian is not that of a mesh, or its elements are degenerate.
    #[error("the Laplacian could not be factorised: {0}; repair degenerate elements, or make conductances positive")]
    Factorisation(#[from] CholeskyError),
}

/// Solves for the free values.
pub fn harmonic_function(problem: &HarmonicProblem<'_>) -> Result<HarmonicFunction, HarmonicError> {
    let HarmonicProblem { laplacian, fixed, values: given, flux } = *problem;
    let n = laplacian.columns();
    check(problem)?;
    let mut values = vec![0.0; n];
    let mut is_fixed = vec![false; n];
    for (&vertex, &value) in fixed.iter().zip(given) {
        (values[vertex], is_fixed[vertex]) = (value, true);
    }
    let reached = reached(laplacian, fixed);
    if let Some(&(vertex, _)) = flux.iter().find(|(vertex, _)| !reached[*vertex]) {
        return Err(HarmonicError::FluxWithoutValue { vertex });
    }
    let free: Vec<usize> = (0..n).filter(|&vertex| reached[vertex] && !is_fixed[vertex]).collect();
    let mut place = vec![usize::MAX; n];
    free.iter().enumerate().for_each(|(k, &vertex)| place[vertex] = k);
    let mut entries = Vec::new();
    for (k, &vertex) in free.iter().enumerate() {
        let column = laplacian.column(vertex).filter(|&(row, _)| place[row] != usize::MAX);
        entries.extend(column.map(|(row, value)| (place[row] as u32, k as u32, -value)));
    }
    let matrix = SparseMatrix::from_triplets(free.len(), free.len(), &entries)
        .map_err(|e| HarmonicError::NoSuchVertex { vertex: e.row, vertices: n })?;
    let factor = SparseCholesky::new(&matrix)?;
    let mut imbalance = imbalance(problem, &values);
    for _ in 0..=REFINEMENTS {
        let mut step: Vec<f64> = free.iter().map(|&vertex| imbalance[vertex]).collect();
        factor.solve_here(&mut step)?;
        free.iter().zip(step).for_each(|(&vertex, step)| values[vertex] += step);
        imbalance = self::imbalance(problem, &values);
    }
    let edges = free.iter().flat_map(|&v| laplacian.column(v).map(move |(row, value)| (v, row, value)));
    let largest = edges
        .map(|(v, row, value)| (value * (values[row] - values[v])).abs())
        .chain(flux.iter().map(|(_, flux)| flux.abs()))
        .fold(0.0, f64::max);
    let worst = free.iter().map(|&vertex| imbalance[vertex].abs()).fold(0.0, f64::max);
    let unreached = (0..n).filter(|&vertex| !reached[vertex]).collect();
    Ok(HarmonicFunction { values, residual: if worst == 0.0 { 0.0 } else { worst / largest }, unreached })
}

/// `flux + L u`, from differences so that a constant has none.
fn imbalance(problem: &HarmonicProblem<'_>, values: &[f64]) -> Vec<f64> {
    let mut imbalance: Vec<f64> = (0..values.len())
        .map(|vertex| {
            let column = problem.laplacian.column(vertex);
            column.map(|(row, conductance)| conductance * (values[row] - values[vertex])).sum()
        })
        .collect();
    problem.flux.iter().for_each(|&(vertex, flux)| imbalance[vertex] += flux);
    imbalance
}

fn check(problem: &HarmonicProblem<'_>) -> Result<(), HarmonicError> {
    let HarmonicProblem { laplacian, fixed, values, flux } = *problem;
    let n = laplacian.columns();
    let size = |what, given, wanted| {
        if given == wanted { Ok(()) } else { Err(HarmonicError::Size { what, given, wanted }) }
    };
    size("rows of the Laplacian", laplacian.rows(), n)?;
    size("values", values.len(), fixed.len())?;
    let mut taken = vec![false; n];
    for (&vertex, value) in fixed.iter().zip(values) {
        let place = taken.get_mut(vertex).ok_or(HarmonicError::NoSuchVertex { vertex, vertices: n })?;
        if std::mem::replace(place, true) {
            return Err(HarmonicError::FixedTwice { vertex });
        }
        if !value.is_finite() {
            return Err(HarmonicError::NotFinite { what: "the value given", vertex });
        }
    }
    for &(vertex, flux) in flux {
        if vertex >= n {
            return Err(HarmonicError::NoSuchVertex { vertex, vertices: n });
        }
        if !flux.is_finite() {
            return Err(HarmonicError::NotFinite { what: "the flux", vertex });
        }
    }
    match (0..n).find(|&vertex| laplacian.column(vertex).any(|(_, value)| !value.is_finite())) {
        Some(vertex) => Err(HarmonicError::NotFinite { what: "the Laplacian", vertex }),
        None => Ok(()),
    }
}

/// Which vertices are connected to one of `start`.
fn reached(laplacian: &SparseMatrix, start: &[usize]) -> Vec<bool> {
    let mut reached = vec![false; laplacian.columns()];
    start.iter().for_each(|&vertex| reached[vertex] = true);
    let mut open = start.to_vec();
    while let Some(vertex) = open.pop() {
        let around = laplacian.column(vertex).filter(|(_, value)| *value != 0.0);
        open.extend(around.map(|(row, _)| row).filter(|&row| !std::mem::replace(&mut reached[row], true)));
    }
    reached
}
