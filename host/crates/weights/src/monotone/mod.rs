//! Functions with controlled extrema (Jacobson, Weinkauf & Sorkine 2012, "Smooth Shape-Aware Functions with Controlled
//! Extrema"; thesis chapter 5): the smoothest ones that have minima and maxima where these are prescribed and nowhere
//! else. Bounded weights may still rise and fall again far from their handle; these do not.
//!
//! - [`monotone_functions`] takes any prescribed values, an order of smoothness, and optionally data to stay close to;
//! - [`monotone_weights`] takes handles, each alone; [`monotone_partition`] takes them together, with weights that sum to one;
//! - [`monotone_interpolation`] spreads values and colours from points, curves and regions;
//! - [`smooth_keeping`] smooths noisy data and keeps exactly the extrema that matter;
//! - [`interior_point`] solves the same problem in the paper's conic form, for comparison.
//!
//! Each result comes with a certificate: how far it can be from the best function that rises along the same edges.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::operators::SparseMatrix;
//! use armature_weights::extrema::Neighbours;
//! use armature_weights::monotone::{MonotoneProblem, MonotoneSettings, PrescribedFunction, monotone_functions};
//!
//! // A chain of springs, held at both ends: ½∫(f″)² without bending there is least for 3x² - 2x³.
//! let springs = (0..8).flat_map(|k| [(k, k, -8.0), (k + 1, k + 1, -8.0), (k, k + 1, 8.0), (k + 1, k, 8.0)]);
//! let laplacian = SparseMatrix::from_triplets(9, 9, &springs.collect::<Vec<_>>())?;
//! let neighbours = Neighbours::of_elements(9, &(0..8).map(|k| [k, k + 1]).collect::<Vec<_>>())?;
//! let mass: Vec<f64> = (0..9).map(|k| if k % 8 == 0 { 1.0 / 16.0 } else { 1.0 / 8.0 }).collect();
//! let problem =
//!     MonotoneProblem { neighbours: &neighbours, laplacian: &laplacian, mass: &mass, order: 2, blend: None, data: None };
//! let ends = PrescribedFunction::between_extremes(&[0.0, 1.0]);
//! let mut progress = |_: &'static str, _: f64| ControlFlow::Continue(());
//! let made = monotone_functions(&problem, &[0, 8], &[ends], &MonotoneSettings::certified(), &mut progress)?;
//! let quarter = 0.25_f64;
//! assert!((made[0].values[2] - (3.0 - 2.0 * quarter) * quarter * quarter).abs() < 0.01);
//! assert_eq!(made[0].report.spurious, 0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod directed_edges;
mod energy;
mod error;
mod interior_point;
mod least_squares_form;
mod monotone_functions;
mod monotone_interpolation;
mod monotone_partition;
mod monotone_weights;
mod partition_problem;
mod polyharmonic;
mod prescribed;
mod primal_dual;
mod problem;
mod representative;
mod rising_edges;
mod shared_levels;
mod smooth_keeping;

pub use error::MonotoneError;
pub use interior_point::{ConicError, ConicOutcome, ConicProblem, ConicSolution, interior_point};
pub use least_squares_form::least_squares_form;
pub use monotone_functions::{MonotoneFunction, MonotoneOutcome, MonotoneReport, MonotoneSettings, monotone_functions};
pub use monotone_interpolation::{MonotoneInterpolation, ValueSource, monotone_interpolation};
pub use monotone_partition::{MOST_TOGETHER, MonotonePartition, MonotonePartitionReport, monotone_partition};
pub use monotone_weights::{MonotoneWeights, monotone_weights};
pub use prescribed::{PrescribedFunction, Role};
pub use problem::{Data, MonotoneProblem};
pub use smooth_keeping::{Keep, Smoothed, smooth_keeping};
