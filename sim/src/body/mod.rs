//! The puppet's parts and how they are plugged together: [`Body::preset`], or part by part with [`BodyBuilder`].

mod parts;
mod preset;

pub use parts::{Body, BodyBuilder, BodyError, BodyPart};
pub use preset::MOST_JOINTS;
