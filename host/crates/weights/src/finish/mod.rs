//! From each handle's own weights to weights that can skin.
//!
//! - [`follow_nearest_handle`] assigns pieces of the shape that no handle holds to their nearest one;
//! - [`normalise`] scales every vertex's weights to sum to one;
//! - [`sparsify`] keeps a few influences per vertex;
//! - [`limit_influences`] does so with weights that are sparse already, and leaves rows within the limit as they are.
//!
//! ```
//! use armature_weights::{WeightMatrix, finish::{normalise, sparsify}};
//!
//! // Two vertices, three bones, column after column.
//! let mut weights = WeightMatrix::from_columns(2, 3, &[0.9, 0.0, 0.5, 0.5, 0.1, 0.5]).ok_or("sizes differ")?;
//! normalise(&mut weights);
//! let (influences, lost) = sparsify(&weights, 2, &[0, 1, 2], 3)?;
//! assert_eq!(influences.of_vertex(0).map(|(bone, _)| bone).collect::<Vec<_>>(), [0, 1]);
//! assert!((lost.max_dropped - 0.1 / 1.5).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod limit_influences;
mod normalise;
mod sparsify;

pub use limit_influences::limit_influences;
pub use normalise::{Normalisation, follow_nearest_handle, normalise};
pub use sparsify::{Sparsification, SparsifyError, sparsify};
