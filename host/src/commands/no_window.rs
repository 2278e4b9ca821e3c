//! `armature` without a subcommand, in a program without the window

use crate::cli::args::WindowArgs;
use crate::failure::Failure;

/// This program has no window: says how to get one.
pub fn window(_: &WindowArgs) -> Result<(), Failure> {
    Err(Failure::usage(
        "this program was built without the window",
        "build it with `cargo build --release`, without --no-default-features; `armature --help` lists what works without it",
    ))
}
