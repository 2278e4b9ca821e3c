//! Sparse matrices of small blocks: four columns for each handle.

use crate::dense::Dense;

/// A matrix of R×4 blocks, block row by block row; block columns ascending within each.
#[derive(Clone, Debug, Default)]
pub(super) struct BlockRows<const R: usize> {
    rows: Vec<Vec<(u32, [[f64; 4]; R])>>,
}

impl<const R: usize> BlockRows<R> {
    pub(super) fn zeros(rows: usize) -> Self {
        Self { rows: vec![Vec::new(); rows] }
    }

    /// Number of block rows.
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    pub(super) fn row(&self, row: usize) -> &[(u32, [[f64; 4]; R])] {
        &self.rows[row]
    }

    pub(super) fn push_row(&mut self, row: Vec<(u32, [[f64; 4]; R])>) {
        self.rows.push(row);
    }

    /// A block to add to; zeros where nothing is stored yet.
    pub(super) fn at_mut(&mut self, row: usize, column: u32) -> &mut [[f64; 4]; R] {
        let row = &mut self.rows[row];
        let place = match row.binary_search_by_key(&column, |(own, _)| *own) {
            Ok(place) => place,
            Err(place) => {
                row.insert(place, (column, [[0.0; 4]; R]));
                place
            }
        };
        &mut row[place].1
    }

    /// How many blocks are stored.
    pub(super) fn stored(&self) -> usize {
        self.rows.iter().map(Vec::len).sum()
    }

    /// All entries, with this many block columns.
    pub(super) fn to_dense(&self, columns: usize) -> Dense {
        let mut out = Dense::zeros(R * self.rows.len(), 4 * columns);
        for (number, row) in self.rows.iter().enumerate() {
            for (column, block) in row {
                for (part, values) in block.iter().enumerate() {
                    out.row_mut(R * number + part)[4 * *column as usize..][..4].copy_from_slice(values);
                }
            }
        }
        out
    }
}

impl BlockRows<4> {
    /// An entry of the main diagonal.
    pub(super) fn diagonal(&self, entry: usize) -> f64 {
        let block = self.rows[entry / 4].binary_search_by_key(&(entry as u32 / 4), |(own, _)| *own);
        block.map_or(0.0, |place| self.rows[entry / 4][place].1[entry % 4][entry % 4])
    }

    pub(super) fn largest_diagonal(&self) -> f64 {
        (0..4 * self.rows.len()).fold(0.0_f64, |largest, i| largest.max(self.diagonal(i)))
    }

    /// Writes `self · vector`.
    pub(super) fn times_vector(&self, vector: &[f64], out: &mut [f64]) {
        for (row, out) in self.rows.iter().zip(out.as_chunks_mut::<4>().0) {
            *out = [0.0; 4];
            for (column, block) in row {
                let four = &vector[4 * *column as usize..][..4];
                for (out, values) in out.iter_mut().zip(block) {
                    *out += values.iter().zip(four).map(|(a, b)| a * b).sum::<f64>();
                }
            }
        }
    }
}
