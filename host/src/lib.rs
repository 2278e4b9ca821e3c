//! The engine, the command line and the window of `armature`: the only place where all rooms meet.

pub mod app;
