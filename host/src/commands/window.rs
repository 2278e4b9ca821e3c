//! `armature` without a subcommand

use crate::app::{self, Start};
use crate::cli::args::WindowArgs;
use crate::engine::show;
use crate::failure::Failure;

/// Opens the window.
pub fn window(args: &WindowArgs) -> Result<(), Failure> {
    let start = Start { character: show::choice(&args.character), device: args.device.clone() };
    app::run(start, show::spawn).map_err(|e| Failure::device(e.to_string(), ""))
}
