//! The program as a person or a script runs it: what each command does, refuses and writes. One binary, for each would
//! link the whole program again.

#![allow(clippy::unwrap_used, reason = "a test may fail by panicking, in its helpers too")]

mod bad_input;
mod calibrate;
mod command_line;
#[path = "../common/mod.rs"]
mod common;
mod descriptors;
mod documented;
mod exporters;
mod exports;
mod functions_command;
mod guide;
mod outputs;
mod rig_command;
mod shapes;
mod skins;
mod streams;
mod surface_command;
mod takes;
mod travel;
mod volume_command;
mod weights_command;
