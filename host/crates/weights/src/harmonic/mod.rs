//! Harmonic functions (thesis 2.1): the least change between given values.
//!
//! - [`harmonic_function`] solves the Laplace or Poisson equation with given values (Dirichlet) and given flux (Neumann);
//! - [`positive_conductances`] makes any mesh's Laplacian keep the maximum principle, which obtuse elements break.
//!
//! On surfaces, [`intrinsic_delaunay_laplacian`](armature_geometry::operators::intrinsic_delaunay_laplacian) keeps it
//! too, without changing what the operator measures; but its neighbours are not those of the mesh.
//!
//! ```
//! use armature_geometry::operators::SparseMatrix;
//! use armature_weights::harmonic::{HarmonicProblem, harmonic_function};
//!
//! let springs = (0..4).flat_map(|k| [(k, k, -1.0), (k + 1, k + 1, -1.0), (k, k + 1, 1.0), (k + 1, k, 1.0)]);
//! let laplacian = SparseMatrix::from_triplets(5, 5, &springs.collect::<Vec<_>>())?;
//! let between = HarmonicProblem { laplacian: &laplacian, fixed: &[0, 4], values: &[0.0, 1.0], flux: &[] };
//! assert!((harmonic_function(&between)?.values[1] - 0.25).abs() < 1e-15);
//! // A slope of two into the far end instead of a value.
//! let pushed = HarmonicProblem { fixed: &[0], values: &[0.0], flux: &[(4, 2.0)], ..between };
//! assert!((harmonic_function(&pushed)?.values[4] - 8.0).abs() < 1e-13);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod harmonic_function;
mod positive_conductances;

pub use harmonic_function::{HarmonicError, HarmonicFunction, HarmonicProblem, harmonic_function};
pub use positive_conductances::{PositiveLaplacian, positive_conductances};
