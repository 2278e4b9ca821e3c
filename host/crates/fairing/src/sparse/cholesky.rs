//! A sparse Cholesky factorisation: factorised once, solved again and again.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};

use super::FactorError;

/// `A = L Lᵀ` under a fill-reducing order, for symmetric positive definite `A`.
#[derive(Debug)]
pub(crate) struct Cholesky {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
}

impl Cholesky {
    /// Factorises a matrix given by its upper triangle in compressed columns, rows ascending.
    pub(crate) fn of_upper(starts: &[usize], rows: &[usize], values: &[f64]) -> Result<Self, FactorError> {
        let count = starts.len() - 1;
        let pattern = SymbolicSparseColMatRef::new_checked(count, count, starts, None, rows);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Upper,
            SymmetricOrdering::Amd,
            CholeskySymbolicParams::default(),
        )
        .map_err(|_| FactorError::OutOfMemory)?;
        let mut factor = Vec::new();
        factor.try_reserve_exact(symbolic.len_val()).map_err(|_| FactorError::OutOfMemory)?;
        factor.resize(symbolic.len_val(), 0.0);
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::OutOfMemory)?;
        symbolic
            .factorize_numeric_llt(
                &mut factor,
                SparseColMatRef::new(pattern, values),
                Side::Upper,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut buffer),
                Spec::default(),
            )
            .map_err(|_| FactorError::Singular)?;
        Ok(Self { symbolic, values: factor })
    }

    /// Replaces right-hand sides, column after column, with solutions.
    pub(crate) fn solve_in_place(&self, columns: &mut [f64]) -> Result<(), FactorError> {
        let rows = self.symbolic.nrows();
        if rows == 0 {
            return Ok(());
        }
        let count = columns.len() / rows;
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::OutOfMemory)?;
        LltRef::new(&self.symbolic, self.values.as_slice()).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(columns, rows, count),
            Par::Seq,
            MemStack::new(&mut buffer),
        );
        Ok(())
    }
}
