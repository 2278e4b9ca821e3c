//! Simulated puppets by the names and options of the command line.

use armature_rig::PuppetHints;
use armature_sim::body::BodyError;
use armature_sim::serve::{Options, OptionsError};
use armature_sim::{MotionFileError, Puppet};
use clap::Args;

use crate::failure::Failure;

/// What a preset does by default.
const PRESET_MOTION: &str = "walk+wave";

/// Options of a simulated puppet.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Simulated puppet (more in `armature sim --help`)")]
pub struct SimulatedArgs {
    /// rest, walk, wave, walk+wave, wiggle, sweep, of a human also squat, sit, kick, reach, cartwheel, or a BVH file; a
    /// puppet made from a BVH file plays that file
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
    /// Noise instead of data, as START:SECONDS
    #[arg(long, value_name = "START:SECONDS")]
    pub burst: Vec<String>,
    /// A part that is unplugged with everything attached to it, as `left_elbow@START:SECONDS`
    #[arg(long, value_name = "PART@START[:SECONDS]")]
    pub pull: Vec<String>,
    /// When the puppet loses power and restarts
    #[arg(long, value_name = "SECONDS")]
    pub restart: Vec<f64>,
    /// How long it holds the rest pose after each start
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

/// What is known of the puppet besides its tree. One that cannot be made is reported where it is made.
pub(super) fn hints(options: &Options) -> PuppetHints {
    options.hints().unwrap_or_default()
}

/// Makes the puppet.
pub fn puppet(options: &Options) -> Result<Puppet, Failure> {
    let made = options.motion_warnings().and_then(|warnings| {
        warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
        options.puppet()
    });
    made.map_err(options_failure)
}

/// Why there is no such puppet.
pub fn options_failure(error: OptionsError) -> Failure {
    match error {
        OptionsError::Format(error) => error.into(),
        OptionsError::Read { .. } => Failure::input(error.to_string(), "check the spelling and the folder"),
        OptionsError::Motion(MotionFileError::NoKnownBones { .. } | MotionFileError::NotHuman { .. }) => {
            Failure::input(error.to_string(), "--device sim:FILE.bvh gives a puppet with a joint for each of its bones")
        }
        OptionsError::Motion(MotionFileError::Body(BodyError::TooManySensors { .. })) => {
            let remedy =
                "each bone becomes a joint with three sensors; remove some bones from the file, such as fingers";
            Failure::input(error.to_string(), remedy)
        }
        OptionsError::Motion(_) => Failure::input(error.to_string(), "choose another motion file"),
        _ => Failure::usage(error.to_string(), "`armature sim --help` lists what there is"),
    }
}
