//! Patches: triangles between given rims, first flat pieces, then refined and solved for.

mod around;
mod bridge;
mod refine;
mod relax;
mod solve;
mod triangulate;

pub(crate) use around::Around;
pub use solve::{Join, PatchSettings};
pub(crate) use solve::{NoPatch, PatchOutcome, make_patch};
