//! How much every vertex follows each handle: all numbers, or only those that are not zero.

use std::borrow::Cow;

use super::error::{ArapError, expect_length};

/// The weights of a shape, as the caller has them.
#[derive(Clone, Copy, Debug)]
pub enum ArapWeights<'a> {
    /// n×m, row by row.
    Matrix(&'a [f64]),
    /// Those that are not zero: for shapes with hundreds of handles.
    Rows(&'a WeightRows),
}

/// Weights vertex by vertex, without zeros: handles ascending within a vertex.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightRows {
    starts: Vec<usize>,
    entries: Vec<(u32, f64)>,
}

impl Default for WeightRows {
    fn default() -> Self {
        Self { starts: vec![0], entries: Vec::new() }
    }
}

impl WeightRows {
    /// Adds a vertex: `(handle, weight)` in any order. Weights of the same handle are added up; zeros are left out.
    pub fn push(&mut self, weights: impl IntoIterator<Item = (usize, f64)>) {
        let first = self.entries.len();
        for (handle, weight) in weights {
            let handle = u32::try_from(handle).unwrap_or(u32::MAX);
            match self.entries[first..].iter_mut().find(|(own, _)| *own == handle) {
                Some((_, sum)) => *sum += weight,
                None => self.entries.push((handle, weight)),
            }
        }
        self.entries[first..].sort_unstable_by_key(|(handle, _)| *handle);
        let mut kept = first;
        for entry in first..self.entries.len() {
            if self.entries[entry].1 != 0.0 {
                self.entries.swap(kept, entry);
                kept += 1;
            }
        }
        self.entries.truncate(kept);
        self.starts.push(self.entries.len());
    }

    /// Number of vertices.
    pub fn vertex_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// A vertex's handles and weights, handles ascending.
    pub fn of(&self, vertex: usize) -> &[(u32, f64)] {
        &self.entries[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// The rows of a matrix with this many columns.
    pub(super) fn from_matrix(weights: &[f64], columns: usize) -> Self {
        let mut rows = Self::default();
        for row in weights.chunks_exact(columns.max(1)) {
            rows.entries.extend((0_u32..).zip(row).filter(|(_, weight)| **weight != 0.0).map(|(h, &w)| (h, w)));
            rows.starts.push(rows.entries.len());
        }
        rows
    }
}

impl<'a> ArapWeights<'a> {
    /// Checks the number of vertices.
    pub(super) fn expect_size(&self, vertices: usize, handles: usize) -> Result<(), ArapError> {
        match self {
            Self::Matrix(weights) => expect_length("weights", weights.len(), vertices * handles),
            Self::Rows(rows) => expect_length("rows of weights", rows.vertex_count(), vertices),
        }
    }

    /// The weights without zeros.
    pub(super) fn rows(&self, handles: usize) -> Cow<'a, WeightRows> {
        match self {
            Self::Matrix(weights) => Cow::Owned(WeightRows::from_matrix(weights, handles)),
            Self::Rows(rows) => Cow::Borrowed(rows),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_sorted_summed_and_without_zeros() {
        let mut rows = WeightRows::default();
        rows.push([(4, 0.25), (1, 0.5), (4, 0.25), (2, 0.0)]);
        rows.push([]);
        assert_eq!(rows.of(0), [(1, 0.5), (4, 0.5)]);
        assert!(rows.of(1).is_empty() && rows.vertex_count() == 2);
        let matrix = WeightRows::from_matrix(&[0.0, 0.5, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0], 5);
        assert_eq!(matrix, rows);
    }
}
