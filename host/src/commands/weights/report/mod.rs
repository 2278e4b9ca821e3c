//! What `armature weights` reports about its results.

mod biharmonic;
mod heat;
mod monotone;
mod words;

pub(super) use biharmonic::say_biharmonic;
pub(super) use heat::say_heat;
pub(super) use monotone::say_monotone;
pub(in crate::commands) use words::problem_words;
