//! Minima and maxima of functions on a mesh: where they are, how much each matters, and orders that have only chosen
//! ones.
//!
//! - [`local_extrema`] finds them exactly, plateaus included;
//! - [`spurious_extrema`] leaves out those that a function is expected to have;
//! - [`persistence`] pairs each with the saddle that ends it (Edelsbrunner et al. 2002; thesis 5.3.3);
//! - [`order_with_extrema`] sorts vertices so that none but the given ones is lowest or highest among its neighbours.
//!
//! All take [`Neighbours`], which any mesh has. On a path of five vertices:
//!
//! ```
//! use armature_weights::extrema::{Neighbours, local_extrema};
//!
//! let path = Neighbours::of_elements(5, &[[0, 1], [1, 2], [2, 3], [3, 4]])?;
//! let found = local_extrema(&path, &[0.0, 1.0, 0.5, 0.5, 2.0])?;
//! assert_eq!(found.minima.iter().map(|minimum| minimum.vertices.clone()).collect::<Vec<_>>(), [vec![0], vec![2, 3]]);
//! assert_eq!(found.maxima.len(), 2);
//! assert_eq!(found.besides(&[0, 4]).count(), 2);
//! # Ok::<(), armature_weights::extrema::ExtremaError>(())
//! ```

mod error;
mod local_extrema;
mod monotone_order;
mod neighbours;
mod persistence;
mod spurious;

pub use error::ExtremaError;
pub use local_extrema::{Extrema, Extremum, local_extrema};
pub use monotone_order::{MonotoneOrder, order_with_extrema};
pub use neighbours::Neighbours;
pub use persistence::{PersistentExtremum, persistence};
pub use spurious::{Expected, spurious_extrema};
