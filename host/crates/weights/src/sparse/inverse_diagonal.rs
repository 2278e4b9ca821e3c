//! The diagonal of a sparse matrix's inverse by selected inversion (Takahashi et al. 1973; by supernodes as in Lin et
//! al. 2011, "SelInv"): entries of the inverse where the Cholesky factor has entries, computed from the last column
//! back to the first. Costs about as much as two factorisations.

use faer::linalg::matmul::matmul;
use faer::linalg::triangular_solve::solve_upper_triangular_in_place;
use faer::{Accum, Mat, MatMut, MatRef, Par};

use super::block::Block;
use super::cholesky::SparseCholesky;

/// `diag(A⁻¹)` in the factor's elimination order.
pub(crate) fn inverse_diagonal(factor: &SparseCholesky) -> Vec<f64> {
    let blocks = factor.blocks();
    let mut diagonal = vec![0.0; factor.rows()];
    let mut block_of = vec![0_usize; factor.rows()];
    for (index, block) in blocks.iter().enumerate() {
        block_of[block.start..block.start + block.width].fill(index);
    }
    let mut inverse: Vec<Mat<f64>> = blocks.iter().map(|_| Mat::new()).collect();
    for (index, block) in blocks.iter().enumerate().rev() {
        let below = gather(&blocks, &block_of, &inverse, block.pattern);
        let here = invert_block(block, below.as_ref());
        for k in 0..block.width {
            diagonal[block.start + k] = here[(k, k)];
        }
        inverse[index] = here;
    }
    diagonal
}

/// The inverse restricted to the rows of `pattern`, symmetric; later blocks already hold it.
fn gather(blocks: &[Block<'_>], block_of: &[usize], inverse: &[Mat<f64>], pattern: &[usize]) -> Mat<f64> {
    let mut among = Mat::zeros(pattern.len(), pattern.len());
    for (b, &column) in pattern.iter().enumerate() {
        let owner = &blocks[block_of[column]];
        let from = &inverse[block_of[column]];
        let mut at = 0;
        for (a, &row) in pattern.iter().enumerate().skip(b) {
            let local = if row < owner.start + owner.width {
                row - owner.start
            } else {
                while owner.pattern[at] < row {
                    at += 1;
                }
                owner.width + at
            };
            let value = from[(local, column - owner.start)];
            among[(a, b)] = value;
            among[(b, a)] = value;
        }
    }
    among
}

/// The inverse's entries of one block: with `Y = L_P L_D⁻¹`, `Z_PD = -Z_PP Y` and
/// `Z_DD = (L_D L_Dᵀ)⁻¹ - Yᵀ Z_PD`.
fn invert_block(block: &Block<'_>, below: MatRef<'_, f64>) -> Mat<f64> {
    let (width, height) = (block.width, block.pattern.len());
    let stored = MatRef::from_column_major_slice(block.values, width + height, width);
    let lower = stored.subrows(0, width);
    // Yᵀ = L_D⁻ᵀ L_Pᵀ, and L_D⁻ᵀ itself.
    let mut y_transposed = stored.subrows(width, height).transpose().to_owned();
    solve_upper_triangular_in_place(lower.transpose(), y_transposed.as_mut(), Par::Seq);
    let mut root = Mat::<f64>::identity(width, width);
    solve_upper_triangular_in_place(lower.transpose(), root.as_mut(), Par::Seq);
    let mut here = Mat::zeros(width + height, width);
    let (mut diagonal, mut rest): (MatMut<'_, f64>, MatMut<'_, f64>) = here.as_mut().split_at_row_mut(width);
    matmul(rest.as_mut(), Accum::Replace, below, y_transposed.transpose(), -1.0, Par::Seq);
    matmul(diagonal.as_mut(), Accum::Replace, root.as_ref(), root.transpose(), 1.0, Par::Seq);
    matmul(diagonal.as_mut(), Accum::Add, y_transposed.as_ref(), rest.as_ref(), -1.0, Par::Seq);
    here
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid's Laplacian plus a small diagonal, as an upper triangle; wide enough for supernodes.
    fn grid(side: usize) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in 0..side * side {
            let (x, y) = (column % side, column / side);
            let mut put = |row: usize, value: f64| {
                rows.push(row);
                values.push(value);
            };
            if y > 0 {
                put(column - side, -1.0);
            }
            if x > 0 {
                put(column - 1, -1.0 - 0.01 * y as f64);
            }
            put(column, 4.5 + 0.1 * (column % 7) as f64);
            starts.push(rows.len());
        }
        (starts, rows, values)
    }

    #[test]
    fn agrees_with_solving_for_unit_vectors() {
        for side in [1, 3, 24] {
            let (starts, rows, values) = grid(side);
            let factor = SparseCholesky::of_upper_in_order(&starts, &rows, &values).unwrap();
            let diagonal = inverse_diagonal(&factor);
            for row in 0..side * side {
                let mut unit = vec![0.0; side * side];
                unit[row] = 1.0;
                let norm = factor.inverse_norm_squared(&mut unit.clone());
                assert!((norm - diagonal[row]).abs() < 1e-13, "{side}: {} for {norm}", diagonal[row]);
                factor.solve_here(&mut unit).unwrap();
                assert!((unit[row] - diagonal[row]).abs() < 1e-13, "{side}: {} for {}", diagonal[row], unit[row]);
            }
        }
    }
}
