//! Patches: triangles between given rims, first flat pieces, then refined and solved for.

mod around;
mod bridge;
mod domain;
mod refine;
mod relax;
mod rims;
mod solve;
mod triangulate;

pub(crate) use around::Around;
pub(crate) use domain::make_blend;
pub use domain::{Domain, DomainSettings};
pub use rims::RimShape;
pub use solve::{Join, PatchSettings};
pub(crate) use solve::{NoPatch, PatchOutcome, make_patch};
