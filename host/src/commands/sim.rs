//! `armature sim`

use crate::cli::SimArgs;
use crate::engine::simulated;
use crate::failure::Failure;

/// Serves a simulated puppet until the program is ended.
pub fn sim(args: &SimArgs) -> Result<(), Failure> {
    let puppet = simulated::puppet(&args.puppet, &args.simulated)?;
    Err(Failure::device("not yet".to_string(), String::new()))
}
