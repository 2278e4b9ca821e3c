//! Factorisations of sparse matrices, on one thread, so that results do not depend on how many there are.

mod cholesky;
mod lu;

pub(crate) use cholesky::Cholesky;
pub(crate) use lu::Lu;

/// Why there is no factorisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FactorError {
    /// The matrix is singular to working precision, or for Cholesky not positive definite.
    Singular,
    /// The factor does not fit in memory.
    OutOfMemory,
}
