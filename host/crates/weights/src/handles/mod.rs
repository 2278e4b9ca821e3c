//! Handles (bones, points, regions and cages), and the weights they fix at which vertices of a mesh.
//!
//! - [`handle_boundary`] collects the vertices that handles hold, with their weights;
//! - [`free_joints`] releases bones near the joints they share.
//!
//! ```
//! use armature_weights::handles::{Handle, HandleKind, handle_boundary};
//!
//! let line: Vec<[f64; 3]> = (0..9).map(|k| [f64::from(k), 0.0, 0.0]).collect();
//! let bone = |vertices: std::ops::RangeInclusive<usize>| Handle { kind: HandleKind::Bone, vertices: vertices.collect() };
//! let held = handle_boundary(&line, &[bone(1..=4), bone(4..=7)], &[])?;
//! assert_eq!(held.fixed, [1, 2, 3, 4, 5, 6, 7]);
//! // The joint is shared.
//! assert_eq!(held.fixed_weights[..7], [1.0, 1.0, 1.0, 0.5, 0.0, 0.0, 0.0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod boundary;
mod free_joints;

pub use boundary::{CageFacet, Handle, HandleBoundary, HandleError, HandleKind, handle_boundary};
pub use free_joints::{FREE_NEAR_JOINTS, MOST_FREE_NEAR_JOINTS, free_joints};
