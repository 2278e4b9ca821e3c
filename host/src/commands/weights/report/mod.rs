//! What `armature weights` reports about its results.

mod biharmonic;
mod heat;
mod monotone;
mod solved;
mod words;

pub(super) use heat::say_heat;
pub(super) use solved::say_solved;
pub(in crate::commands) use words::problem_words;
