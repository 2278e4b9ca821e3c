//! Numbers in rows and columns.

/// Numbers in rows and columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NumberTable {
    /// Rows.
    pub rows: usize,
    /// Columns; 1 for a one-dimensional array.
    pub columns: usize,
    /// rows × columns values, column by column.
    pub values: Vec<f64>,
}

impl NumberTable {
    /// The values as indices; `None` if any is not a non-negative whole number.
    pub fn indices(&self) -> Option<Vec<usize>> {
        // Beyond 2^53, an f64 cannot represent every whole number.
        const LARGEST: f64 = 9_007_199_254_740_992.0;
        let index = |&value: &f64| ((0.0..LARGEST).contains(&value) && value.fract() == 0.0).then_some(value as usize);
        self.values.iter().map(index).collect()
    }
}
