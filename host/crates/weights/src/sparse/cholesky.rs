//! A sparse Cholesky factorisation: analysed once, factorised once, solved for many right-hand sides.

use std::sync::Arc;

use armature_geometry::operators::SparseMatrix;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};

use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side, Spec};
use rayon::prelude::*;

use super::block::Block;
use super::solve_one::{solve_lower, solve_upper};
use super::solve_together::{LANES, solve_together};

/// Right-hand sides solved together. A constant, so that results do not depend on the number of threads; eight keep the
/// factor's blocks busy and still leave work for every core with the twenty bones of a typical skeleton.
const BLOCK: usize = 8;

/// `A = L Lᵀ` under a fill-reducing permutation, for symmetric positive definite `A`.
#[derive(Debug)]
pub(crate) struct SparseCholesky {
    symbolic: Arc<SymbolicCholesky<usize>>,
    values: Vec<f64>,
}

/// A fill-reducing elimination order (approximate minimum degree) of a symmetric matrix, given by the pattern of its
/// upper triangle in compressed columns: position → row of the matrix.
pub(crate) fn elimination_order(starts: &[usize], rows: &[usize]) -> Result<Vec<usize>, CholeskyError> {
    let count = starts.len() - 1;
    let pattern = SymbolicSparseColMatRef::new_checked(count, count, starts, None, rows);
    factorize_symbolic_cholesky(pattern, Side::Upper, SymmetricOrdering::Amd, CholeskySymbolicParams::default())
        .ok()
        .and_then(|symbolic| Some(symbolic.perm()?.arrays().0.to_vec()))
        .ok_or(CholeskyError::OutOfMemory { rows: count })
}

/// One triangle of a symmetric matrix.
#[derive(Clone, Copy)]
struct Compressed<'a> {
    starts: &'a [usize],
    rows: &'a [usize],
    values: &'a [f64],
    side: Side,
}

/// Why the factorisation failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CholeskyError {
    /// Only square matrices are symmetric.
    #[error("a {rows}×{columns} matrix is not square")]
    NotSquare {
        /// Rows given.
        rows: usize,
        /// Columns given.
        columns: usize,
    },
    /// A pivot was zero, negative or NaN.
    #[error("the matrix is not positive definite (pivot {pivot} after reordering)")]
    NotPositiveDefinite {
        /// Zero-based pivot in elimination order.
        pivot: usize,
    },
    /// The factor does not fit in memory.
    #[error("not enough memory for the factorisation of {rows} unknowns")]
    OutOfMemory {
        /// Unknowns.
        rows: usize,
    },
}

impl SparseCholesky {
    /// Factorises `matrix`; only its lower triangle is read.
    pub(crate) fn new(matrix: &SparseMatrix) -> Result<Self, CholeskyError> {
        let rows = matrix.rows();
        if rows != matrix.columns() {
            return Err(CholeskyError::NotSquare { rows, columns: matrix.columns() });
        }
        let compressed = Compressed {
            starts: matrix.column_starts(),
            rows: matrix.row_indices(),
            values: matrix.values(),
            side: Side::Lower,
        };
        Self::factorise(compressed, SymmetricOrdering::Amd)
    }

    /// Factorises a matrix given by its upper triangle in compressed columns (rows ascending) without reordering: for
    /// submatrices of a matrix whose fill-reducing order is already known.
    pub(crate) fn of_upper_in_order(starts: &[usize], rows: &[usize], values: &[f64]) -> Result<Self, CholeskyError> {
        Self::factorise(Compressed { starts, rows, values, side: Side::Upper }, SymmetricOrdering::Identity)
    }

    fn factorise(matrix: Compressed<'_>, ordering: SymmetricOrdering<'_, usize>) -> Result<Self, CholeskyError> {
        let rows = matrix.starts.len() - 1;
        let out_of_memory = CholeskyError::OutOfMemory { rows };
        let pattern = SymbolicSparseColMatRef::new_checked(rows, rows, matrix.starts, None, matrix.rows);
        let symbolic = factorize_symbolic_cholesky(pattern, matrix.side, ordering, CholeskySymbolicParams::default())
            .map_err(|_| out_of_memory)?;
        Self::numeric(Arc::new(symbolic), matrix)
    }

    /// The factor of a matrix with the pattern of the one that this is the factor of, given in the same way.
    pub(crate) fn of_same_pattern(
        &self,
        starts: &[usize],
        rows: &[usize],
        values: &[f64],
    ) -> Result<Self, CholeskyError> {
        Self::numeric(Arc::clone(&self.symbolic), Compressed { starts, rows, values, side: Side::Upper })
    }

    fn numeric(symbolic: Arc<SymbolicCholesky<usize>>, matrix: Compressed<'_>) -> Result<Self, CholeskyError> {
        let rows = matrix.starts.len() - 1;
        let out_of_memory = CholeskyError::OutOfMemory { rows };
        let pattern = SymbolicSparseColMatRef::new_checked(rows, rows, matrix.starts, None, matrix.rows);
        let mut values = Vec::new();
        values.try_reserve_exact(symbolic.len_val()).map_err(|_| out_of_memory)?;
        values.resize(symbolic.len_val(), 0.0);
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| out_of_memory)?;
        symbolic
            .factorize_numeric_llt(
                &mut values,
                SparseColMatRef::new(pattern, matrix.values),
                matrix.side,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut buffer),
                Spec::default(),
            )
            .map_err(|LltError::NonPositivePivot { index }| CholeskyError::NotPositiveDefinite { pivot: index })?;
        Ok(Self { symbolic, values })
    }

    /// The factor, block by block, for algorithms that walk through it.
    pub(crate) fn blocks(&self) -> Vec<Block<'_>> {
        let values = self.values.as_slice();
        match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(simplicial) => {
                let (starts, rows) = (simplicial.col_ptr(), simplicial.row_idx());
                let column = |start: usize| {
                    let range = starts[start]..starts[start + 1];
                    Block { start, width: 1, pattern: &rows[range.start + 1..range.end], values: &values[range] }
                };
                (0..self.rows()).map(column).collect()
            }
            SymbolicCholeskyRaw::Supernodal(supernodal) => {
                let block = |index: usize| {
                    let node = supernodal.supernode(index);
                    let values = &values[supernodal.col_ptr_for_val()[index]..supernodal.col_ptr_for_val()[index + 1]];
                    let width = supernodal.supernode_end()[index] - node.start();
                    Block { start: node.start(), width, pattern: node.pattern(), values }
                };
                (0..supernodal.n_supernodes()).map(block).collect()
            }
        }
    }

    /// `‖L⁻¹ x‖²`, which is `xᵀ A⁻¹ x`, for a factor in its matrix's own order. Blocks that a sparse `x` does not reach
    /// cost nothing.
    pub(crate) fn inverse_norm_squared(&self, x: &mut [f64]) -> f64 {
        solve_lower(&self.blocks(), x);
        x.iter().map(|value| value * value).sum()
    }

    /// Solves for a few right-hand sides at once, column after column, on this thread.
    pub(crate) fn solve_here(&self, columns: &mut [f64]) -> Result<(), CholeskyError> {
        let rows = self.rows();
        if rows == 0 {
            return Ok(());
        }
        if self.symbolic.perm().is_some() {
            return self.solve_block(columns);
        }
        let blocks = self.blocks();
        if columns.len() == rows {
            solve_lower(&blocks, columns);
            solve_upper(&blocks, columns);
            return Ok(());
        }
        let mut together = vec![[0.0; LANES]; rows];
        for columns in columns.chunks_mut(rows * LANES) {
            for (lane, column) in columns.chunks(rows).enumerate() {
                together.iter_mut().zip(column).for_each(|(row, value)| row[lane] = *value);
            }
            solve_together(&blocks, &mut together);
            for (lane, column) in columns.chunks_mut(rows).enumerate() {
                together.iter().zip(column).for_each(|(row, value)| *value = row[lane]);
            }
        }
        Ok(())
    }

    /// Number of unknowns.
    pub(crate) fn rows(&self) -> usize {
        self.symbolic.nrows()
    }

    /// Number of entries stored in the factor.
    pub(crate) fn stored(&self) -> usize {
        self.values.len()
    }

    /// Replaces right-hand sides, column after column, with solutions. Blocks of columns run in parallel; `between` is
    /// called before each round of blocks with the number of columns done, and may stop the work by returning `false`.
    /// Returns whether all were solved.
    ///
    /// # Panics
    /// If the length of `columns` is not a multiple of the number of unknowns.
    pub(crate) fn solve_in_place(
        &self,
        columns: &mut [f64],
        mut between: impl FnMut(usize) -> bool,
    ) -> Result<bool, CholeskyError> {
        let rows = self.rows();
        if rows == 0 {
            return Ok(true);
        }
        assert!(columns.len().is_multiple_of(rows), "whole columns of {rows} unknowns");
        let round = BLOCK * rayon::current_num_threads().max(1);
        for (index, group) in columns.chunks_mut(rows * round).enumerate() {
            if !between(index * round) {
                return Ok(false);
            }
            group.par_chunks_mut(rows * BLOCK).try_for_each(|block| self.solve_block(block))?;
        }
        Ok(true)
    }

    fn solve_block(&self, block: &mut [f64]) -> Result<(), CholeskyError> {
        let rows = self.rows();
        let count = block.len() / rows;
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
        let mut buffer = MemBuffer::try_new(scratch).map_err(|_| CholeskyError::OutOfMemory { rows })?;
        LltRef::new(&self.symbolic, self.values.as_slice()).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(block, rows, count),
            Par::Seq,
            MemStack::new(&mut buffer),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chain(n: u32) -> SparseMatrix {
        let mut triplets = Vec::new();
        for i in 0..n {
            triplets.push((i, i, 2.0 + 0.01 * f64::from(i)));
            if i + 1 < n {
                triplets.push((i, i + 1, -1.0));
                triplets.push((i + 1, i, -1.0));
            }
        }
        SparseMatrix::from_triplets(n as usize, n as usize, &triplets).unwrap()
    }

    #[test]
    fn solves_what_was_multiplied() {
        let n = 50;
        let a = chain(n);
        let factor = SparseCholesky::new(&a).unwrap();
        let x: Vec<f64> = (0..n * 11).map(saw).collect();
        let mut b: Vec<f64> = x.chunks(n as usize).flat_map(|column| a.multiply(column)).collect();
        assert_eq!(factor.solve_in_place(&mut b, |_| true), Ok(true));
        let error = b.iter().zip(&x).map(|(got, want)| (got - want).abs()).fold(0.0, f64::max);
        assert!(error < 1e-11, "error {error}");
        assert_eq!(factor.solve_in_place(&mut b, |_| false), Ok(false));
    }

    #[test]
    fn columns_solved_together_and_alone_are_those_of_faer() {
        // A chain and a wide band: blocks of one column and of many.
        for (n, band) in [(50_u32, 1), (90, 30), (7, 6)] {
            let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
            for column in 0..n {
                for row in column.saturating_sub(band)..=column {
                    rows.push(row as usize);
                    values.push(if row == column { 2.0 * f64::from(band) } else { 0.4 * saw(row * column) });
                }
                starts.push(rows.len());
            }
            let factor = SparseCholesky::of_upper_in_order(&starts, &rows, &values).unwrap();
            for count in [2, 5, 8, 11] {
                let mut together: Vec<f64> = (0..n * count).map(saw).collect();
                let (mut alone, mut by_faer) = (together.clone(), together.clone());
                factor.solve_here(&mut together).unwrap();
                alone.chunks_mut(n as usize).for_each(|column| factor.solve_here(column).unwrap());
                factor.solve_in_place(&mut by_faer, |_| true).unwrap();
                for own in [together, alone] {
                    let error = own.iter().zip(&by_faer).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                    assert!(error < 1e-13, "{n} rows, {count} columns: {error}");
                }
            }
        }
    }

    fn saw(i: u32) -> f64 {
        f64::from((i * 7919) % 1000) / 500.0 - 1.0
    }

    #[test]
    fn nonsense_is_named() {
        let indefinite = SparseMatrix::from_triplets(2, 2, &[(0, 0, 1.0), (1, 1, -1.0)]).unwrap();
        assert!(matches!(SparseCholesky::new(&indefinite), Err(CholeskyError::NotPositiveDefinite { .. })));
        let nan = SparseMatrix::from_triplets(1, 1, &[(0, 0, f64::NAN)]).unwrap();
        assert!(matches!(SparseCholesky::new(&nan), Err(CholeskyError::NotPositiveDefinite { .. })));
        let wide = SparseMatrix::from_triplets(1, 2, &[]).unwrap();
        assert!(matches!(SparseCholesky::new(&wide), Err(CholeskyError::NotSquare { .. })));
        let empty = SparseMatrix::from_triplets(0, 0, &[]).unwrap();
        assert_eq!(SparseCholesky::new(&empty).unwrap().solve_in_place(&mut [], |_| true), Ok(true));
    }
}
