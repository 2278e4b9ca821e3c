//! Editing a surface by displacements that are as smooth as possible, so that its detail is kept (thesis 3.5, figure
//! 3.18): the biharmonic or triharmonic equation is solved for the displacement.

mod crease;
mod influences;
mod region;
mod region_editor;

pub use crease::SharpCurve;
pub use region::{near_vertices, vertices_within};
pub use region_editor::{EditError, Moves, RegionEditor, RegionSettings};
