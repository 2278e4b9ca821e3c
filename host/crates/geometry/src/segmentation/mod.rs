//! Which elements of a tessellation are inside a surface (thesis 8.5).
//!
//! [`element_winding`](element_winding::element_winding) integrates the winding number over each element,
//! [`graph_cut`](graph_cut::graph_cut) turns it into labels that respect it and are coherent,
//! [`satisfy_facets`](constrain::satisfy_facets) and [`make_manifold`](constrain::make_manifold) make these obey what no
//! cut can.

mod connect_vertices;
mod constrain;
mod element_winding;
mod energy;
mod graph_cut;
mod max_flow;
mod quadrature;

pub use connect_vertices::{AddedChain, Connected, ConnectedPieces, connect_vertices, connected_pieces};
pub use constrain::{
    Constrained, ConstraintInput, ConstraintOutcome, ConstraintSettings, HardConstraint, make_manifold, satisfy_facets,
};
pub use element_winding::{ElementWinding, ElementWindingSettings, element_winding};
pub use graph_cut::{
    Label, Segmentation, SegmentationError, SegmentationSettings, graph_cut, graph_cut_with_forced_labels,
};
