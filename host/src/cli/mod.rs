//! The command line: subcommands, options and their help.

pub mod args;
pub mod edit_args;
pub mod function_args;
pub mod names;
mod numbers;
pub mod puppet_args;
pub mod rig_args;
pub mod surface_args;
pub mod take_args;
pub mod weight_args;

use clap::{Arg, CommandFactory, FromArgMatches, Parser, Subcommand};

use crate::cli::args::{
    BenchArgs, CalibrateArgs, DemoArgs, DevicesArgs, InspectArgs, RunArgs, SimArgs, VolumeArgs, WindowArgs,
};
use crate::cli::edit_args::EditArgs;
use crate::cli::function_args::{InterpolateArgs, SmoothArgs};
use crate::cli::puppet_args::PuppetCommand;
use crate::cli::rig_args::RigArgs;
use crate::cli::surface_args::SurfaceCommand;
use crate::cli::take_args::{ExportArgs, ReplayArgs, RetargetArgs};
use crate::cli::weight_args::{BindArgs, WeightsArgs};

const AFTER_HELP: &str = "\
Exit codes: 0 done · 2 wrong usage · 3 bad input · 4 device trouble · 5 a method did not converge

Try it without any hardware:
  armature demo                                    a simulated human moves a character for ten seconds
  armature run --device sim:spider --character spider --seconds 5 --record spider.take
  armature export spider.take --to spider.glb      open it in Blender, Maya or Unreal
  armature                                         the window (if it was built with it)";

/// Armature: hold a character in your hands.
///
/// Snap joints together into any tree, and a character's bones follow them. Record your performance and open it in
/// Blender, Maya or Unreal. Without hardware, use a simulated puppet. Without a subcommand, the window opens, if the
/// program was built with it.
#[derive(Debug, Parser)]
#[command(name = "armature", version, after_help = AFTER_HELP, max_term_width = 110)]
pub struct Cli {
    /// What to do; without a subcommand the window opens.
    #[command(subcommand)]
    pub command: Option<Command>,

    /// Report more while working (repeat for more detail)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    pub verbose: u8,

    /// Show no progress bars and no summaries, only results and errors
    #[arg(short, long, global = true)]
    pub quiet: bool,
}

impl Cli {
    /// Reads the command line. A negative number counts as a value, so that its option can say what is wrong with it.
    pub fn read() -> Result<Self, clap::Error> {
        let takes_negative = |arg: Arg| {
            let is_option = arg.get_long().is_some() && arg.get_action().takes_values();
            if is_option { arg.allow_negative_numbers(true) } else { arg }
        };
        let mut command = Self::command().mut_subcommands(|command| command.mut_args(takes_negative));
        let mut matches = command.try_get_matches_from_mut(std::env::args_os())?;
        Self::from_arg_matches_mut(&mut matches).map_err(|error| error.format(&mut command))
    }
}

/// The subcommands; `commands` implements them.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// See it work: a simulated human on a real serial line moves a character, and the take is exported
    Demo(DemoArgs),
    /// List puppets and serial ports, watch them come and go, or explain what one of them sends
    Devices(DevicesArgs),
    /// List a puppet's parts, or label a new one
    #[command(subcommand)]
    Puppet(PuppetCommand),
    /// Diagnose a mesh, skeleton, motion, character or take file
    Inspect(InspectArgs),
    /// Fit a skeleton into a mesh that has none: a human, a quadruped, a hand, or any tree of bones
    Rig(RigArgs),
    /// Bind a mesh to a skeleton: compute its skinning weights and save the character
    Bind(BindArgs),
    /// Compute the weights of handles for every vertex of a mesh, for other tools
    Weights(WeightsArgs),
    /// Smooth data on a mesh, such as painted weights or distances, and keep exactly the minima and maxima that matter
    Smooth(SmoothArgs),
    /// Spread values or colours from points, curves and regions over a mesh
    Interpolate(InterpolateArgs),
    /// Fill any mesh with tetrahedra, for other tools
    Volume(VolumeArgs),
    /// Close holes smoothly, join parts of a mesh, or drag places of a surface
    #[command(subcommand)]
    Surface(SurfaceCommand),
    /// Drive a character with a puppet, and record takes
    Run(Box<RunArgs>),
    /// Calibrate a puppet step by step: zero, sweep, mounting, heading
    Calibrate(Box<CalibrateArgs>),
    /// Solve a take again from its raw samples and compare with the poses it holds
    Replay(ReplayArgs),
    /// Edit takes without changing them: trim, overdub, smooth, loop and more, by a text file beside them
    Edit(EditArgs),
    /// Write takes, also after their edits, for other programs: GLB, FBX, USD, BVH, VRMA, or numbers (CSV, NPZ, MCAP)
    Export(ExportArgs),
    /// Move a character as a motion file or a take moves: by what the bones of both are, with feet that stay in place
    Retarget(RetargetArgs),
    /// Run benchmarks
    Bench(BenchArgs),
    /// Serve a simulated puppet on a pseudo-terminal or a TCP port (what `--device sim:…` does in a second process)
    Sim(Box<SimArgs>),
    /// Open the window (the same as no subcommand)
    #[cfg_attr(not(feature = "window"), command(hide = true))]
    Window(WindowArgs),
}
