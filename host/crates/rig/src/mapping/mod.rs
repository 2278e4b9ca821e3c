//! Which part of the puppet drives which bone of the character ([`Mapping`]), and a first proposal ([`propose`],
//! [`propose_with`] where more is known of the puppet), and how the character's rest pose becomes the puppet's
//! ([`match_rest`], [`match_rest_pose`]).

mod alignment;
mod assignment;
mod bone_shapes;
mod carried;
mod doubts;
mod entries;
mod error;
mod hints;
mod limb_directions;
mod prices;
mod propose;
mod puppet_plan;
mod rest_match;
mod rest_turn;
mod shape_drive;
mod share_proposal;
mod shares;
mod symmetry;

pub use carried::carried;
pub use entries::{Mapping, MappingEntry};
pub use error::MappingError;
pub use hints::{PuppetHints, PuppetKind};
pub use limb_directions::RestPose;
pub(crate) use limb_directions::next_part;
pub use propose::{Proposal, propose, propose_with};
pub use rest_match::{LEAST_REST_TURN, RestMatch, match_rest, match_rest_pose, rest_in};
pub use rest_turn::RestTurn;
pub use shape_drive::{DriveAxis, ShapeDrive};
pub use shares::{MOST_CURL, SharedJoint, Sharing};
