//! A piece of a Cholesky factor.

/// Columns of the factor that share their pattern below the diagonal block.
pub(crate) struct Block<'a> {
    pub(crate) start: usize,
    pub(crate) width: usize,
    /// Rows below the diagonal block, ascending.
    pub(crate) pattern: &'a [usize],
    /// `(width + pattern.len()) × width`, column-major; only the lower triangle of the diagonal block counts.
    pub(crate) values: &'a [f64],
}
