//! A quadratic energy and linear conditions.

use armature_geometry::operators::SparseMatrix;

use crate::progress::Stopped;
use crate::sparse::cholesky::CholeskyError;

/// `½ xᵀ Q x + xᵀ l + c` (thesis eq. 2.61) and the conditions on x.
#[derive(Clone, Debug)]
pub struct QuadraticProblem {
    /// Q: n×n, symmetric, positive semidefinite; positive definite on whatever the equalities leave free.
    pub quadratic: SparseMatrix,
    /// l: n numbers.
    pub linear: Vec<f64>,
    /// c: of no effect on the values, but gaps are relative to the energy with it.
    pub constant: f64,
    /// `A_eq x = b_eq` (thesis eq. 2.68). Rows that say the same are allowed; rows that contradict each other are noticed.
    pub equalities: LinearConditions,
    /// `A_ie x ≤ b_ie` (thesis eq. 2.85).
    pub inequalities: LinearConditions,
}

impl QuadraticProblem {
    /// The energy divided by the largest entry of Q, and that.
    pub(super) fn scaled(&self) -> (Self, f64) {
        let largest = self.quadratic.values().iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let largest = if largest > 0.0 { largest } else { 1.0 };
        let mut scaled = self.clone();
        let numbers = scaled.quadratic.values_mut().iter_mut().chain(&mut scaled.linear).chain([&mut scaled.constant]);
        numbers.for_each(|number| *number /= largest);
        (scaled, largest)
    }

    /// `½ xᵀ Q x + xᵀ l + c`.
    pub(super) fn energy(&self, x: &[f64]) -> f64 {
        let product = self.quadratic.multiply(x);
        x.iter().zip(&product).zip(&self.linear).map(|((x, product), l)| x * (0.5 * product + l)).sum::<f64>()
            + self.constant
    }
}

/// Rows of a matrix and what they are compared with.
#[derive(Clone, Debug)]
pub struct LinearConditions {
    /// One row for each condition, one column for each unknown.
    pub matrix: SparseMatrix,
    /// One for each condition.
    pub bounds: Vec<f64>,
}

impl LinearConditions {
    /// No conditions on this many unknowns.
    pub fn none(unknowns: usize) -> Self {
        Self { matrix: SparseMatrix::from_triplets(0, unknowns, &[]).unwrap_or_default(), bounds: Vec::new() }
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.bounds.len()
    }

    /// `A x - b`.
    pub(super) fn excess(&self, x: &[f64]) -> Vec<f64> {
        let mut excess = self.matrix.multiply(x);
        excess.iter_mut().zip(&self.bounds).for_each(|(excess, bound)| *excess -= bound);
        excess
    }

    /// Adds `Aᵀ y` to `sums`.
    pub(super) fn add_transposed(&self, y: &[f64], sums: &mut [f64]) {
        for (column, sum) in sums.iter_mut().enumerate() {
            *sum += self.matrix.column(column).map(|(row, value)| value * y[row]).sum::<f64>();
        }
    }
}

/// Why a quadratic problem cannot be solved.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum QuadraticError {
    /// Arrays do not fit each other.
    #[error("{what}: {given} where {wanted} are needed")]
    Size {
        /// Which.
        what: &'static str,
        /// How many there are.
        given: usize,
        /// How many there should be.
        wanted: usize,
    },
    /// A number is not finite.
    #[error("{what} holds {value}, which is not a finite number")]
    NotFinite {
        /// Where.
        what: &'static str,
        /// The number.
        value: f64,
    },
    /// Q is not symmetric.
    #[error("Q is not symmetric: its entries at ({row}, {column}) and ({column}, {row}) differ")]
    NotSymmetric {
        /// A row.
        row: usize,
        /// A column.
        column: usize,
    },
    /// The energy has no least value, or a matrix is too large.
    #[error(
        "the conditions could not be factorised: {0}; the energy must grow in every direction that they leave free"
    )]
    Factorisation(#[from] CholeskyError),
    /// The equalities contradict each other.
    #[error("no values meet all equalities: the closest miss one by {miss}")]
    Contradiction {
        /// By how much.
        miss: f64,
    },
    /// The progress callback asked to stop.
    #[error("stopped while {stage}")]
    Cancelled {
        /// What was being done.
        stage: &'static str,
    },
}

impl From<Stopped> for QuadraticError {
    fn from(Stopped { stage }: Stopped) -> Self {
        Self::Cancelled { stage }
    }
}

/// Entries that should be equal may differ by this, relative to the largest.
const ROUNDING: f64 = 1e-12;

/// Checks sizes and numbers.
pub(super) fn check(problem: &QuadraticProblem) -> Result<(), QuadraticError> {
    let QuadraticProblem { quadratic, linear, constant, equalities, inequalities } = problem;
    let n = linear.len();
    let size = |what, given, wanted| {
        if given == wanted { Ok(()) } else { Err(QuadraticError::Size { what, given, wanted }) }
    };
    size("rows of Q", quadratic.rows(), n)?;
    size("columns of Q", quadratic.columns(), n)?;
    size("columns of the equalities", equalities.matrix.columns(), n)?;
    size("rows of the equalities", equalities.matrix.rows(), equalities.bounds.len())?;
    size("columns of the inequalities", inequalities.matrix.columns(), n)?;
    size("rows of the inequalities", inequalities.matrix.rows(), inequalities.bounds.len())?;
    let finite = |what, values: &[f64]| match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(QuadraticError::NotFinite { what, value }),
        None => Ok(()),
    };
    finite("Q", quadratic.values())?;
    finite("l", linear)?;
    finite("c", &[*constant])?;
    finite("the matrix of the equalities", equalities.matrix.values())?;
    finite("the right side of the equalities", &equalities.bounds)?;
    finite("the matrix of the inequalities", inequalities.matrix.values())?;
    finite("the right side of the inequalities", &inequalities.bounds)?;
    let largest = quadratic.values().iter().fold(0.0_f64, |most, value| most.max(value.abs()));
    let transposed = quadratic.transpose();
    for column in 0..n {
        let (mut own, mut other) = (stored(quadratic, column), stored(&transposed, column));
        loop {
            match (own.next(), other.next()) {
                (None, None) => break,
                (Some((a, x)), Some((b, y))) if a == b && (x - y).abs() <= ROUNDING * largest => {}
                (a, b) => {
                    let row = a.into_iter().chain(b).map(|(row, _)| row).min().unwrap_or_default();
                    return Err(QuadraticError::NotSymmetric { row, column });
                }
            }
        }
    }
    Ok(())
}

fn stored(matrix: &SparseMatrix, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
    matrix.column(column).filter(|(_, value)| *value != 0.0)
}
