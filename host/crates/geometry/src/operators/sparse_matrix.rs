//! A sparse matrix as three plain arrays, for any solver the caller has.

/// Compressed sparse columns: rows within a column strictly ascending, no duplicates.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SparseMatrix {
    rows: usize,
    columns: usize,
    column_starts: Vec<usize>,
    row_indices: Vec<usize>,
    values: Vec<f64>,
}

/// Why a list of entries is not a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("entry {entry} is at ({row}, {column}), outside a {rows}×{columns} matrix")]
pub struct EntryOutOfRange {
    /// Zero-based entry in the given list.
    pub entry: usize,
    /// Its row.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// Rows of the matrix.
    pub rows: usize,
    /// Columns of the matrix.
    pub columns: usize,
}

impl SparseMatrix {
    /// Sums `(row, column, value)` entries into a matrix; entries at one place are added in list order, so that equal
    /// lists give equal bits.
    pub fn from_triplets(rows: usize, columns: usize, triplets: &[(u32, u32, f64)]) -> Result<Self, EntryOutOfRange> {
        let offending = triplets.iter().position(|&(r, c, _)| r as usize >= rows || c as usize >= columns);
        if let Some(entry) = offending {
            let (row, column, _) = triplets[entry];
            return Err(EntryOutOfRange { entry, row: row as usize, column: column as usize, rows, columns });
        }
        Ok(Self::assemble(rows, columns, triplets))
    }

    /// Like [`Self::from_triplets`], for entries known to be in range.
    pub(crate) fn assemble(rows: usize, columns: usize, triplets: &[(u32, u32, f64)]) -> Self {
        // Two stable counting sorts, by row and then by column, leave the rows of each column ascending and entries at
        // one place in list order.
        let by_row = stable_order(rows, triplets.len(), |i| i, |i| triplets[i].0 as usize).1;
        let (starts, order) = stable_order(columns, triplets.len(), |i| by_row[i], |i| triplets[i].1 as usize);
        let mut column_starts = Vec::with_capacity(columns + 1);
        let mut row_indices = Vec::with_capacity(triplets.len());
        let mut values: Vec<f64> = Vec::with_capacity(triplets.len());
        column_starts.push(0);
        for column in 0..columns {
            let first = row_indices.len();
            for &entry in &order[starts[column]..starts[column + 1]] {
                let (row, _, value) = triplets[entry];
                match values.last_mut() {
                    Some(last) if row_indices.len() > first && row_indices.last() == Some(&(row as usize)) => {
                        *last += value;
                    }
                    _ => {
                        row_indices.push(row as usize);
                        values.push(value);
                    }
                }
            }
            column_starts.push(row_indices.len());
        }
        Self { rows, columns, column_starts, row_indices, values }
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Where each column starts in the two other arrays; `columns + 1` long.
    pub fn column_starts(&self) -> &[usize] {
        &self.column_starts
    }

    /// Row of every stored entry.
    pub fn row_indices(&self) -> &[usize] {
        &self.row_indices
    }

    /// Value of every stored entry.
    pub fn values(&self) -> &[f64] {
        &self.values
    }

    /// Value of every stored entry, to change in place; the pattern stays.
    pub fn values_mut(&mut self) -> &mut [f64] {
        &mut self.values
    }

    /// Number of stored entries.
    pub fn stored(&self) -> usize {
        self.values.len()
    }

    /// The stored entries of one column as `(row, value)`, rows ascending; empty for a column that does not exist.
    pub fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range =
            if column < self.columns { self.column_starts[column]..self.column_starts[column + 1] } else { 0..0 };
        self.row_indices[range.clone()].iter().copied().zip(self.values[range].iter().copied())
    }

    /// The entry at a place, zero where nothing is stored.
    pub fn get(&self, row: usize, column: usize) -> f64 {
        self.column(column).find(|&(r, _)| r == row).map_or(0.0, |(_, value)| value)
    }

    /// The main diagonal, zero where nothing is stored.
    pub fn diagonal(&self) -> Vec<f64> {
        (0..self.rows.min(self.columns)).map(|i| self.get(i, i)).collect()
    }

    /// `y = A x`.
    ///
    /// # Panics
    /// If `x` is not `columns` long.
    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.columns, "a vector as long as the matrix has columns");
        let mut y = vec![0.0; self.rows];
        for (column, &factor) in x.iter().enumerate() {
            for (row, value) in self.column(column) {
                y[row] += value * factor;
            }
        }
        y
    }

    /// The transpose; symmetric matrices come back unchanged.
    #[must_use]
    pub fn transpose(&self) -> Self {
        let mut triplets = Vec::with_capacity(self.stored());
        for column in 0..self.columns {
            triplets.extend(self.column(column).map(|(row, value)| (column as u32, row as u32, value)));
        }
        Self::assemble(self.columns, self.rows, &triplets)
    }
}

/// Counting sort: bucket starts and the item order, items of one bucket in the order `item` lists them.
fn stable_order(
    buckets: usize,
    count: usize,
    item: impl Fn(usize) -> usize,
    bucket_of: impl Fn(usize) -> usize,
) -> (Vec<usize>, Vec<usize>) {
    let mut starts = vec![0; buckets + 1];
    for i in 0..count {
        starts[bucket_of(i) + 1] += 1;
    }
    for bucket in 0..buckets {
        starts[bucket + 1] += starts[bucket];
    }
    let mut next = starts.clone();
    let mut order = vec![0; count];
    for i in 0..count {
        let item = item(i);
        let slot = &mut next[bucket_of(item)];
        order[*slot] = item;
        *slot += 1;
    }
    (starts, order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_at_one_place_are_added() {
        let a = SparseMatrix::from_triplets(2, 3, &[(1, 2, 1.0), (0, 0, 2.0), (1, 2, 3.0), (0, 2, -1.0)]).unwrap();
        assert_eq!(a.column_starts(), [0, 1, 1, 3]);
        assert_eq!(a.row_indices(), [0, 0, 1]);
        assert_eq!(a.values(), [2.0, -1.0, 4.0]);
        assert_eq!(a.multiply(&[1.0, 5.0, 2.0]), [0.0, 8.0]);
        assert_eq!(a.transpose().multiply(&[1.0, 1.0]), [2.0, 0.0, 3.0]);
        assert_eq!(a.diagonal(), [2.0, 0.0]);
    }

    #[test]
    fn nonsense_is_named() {
        let error = SparseMatrix::from_triplets(2, 2, &[(0, 0, 1.0), (0, 2, 1.0)]).unwrap_err();
        assert_eq!(error, EntryOutOfRange { entry: 1, row: 0, column: 2, rows: 2, columns: 2 });
        let empty = SparseMatrix::from_triplets(0, 0, &[]).unwrap();
        assert_eq!(empty.multiply(&[]), Vec::<f64>::new());
    }
}
