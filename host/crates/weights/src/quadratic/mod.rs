//! Quadratic energies under linear conditions (thesis 2.2): `½ xᵀ Q x + xᵀ l + c` is least where `A_eq x = b_eq` (eqs. 2.68 to
//! 2.71) and `A_ie x ≤ b_ie` (eqs. 2.62 and 2.85).
//!
//! - [`constrained_minimum`] takes both kinds of conditions.
//!
//! The point of a line that is nearest to the origin, and the nearest one whose second coordinate is 0.75 or more:
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::operators::SparseMatrix;
//! use armature_weights::quadratic::{LinearConditions, QuadraticProblem, QuadraticSettings, constrained_minimum};
//!
//! let mut problem = QuadraticProblem {
//!     quadratic: SparseMatrix::from_triplets(2, 2, &[(0, 0, 1.0), (1, 1, 1.0)])?,
//!     linear: vec![0.0, 0.0],
//!     constant: 0.0,
//!     equalities: LinearConditions { matrix: SparseMatrix::from_triplets(1, 2, &[(0, 0, 1.0), (0, 1, 1.0)])?, bounds: vec![1.0] },
//!     inequalities: LinearConditions::none(2),
//! };
//! let settings = QuadraticSettings::default();
//! let mut progress = |_: &'static str, _: f64| ControlFlow::Continue(());
//! let nearest = constrained_minimum(&problem, &settings, &mut progress)?;
//! assert!((nearest.values[1] - 0.5).abs() < 1e-12 && (nearest.equality_multipliers[0] + 0.5).abs() < 1e-12);
//! problem.inequalities =
//!     LinearConditions { matrix: SparseMatrix::from_triplets(1, 2, &[(0, 1, -1.0)])?, bounds: vec![-0.75] };
//! let nearest = constrained_minimum(&problem, &settings, &mut progress)?;
//! assert!((nearest.values[0] - 0.25).abs() < 1e-8 && (nearest.inequality_multipliers[0] - 0.5).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod constrained_minimum;
mod interior_steps;
mod problem;
mod solution;

pub use constrained_minimum::{QuadraticSettings, constrained_minimum};
pub use problem::{LinearConditions, QuadraticError, QuadraticProblem};
pub use solution::{QuadraticOutcome, QuadraticSolution};
