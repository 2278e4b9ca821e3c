//! The program `armature`: command line, engine and window. The only package that uses all crates.

// Printing problems must not end the work: `terminal::streams` prints.
#![warn(clippy::print_stdout, clippy::print_stderr)]

#[cfg(feature = "window")]
pub mod app;
pub mod bench;
pub mod characters;
pub mod cli;
pub mod commands;
pub(crate) mod descriptors;
pub mod engine;
pub mod failure;
pub mod files;
pub mod pictures;
pub mod program;
pub mod settings;
pub mod streams;
pub mod takes;
pub mod terminal;
