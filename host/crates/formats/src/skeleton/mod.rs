//! Skeletons without a mesh: Trivial Graph Format, and skeletons from points and edges or from the frames of bones.

pub(crate) mod frames;
mod graph;
pub(crate) mod tails;
mod tgf;
mod with_clips;

pub use graph::{GraphError, GraphSkeleton, POINT_PREFIX, skeleton_from_graph};
pub use tgf::{TgfGraph, read_tgf, write_tgf};
pub use with_clips::SkeletonWithClips;
