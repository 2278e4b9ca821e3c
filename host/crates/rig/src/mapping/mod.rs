//! Which part of the puppet drives which bone of the character ([`Mapping`]), and a first proposal ([`propose`],
//! [`propose_with`] where more is known of the puppet).

mod alignment;
mod assignment;
mod bone_shapes;
mod carried;
mod doubts;
mod entries;
mod hints;
mod prices;
mod propose;
mod puppet_plan;
mod symmetry;

pub use carried::carried;
pub use entries::{Mapping, MappingEntry, MappingError};
pub use hints::{PuppetHints, PuppetKind};
pub use propose::{Proposal, propose, propose_with};
