//! Factorisations `L D Lᵀ` of symmetric quasi-definite matrices: positive definite in some rows and columns and negative
//! definite in the others, as conditions with multipliers are. Their factors exist in any order (Vanderbei 1995).

use armature_geometry::operators::SparseMatrix;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::ldlt::factor::LdltRegularization;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

use super::cholesky::CholeskyError;

/// The pattern of a matrix, analysed once for many values.
#[derive(Debug)]
pub(crate) struct QuasiDefinite {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl QuasiDefinite {
    /// For matrices with this lower triangle, every diagonal entry stored.
    pub(crate) fn analyse(lower: &SparseMatrix) -> Result<Self, CholeskyError> {
        let rows = lower.rows();
        let out_of_memory = CholeskyError::OutOfMemory { rows };
        let pattern =
            SymbolicSparseColMatRef::new_checked(rows, rows, lower.column_starts(), None, lower.row_indices());
        let ordering = SymmetricOrdering::Amd;
        let symbolic = factorize_symbolic_cholesky(pattern, Side::Lower, ordering, CholeskySymbolicParams::default())
            .map_err(|_| out_of_memory)?;
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|_| out_of_memory)?;
        values.resize(symbolic.len_val(), 0.0);
        Ok(Self { symbolic, values })
    }

    /// Factorises a matrix with the pattern that was analysed; `signs` are those of its diagonal, and entries are of order
    /// one.
    pub(crate) fn factorise(&mut self, lower: &SparseMatrix, signs: &[i8]) -> Result<(), CholeskyError> {
        let rows = lower.rows();
        let pattern =
            SymbolicSparseColMatRef::new_checked(rows, rows, lower.column_starts(), None, lower.row_indices());
        let scratch = self.symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Spec::default());
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| CholeskyError::OutOfMemory { rows })?;
        // A pivot that rounding has brought to zero, or to the wrong sign, becomes one: its unknown hardly moves.
        let regularization = LdltRegularization {
            dynamic_regularization_signs: Some(signs),
            dynamic_regularization_delta: 1.0,
            dynamic_regularization_epsilon: f64::MIN_POSITIVE,
        };
        self.symbolic
            .factorize_numeric_ldlt(
                &mut self.values,
                SparseColMatRef::new(pattern, lower.values()),
                Side::Lower,
                regularization,
                Par::Seq,
                MemStack::new(&mut buffer),
                Spec::default(),
            )
            .map_err(|faer::linalg::cholesky::ldlt::factor::LdltError::ZeroPivot { index }| {
                CholeskyError::NotPositiveDefinite { pivot: index }
            })?;
        Ok(())
    }

    /// Replaces a right-hand side with the solution.
    pub(crate) fn solve(&self, right: &mut [f64]) -> Result<(), CholeskyError> {
        let rows = right.len();
        if rows == 0 {
            return Ok(());
        }
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq);
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| CholeskyError::OutOfMemory { rows })?;
        LdltRef::new(&self.symbolic, self.values.as_slice()).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right, rows, 1),
            Par::Seq,
            MemStack::new(&mut buffer),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_saddle_point_is_solved() {
        // min x² + y² with x + y = 2: x = y = 1, and the multiplier is -2.
        let lower = [(0, 0, 2.0), (1, 1, 2.0), (2, 0, 1.0), (2, 1, 1.0), (2, 2, -1e-12)];
        let lower = SparseMatrix::from_triplets(3, 3, &lower).unwrap();
        let mut factor = QuasiDefinite::analyse(&lower).unwrap();
        factor.factorise(&lower, &[1, 1, -1]).unwrap();
        let mut solution = vec![0.0, 0.0, 2.0];
        factor.solve(&mut solution).unwrap();
        for (got, wanted) in solution.iter().zip([1.0, 1.0, -2.0]) {
            assert!((got - wanted).abs() < 1e-10, "{solution:?}");
        }
    }
}
