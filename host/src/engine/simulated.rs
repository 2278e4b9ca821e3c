//! Simulated puppets by the names and options of the command line.

use armature_sim::Puppet;
use armature_sim::serve::{Options, OptionsError};

use crate::failure::Failure;

/// Makes the puppet.
pub fn puppet(options: &Options) -> Result<Puppet, Failure> {
    options.puppet().map_err(|error| match error {
        OptionsError::Format(error) => error.into(),
        OptionsError::Read { .. } => Failure::input(error.to_string(), "check the spelling and the folder"),
        OptionsError::Motion(_) => {
            Failure::input(error.to_string(), "--device sim:FILE.bvh gives a puppet with a joint for each of its bones")
        }
        _ => Failure::usage(error.to_string(), "`armature sim --help` tells what there is"),
    })
}
