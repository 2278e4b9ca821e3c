//! Which elements of a tessellation are inside a surface (thesis 8.5).
//!
//! [`element_winding`](element_winding::element_winding) integrates the winding number over each element,
//! [`graph_cut`](graph_cut::graph_cut) turns it into labels that respect it and are coherent,
//! [`satisfy_facets`](constrain::satisfy_facets) and [`make_manifold`](constrain::make_manifold) enforce constraints
//! that no cut can.
//!
//! ```
//! use std::ops::ControlFlow;
//! use armature_geometry::segmentation::{SegmentationSettings, graph_cut};
//!
//! // Four segments of a line; the winding number of the third is slightly off.
//! const HULL: u32 = u32::MAX;
//! let neighbours = [[HULL, 1], [0, 2], [1, 3], [2, HULL]];
//! let winding = [0.02, 0.9, 0.49, 0.9];
//! let settings = SegmentationSettings { gamma: 0.5, sigma: 0.5 };
//! let cut = graph_cut(&winding, &neighbours, &[[1.0; 2]; 4], &settings, &mut |_stage, _fraction| ControlFlow::Continue(()))?;
//! assert_eq!(cut.inside, [false, true, true, true]);
//! # Ok::<(), armature_geometry::segmentation::SegmentationError>(())
//! ```

mod connect_vertices;
mod constrain;
mod element_winding;
mod energy;
mod error;
mod graph_cut;
mod max_flow;
mod quadrature;

pub use connect_vertices::{AddedChain, Connected, ConnectedPieces, connect_vertices, connected_pieces};
pub use constrain::{
    Constrained, ConstraintInput, ConstraintOutcome, ConstraintSettings, HardConstraint, make_manifold, satisfy_facets,
};
pub use element_winding::{ElementWinding, ElementWindingSettings, element_winding};
pub use energy::SegmentationSettings;
pub use error::SegmentationError;
pub use graph_cut::{Label, Segmentation, graph_cut, graph_cut_with_forced_labels};
