//! Simulated puppets by the names and options of the command line.

use armature_sim::Puppet;
use armature_sim::serve::{Options, OptionsError};
use clap::Args;

use crate::failure::Failure;

/// What a preset does unless told otherwise.
const PRESET_MOTION: &str = "walk+wave";

/// What a simulated puppet does.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Simulated puppet (more in `armature sim --help`)")]
pub struct SimulatedArgs {
    /// rest, walk, wave, walk+wave, wiggle, sweep, or a BVH file; a puppet made from a BVH file plays that file
    #[arg(long)]
    pub motion: Option<String>,
    /// The same seed gives the same bytes
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Chance that a byte on the wire is damaged
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub flip: f64,
    /// Chance that a byte on the wire is lost
    #[arg(long, value_name = "CHANCE", default_value_t = 0.0)]
    pub drop: f64,
    /// Noise in place of data, as START:SECONDS
    #[arg(long, value_name = "START:SECONDS")]
    pub burst: Vec<String>,
    /// A part that is pulled out with all that hangs on it, as `left_elbow@START:SECONDS`
    #[arg(long, value_name = "PART@START[:SECONDS]")]
    pub pull: Vec<String>,
    /// When the puppet loses power and starts anew
    #[arg(long, value_name = "SECONDS")]
    pub restart: Vec<f64>,
    /// For how long it holds the rest pose after each start
    #[arg(long, value_name = "SECONDS", default_value_t = DEFAULT_REST)]
    pub rest: f64,
}

/// Long enough to be zeroed.
const DEFAULT_REST: f64 = 1.0;

impl Default for SimulatedArgs {
    fn default() -> Self {
        Self {
            motion: None,
            seed: 1,
            flip: 0.0,
            drop: 0.0,
            burst: Vec::new(),
            pull: Vec::new(),
            restart: Vec::new(),
            rest: DEFAULT_REST,
        }
    }
}

impl SimulatedArgs {
    /// The simulator's own options for the puppet of this name.
    pub fn options(&self, puppet: &str) -> Options {
        let is_preset = std::path::Path::new(puppet).extension().is_none();
        let own_motion = if is_preset { Some(PRESET_MOTION.to_string()) } else { None };
        Options {
            puppet: puppet.to_string(),
            motion: self.motion.clone().or(own_motion),
            seed: self.seed,
            flip: self.flip,
            drop: self.drop,
            burst: self.burst.clone(),
            pull: self.pull.clone(),
            restart: self.restart.clone(),
            rest: self.rest,
            ..Options::default()
        }
    }

    /// The same as a command line for a second process.
    pub fn arguments(&self, puppet: &str) -> Vec<String> {
        let options = self.options(puppet);
        let mut arguments = vec![options.puppet, format!("--seed={}", options.seed)];
        arguments.extend(options.motion.map(|motion| format!("--motion={motion}")));
        arguments.push(format!("--rest={}", options.rest));
        arguments.extend([format!("--flip={}", options.flip), format!("--drop={}", options.drop)]);
        arguments.extend(options.burst.iter().map(|burst| format!("--burst={burst}")));
        arguments.extend(options.pull.iter().map(|pull| format!("--pull={pull}")));
        arguments.extend(options.restart.iter().map(|restart| format!("--restart={restart}")));
        arguments
    }
}

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
