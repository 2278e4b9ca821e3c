//! `armature` without a subcommand

use crate::app::{self, Start};
use crate::characters;
use crate::cli::args::WindowArgs;
use crate::engine::show;
use crate::failure::Failure;

/// Opens the window.
pub fn window(args: &WindowArgs) -> Result<(), Failure> {
    let device = args.device.as_deref().unwrap_or_default();
    let character = args.character.as_deref().unwrap_or_else(|| characters::default_for(device));
    let start = Start { character: show::choice(character), device: args.device.clone() };
    app::run(start, show::spawn).map_err(|e| Failure::device(e.to_string(), ""))
}
