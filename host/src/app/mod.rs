//! The window: a pure state and a view of it.

pub mod engine;
