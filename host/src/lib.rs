//! The program `armature`: command line, engine and window. The only place where all rooms meet.

pub mod app;
pub mod bench;
pub mod characters;
pub mod cli;
pub mod commands;
pub mod decoding;
pub mod engine;
pub mod exports;
pub mod failure;
pub mod files;
pub mod inputs;
pub mod interrupt;
pub mod pictures;
pub mod settings;
pub mod slice;
pub mod takes;
pub mod talk;
pub mod volumes;
pub mod weight_picture;
pub mod words;
