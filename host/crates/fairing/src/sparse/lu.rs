//! A sparse LU factorisation with partial pivoting, for systems that are symmetric but indefinite.

use armature_geometry::operators::SparseMatrix;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::LuError;
use faer::sparse::linalg::lu::{LuRef, LuSymbolicParams, NumericLu, SymbolicLu, factorize_symbolic_lu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Spec};

use super::FactorError;

/// `P A Q = L U`.
#[derive(Debug)]
pub(crate) struct Lu {
    symbolic: SymbolicLu<usize>,
    numeric: NumericLu<usize, f64>,
}

impl Lu {
    /// Factorises a square matrix.
    pub(crate) fn new(matrix: &SparseMatrix) -> Result<Self, FactorError> {
        let rows = matrix.rows();
        let pattern =
            SymbolicSparseColMatRef::new_checked(rows, rows, matrix.column_starts(), None, matrix.row_indices());
        let symbolic =
            factorize_symbolic_lu(pattern, LuSymbolicParams::default()).map_err(|_| FactorError::OutOfMemory)?;
        let scratch = symbolic.factorize_numeric_lu_scratch::<f64>(Par::Seq, Spec::default());
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| FactorError::OutOfMemory)?;
        let mut numeric = NumericLu::new();
        symbolic
            .factorize_numeric_lu(
                &mut numeric,
                SparseColMatRef::new(pattern, matrix.values()),
                Par::Seq,
                MemStack::new(&mut buffer),
                Spec::default(),
            )
            .map_err(|error| match error {
                LuError::Generic(_) => FactorError::OutOfMemory,
                LuError::SymbolicSingular { .. } => FactorError::Singular,
            })?;
        Ok(Self { symbolic, numeric })
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
        // The factors are made by `new` from the same symbolic factorisation.
        LuRef::new_unchecked(&self.symbolic, &self.numeric).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(columns, rows, count),
            Par::Seq,
            MemStack::new(&mut buffer),
        );
        Ok(())
    }
}
