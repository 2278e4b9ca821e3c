//! Holes of a surface: where they are, which of them an artist may have meant, and surfaces that close them.

mod fill;
mod find;
mod hole;
mod meant;
mod welded;

pub use fill::{FillError, FillSettings, Filled, FilledHole, HoleOutcome, blend_on_domain, blend_rims, fill_holes};
pub use find::find_holes;
pub use hole::{BrokenRim, Hole, Holes, Meant};
