//! A sparse symmetric matrix, stored whole, parts of which are factorised again and again.

use armature_geometry::operators::SparseMatrix;

use super::cholesky::{CholeskyError, SparseCholesky, elimination_order};

/// A symmetric matrix in compressed columns, both triangles, rows ascending.
#[derive(Clone, Debug)]
pub(crate) struct Symmetric {
    starts: Vec<usize>,
    rows: Vec<u32>,
    values: Vec<f64>,
}

/// The upper triangle of a symmetric matrix in compressed columns, the diagonal last in each.
#[derive(Debug)]
pub(crate) struct Upper {
    pub(crate) starts: Vec<usize>,
    pub(crate) rows: Vec<usize>,
    pub(crate) values: Vec<f64>,
}

impl Upper {
    /// Where an entry of the upper triangle is stored.
    pub(crate) fn place(&self, row: usize, column: usize) -> Option<usize> {
        let range = self.starts[column]..self.starts[column + 1];
        self.rows[range.clone()].binary_search(&row).ok().map(|k| range.start + k)
    }
}

/// The place of a row that is not included.
const NONE: u32 = u32::MAX;

impl Symmetric {
    /// An empty matrix without columns.
    pub(crate) fn new() -> Self {
        Self { starts: vec![0], rows: Vec::new(), values: Vec::new() }
    }

    /// A matrix known to be symmetric.
    pub(crate) fn of(matrix: &SparseMatrix) -> Self {
        let mut copy = Self::new();
        for column in 0..matrix.columns() {
            matrix.column(column).for_each(|(row, value)| copy.push(row as u32, value));
            copy.end_column();
        }
        copy
    }

    /// Adds to stored entries, given by row and column; both triangles are to be given. Returns whether all are stored.
    pub(crate) fn add(&mut self, entries: impl Iterator<Item = (u32, u32, f64)>) -> bool {
        let mut all = true;
        for (row, column, value) in entries {
            let range = self.starts[column as usize]..self.starts[column as usize + 1];
            match self.rows[range.clone()].binary_search(&row) {
                Ok(k) => self.values[range.start + k] += value,
                Err(_) => all = false,
            }
        }
        all
    }

    /// Appends an entry to the column being built; rows ascend.
    pub(crate) fn push(&mut self, row: u32, value: f64) {
        self.rows.push(row);
        self.values.push(value);
    }

    /// Ends the column being built.
    pub(crate) fn end_column(&mut self) {
        self.starts.push(self.rows.len());
    }

    /// An order that keeps the Cholesky factor sparse: position → row.
    pub(crate) fn elimination_order(&self) -> Result<Vec<usize>, CholeskyError> {
        let (starts, rows, _) = self.upper_of(|_| true, &mut vec![NONE; self.len()]);
        elimination_order(&starts, &rows)
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// `A x` into `y`.
    pub(crate) fn multiply_into(&self, x: &[f64], y: &mut [f64]) {
        for (column, sum) in y.iter_mut().enumerate() {
            let range = self.starts[column]..self.starts[column + 1];
            let (rows, last_rows) = self.rows[range.clone()].as_chunks::<4>();
            let (values, last_values) = self.values[range].as_chunks::<4>();
            // Four sums do not wait for each other.
            let mut sums = [0.0; 4];
            for (rows, values) in rows.iter().zip(values) {
                for k in 0..4 {
                    sums[k] += values[k] * x[rows[k] as usize];
                }
            }
            let last = last_rows.iter().zip(last_values).map(|(&row, value)| value * x[row as usize]);
            *sum = (sums[0] + sums[1]) + (sums[2] + sums[3]) + last.sum::<f64>();
        }
    }

    /// Rows and values of one column, rows ascending.
    pub(crate) fn column(&self, column: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.starts[column]..self.starts[column + 1];
        self.rows[range.clone()].iter().map(|&row| row as usize).zip(self.values[range].iter().copied())
    }

    /// `A x` into `y`, for an `x` that is zero outside `places`.
    pub(crate) fn multiply_columns(&self, places: &[u32], x: &[f64], y: &mut [f64]) {
        if 2 * places.len() > self.len() {
            return self.multiply_into(x, y);
        }
        y.fill(0.0);
        for &k in places {
            let value = x[k as usize];
            self.column(k as usize).for_each(|(row, entry)| y[row] += entry * value);
        }
    }

    /// Rows and columns at `places` (ascending), and which of those rows had no entries anywhere else.
    pub(crate) fn at(&self, places: &[u32]) -> (Self, Vec<bool>) {
        let mut place = vec![NONE; self.len()];
        places.iter().enumerate().for_each(|(here, &k)| place[k as usize] = here as u32);
        let mut matrix = Self::new();
        let mut whole = Vec::with_capacity(places.len());
        for &k in places {
            let before = matrix.rows.len();
            let range = self.starts[k as usize]..self.starts[k as usize + 1];
            for (row, value) in self.rows[range.clone()].iter().zip(&self.values[range.clone()]) {
                if place[*row as usize] != NONE {
                    matrix.rows.push(place[*row as usize]);
                    matrix.values.push(*value);
                }
            }
            whole.push(matrix.rows.len() - before == range.len());
            matrix.starts.push(matrix.rows.len());
        }
        (matrix, whole)
    }

    /// The main diagonal.
    pub(crate) fn diagonal(&self) -> Vec<f64> {
        let at = |column: usize| {
            let range = self.starts[column]..self.starts[column + 1];
            self.rows[range.clone()].binary_search(&(column as u32)).map_or(0.0, |k| self.values[range.start + k])
        };
        (0..self.len()).map(at).collect()
    }

    /// The upper triangle of the rows and columns in `keep`, renumbered without gaps; `place` is scratch space as long
    /// as the matrix has rows.
    fn upper_of(&self, keep: impl Fn(usize) -> bool, place: &mut [u32]) -> (Vec<usize>, Vec<usize>, Vec<f64>) {
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        let mut count = 0;
        for column in 0..self.len() {
            if !keep(column) {
                place[column] = NONE;
                continue;
            }
            place[column] = count;
            count += 1;
            for k in self.starts[column]..self.starts[column + 1] {
                let row = self.rows[k] as usize;
                if row > column {
                    break;
                }
                if place[row] != NONE {
                    rows.push(place[row] as usize);
                    values.push(self.values[k]);
                }
            }
            starts.push(rows.len());
        }
        (starts, rows, values)
    }

    /// The upper triangle.
    pub(crate) fn upper(&self) -> Upper {
        let (starts, rows, values) = self.upper_of(|_| true, &mut vec![NONE; self.len()]);
        Upper { starts, rows, values }
    }

    /// Cholesky factor of the rows and columns in `keep`, in their present order.
    pub(crate) fn factorise_kept(&self, keep: impl Fn(usize) -> bool) -> Result<SparseCholesky, CholeskyError> {
        let (starts, rows, values) = self.upper_of(keep, &mut vec![NONE; self.len()]);
        SparseCholesky::of_upper_in_order(&starts, &rows, &values)
    }

    /// Cholesky factor of `A + diag(shift)`; an empty slice means no shift.
    pub(crate) fn factorise_shifted(&self, shift: &[f64]) -> Result<SparseCholesky, CholeskyError> {
        let (starts, rows, mut values) = self.upper_of(|_| true, &mut vec![NONE; self.len()]);
        for (column, &shift) in shift.iter().enumerate() {
            // The diagonal is stored, and comes last in a column of the upper triangle.
            values[starts[column + 1] - 1] += shift;
        }
        SparseCholesky::of_upper_in_order(&starts, &rows, &values)
    }

    /// `order[k]` becomes row and column `k`.
    pub(crate) fn permuted(&self, order: &[usize]) -> Self {
        let mut place = vec![0_u32; order.len()];
        order.iter().enumerate().for_each(|(k, &from)| place[from] = k as u32);
        let mut matrix = Self::new();
        let mut column: Vec<(u32, f64)> = Vec::new();
        for &from in order {
            let range = self.starts[from]..self.starts[from + 1];
            column.clear();
            column.extend(
                self.rows[range.clone()].iter().map(|&r| place[r as usize]).zip(self.values[range].iter().copied()),
            );
            column.sort_unstable_by_key(|&(row, _)| row);
            matrix.rows.extend(column.iter().map(|&(row, _)| row));
            matrix.values.extend(column.iter().map(|&(_, value)| value));
            matrix.starts.push(matrix.rows.len());
        }
        matrix
    }
}
