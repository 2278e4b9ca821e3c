//! Live streams: the pose of a running session, sent to other programs while it happens.
//!
//! [`Streams`] takes every new pose from the engine's thread, which it never holds up: the pose is copied into a slot,
//! and a thread of its own sends the newest one at the rate asked for. What a stream says is in `vmc` (for humanoids)
//! and `json` (for any skeleton); how it travels in `sender` (datagrams) and `web_socket`.

mod json;
mod sender;
mod skeleton;
mod stream_args;
mod target;
mod vmc;
mod web_socket;

pub use sender::{StreamReport, Streams};
pub use skeleton::{StreamedBone, StreamedPose, StreamedSkeleton};
pub use stream_args::StreamArgs;
pub use target::{StreamKind, StreamTarget};
