//! The command line: what can be asked, in words that teach.

pub mod args;
pub mod weight_args;

use std::io::IsTerminal;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::cli::args::{
    BenchArgs, CalibrateArgs, DemoArgs, DevicesArgs, ExportArgs, InspectArgs, ReplayArgs, RunArgs, SimArgs, VolumeArgs,
    WindowArgs,
};
use crate::cli::weight_args::{BindArgs, WeightsArgs};
use crate::commands;
use crate::failure::Failure;
use crate::talk::Talk;

const AFTER_HELP: &str = "\
Exit codes: 0 done · 2 wrong usage · 3 bad input · 4 device trouble · 5 a method did not converge

Try it without any hardware:
  armature demo                                    a simulated human moves a character for ten seconds
  armature run --device sim:spider --character spider --seconds 5 --record spider.take
  armature export spider.take --to spider.glb      open it in Blender, Maya or Unreal
  armature                                         the window";

/// Armature: hold a character in your hands.
///
/// Joints that you snap together into any tree drive the bones of a character; what you perform is recorded and
/// opens in Blender, Maya or Unreal. A simulated puppet stands in where there is no hardware. Without a
/// subcommand a window opens.
#[derive(Debug, Parser)]
#[command(name = "armature", version, after_help = AFTER_HELP, max_term_width = 110)]
pub struct Cli {
    #[command(subcommand)]
    command: Option<Command>,

    /// Say more while working (repeat for still more)
    #[arg(short, long, global = true, action = clap::ArgAction::Count)]
    verbose: u8,

    /// Show no progress bars and no summaries, only results and errors
    #[arg(short, long, global = true)]
    quiet: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// The whole way once: a simulated human on a real serial line moves a character, and the take is exported
    Demo(DemoArgs),
    /// List the puppets and serial ports that are plugged in, watch them come and go, or tell what one of them says
    Devices(DevicesArgs),
    /// Diagnose a mesh, skeleton, motion, character or take file
    Inspect(InspectArgs),
    /// Bind a mesh to a skeleton: compute its skinning weights and save the character
    Bind(BindArgs),
    /// Compute the weights of handles for every vertex of a mesh, for other tools
    Weights(WeightsArgs),
    /// Fill a mesh with tetrahedra, however messy it is, and write them for other tools
    Volume(VolumeArgs),
    /// Drive a character with a puppet, and record
    Run(Box<RunArgs>),
    /// Calibrate a puppet step by step: zero, sweep, mounting, heading
    Calibrate(Box<CalibrateArgs>),
    /// Solve a take again from its raw samples and compare with the poses it holds
    Replay(ReplayArgs),
    /// Write a take as BVH or as an animated GLB
    Export(ExportArgs),
    /// Measure: the benchmarks by name
    Bench(BenchArgs),
    /// Serve a simulated puppet on a pseudo-terminal or a TCP port (what `--device sim:…` does in a second process)
    Sim(Box<SimArgs>),
    /// Open the window (the same as no subcommand)
    Window(WindowArgs),
}

/// Parses the command line and does what it says.
pub fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => {
            let code = if error.use_stderr() { 2 } else { 0 };
            return if error.print().is_ok() { ExitCode::from(code) } else { ExitCode::from(2) };
        }
    };
    init_logging(cli.verbose);
    let talk = Talk { quiet: cli.quiet };
    match dispatch(cli.command, talk) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {failure}");
            failure.exit_code()
        }
    }
}

fn dispatch(command: Option<Command>, talk: Talk) -> Result<(), Failure> {
    match command.unwrap_or_else(|| Command::Window(WindowArgs::default())) {
        Command::Demo(args) => commands::demo(&args, talk),
        Command::Devices(args) => commands::devices(&args),
        Command::Inspect(args) => commands::inspect(&args),
        Command::Bind(args) => commands::bind(&args, talk),
        Command::Weights(args) => commands::weights(&args, talk),
        Command::Volume(args) => commands::volume(&args, talk),
        Command::Run(args) => commands::run(&args, talk),
        Command::Calibrate(args) => commands::calibrate(&args, talk),
        Command::Replay(args) => commands::replay(&args, talk),
        Command::Export(args) => commands::export(&args, talk),
        Command::Bench(args) => commands::bench(&args),
        Command::Sim(args) => commands::sim(&args),
        Command::Window(args) => commands::window(&args),
    }
}

fn init_logging(verbose: u8) {
    let default = ["warn", "info", "debug", "trace"][usize::from(verbose.min(3))];
    let filter = tracing_subscriber::EnvFilter::try_from_env("ARMATURE_LOG").unwrap_or_else(|_| {
        tracing_subscriber::EnvFilter::new(format!("{default},wgpu_core=warn,wgpu_hal=error,naga=warn,winit=error"))
    });
    let subscriber = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_ansi(std::io::stderr().is_terminal())
        .with_target(verbose > 1)
        .without_time();
    // A second subscriber in one process (tests) keeps the first.
    let _ = subscriber.try_init();
}
