//! Sparse symmetric linear algebra shared by the methods.

pub(crate) mod block;
pub(crate) mod cholesky;
pub(crate) mod inverse_diagonal;
pub(crate) mod product;
pub(crate) mod quasi_definite;
pub(crate) mod solve_one;
pub(crate) mod solve_together;
pub(crate) mod symmetric;
