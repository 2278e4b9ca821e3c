//! Bounded biharmonic weights (Jacobson et al. 2011; thesis chapter 4): the smoothest weights between zero and one that
//! take given values where handles hold the shape.
//!
//! - [`bounded_biharmonic_weights`] solves each handle separately and bounds the error of its weights;
//! - [`exact_partition_weights`] solves all handles together, so that weights sum to one without scaling;
//! - [`shape_preservation`] is the brush that keeps weights nearly constant where it is painted.
//!
//! All take a [`BiharmonicProblem`]: the Laplacian and masses of any mesh, and the fixed vertices that
//! [`crate::handles`] derives from handles.
//!
//! On a bar of springs the smoothest weights between two ends are a straight line:
//!
//! ```
//! use armature_geometry::operators::SparseMatrix;
//! use armature_weights::biharmonic::{BiharmonicProblem, BiharmonicSettings, bounded_biharmonic_weights};
//! use armature_weights::handles::HandleBoundary;
//! # use std::ops::ControlFlow;
//!
//! let springs = (0..4).flat_map(|k| [(k, k, -1.0), (k + 1, k + 1, -1.0), (k, k + 1, 1.0), (k + 1, k, 1.0)]);
//! let laplacian = SparseMatrix::from_triplets(5, 5, &springs.collect::<Vec<_>>())?;
//! // Each end is held over one spring's length: one by the first handle, the other by the second.
//! let fixed_weights = vec![1.0, 0.75, 0.25, 0.0, 0.0, 0.25, 0.75, 1.0];
//! let held = HandleBoundary { fixed: vec![0, 1, 3, 4], fixed_weights, handles: 2 };
//! let problem = BiharmonicProblem::new(&laplacian, &[1.0; 5], &held);
//! let mut progress = |_: &'static str, _: f64| ControlFlow::Continue(());
//! let solved = bounded_biharmonic_weights(&problem, &BiharmonicSettings::certified(), &mut progress)?;
//! assert!((solved.weights.weight(2, 0) - 0.5).abs() < BiharmonicSettings::certified().error_bound);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod active_set;
mod alternating_directions;
mod bounded_biharmonic;
mod check;
mod energy;
mod error;
mod exact_partition;
mod exchange_bounds;
mod far_handles;
mod free_descent;
mod held;
mod near_handles;
mod neighbourhood;
mod problem;
mod shape_preservation;

#[cfg(test)]
mod near_and_far_tests;

pub use bounded_biharmonic::{BiharmonicWeights, HandleReport, bounded_biharmonic_weights};
pub use error::BiharmonicError;
pub use exact_partition::{ExactPartition, ExactPartitionReport, ExactPartitionSettings, exact_partition_weights};
pub use problem::{BiharmonicOutcome, BiharmonicProblem, BiharmonicSettings};
pub use shape_preservation::{BrushError, shape_preservation};
