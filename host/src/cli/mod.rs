//! The command line: what can be asked, in words that teach.

use std::path::PathBuf;
use std::process::ExitCode;

use armature_sim::serve;
use clap::{Args, Parser, Subcommand};

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

/// What a preset does unless told otherwise.
const PRESET_MOTION: &str = "walk+wave";

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
    /// List the puppets and serial ports that are plugged in
    Devices,
    /// Diagnose a mesh, skeleton, motion, character or take file
    Inspect(InspectArgs),
    /// Bind a mesh to a skeleton: compute its skinning weights and save the character
    Bind(BindArgs),
    /// Drive a character with a puppet, and record
    Run(RunArgs),
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

/// `armature demo`
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the take, the exports and the picture
    #[arg(short, long, default_value = "armature-demo")]
    pub output: PathBuf,
    /// How long the puppet performs
    #[arg(long, default_value_t = 10.0, value_parser = positive_seconds)]
    pub seconds: f64,
    /// Samples a second
    #[arg(long, default_value_t = 200.0, value_parser = sample_rate)]
    pub rate: f64,
    /// Seed of the simulated puppet
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
}

/// `armature inspect`
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// A mesh (obj, ply, stl, off, gltf, glb, mesh), skeleton (tgf), motion (bvh), character (armature) or take
    pub file: PathBuf,
    /// One JSON object in place of words
    #[arg(long)]
    pub json: bool,
}

/// `armature bind`
#[derive(Debug, Args)]
pub struct BindArgs {
    /// The mesh (obj, ply, stl, off, gltf, glb, mesh)
    pub mesh: PathBuf,
    /// The skeleton (tgf, bvh, or a gltf/glb with a skin); a rigged glTF brings its own
    #[arg(short, long)]
    pub skeleton: Option<PathBuf>,
    /// Where to save the character
    #[arg(short, long, default_value = "character.armature")]
    pub output: PathBuf,
    /// Most bones a vertex may follow
    #[arg(long, default_value_t = 4, value_parser = influence_count)]
    pub influences: usize,
    /// Replace the skeleton and weights that the file itself brings
    #[arg(long)]
    pub replace_rig: bool,
    /// Compute again even if the same input was bound before
    #[arg(long)]
    pub no_cache: bool,
    /// Write a picture of the bound character
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
}

/// `armature run`
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The puppet: sim:human, sim:spider, sim:hand, sim:FILE.bvh, serial:PATH[@BAUD], tcp:HOST:PORT
    #[arg(short, long, default_value = "sim:human")]
    pub device: String,
    /// The character: human, spider, hand, a .armature file, or a mesh or motion file that brings a skeleton
    #[arg(short, long, default_value = "human")]
    pub character: String,
    /// How long to run; without it, until Ctrl-C
    #[arg(short, long, value_parser = positive_seconds)]
    pub seconds: Option<f64>,
    /// Record the performance into this take
    #[arg(short, long, value_name = "TAKE")]
    pub record: Option<PathBuf>,
    /// Samples a second to ask the puppet for
    #[arg(long, default_value_t = 200.0, value_parser = sample_rate)]
    pub rate: f64,
    /// Which joint drives which bone (TOML); without it the program proposes from the shape of the two trees
    #[arg(long, value_name = "TOML")]
    pub mapping: Option<PathBuf>,
    /// Save the mapping in use, to be corrected by hand
    #[arg(long, value_name = "TOML")]
    pub save_mapping: Option<PathBuf>,
    /// Calibration file to use and update; without it, the one kept for this user (never for a simulated puppet)
    #[arg(long, value_name = "TOML")]
    pub calibration: Option<PathBuf>,
    /// Take the pose at the beginning as the rest pose even if the joints are calibrated
    #[arg(long)]
    pub zero: bool,
    /// What a simulated puppet does.
    #[command(flatten)]
    pub simulated: SimulatedArgs,
    /// Run a simulated puppet on a clock of its own, as fast as the machine can and the same every time
    #[arg(long)]
    pub virtual_clock: bool,
}

/// What a simulated puppet does.
#[derive(Clone, Debug, Args)]
#[command(next_help_heading = "Simulated puppet (more in `armature sim --help`)")]
pub struct SimulatedArgs {
    /// rest, walk, wave, walk+wave, wiggle, or a BVH file; a puppet made from a BVH file plays that file
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
}

impl Default for SimulatedArgs {
    fn default() -> Self {
        Self { motion: None, seed: 1, flip: 0.0, drop: 0.0, burst: Vec::new(), pull: Vec::new(), restart: Vec::new() }
    }
}

impl SimulatedArgs {
    /// The simulator's own options for the puppet of this name.
    pub fn options(&self, puppet: &str) -> serve::Options {
        let is_preset = std::path::Path::new(puppet).extension().is_none();
        let own_motion = if is_preset { Some(PRESET_MOTION.to_string()) } else { None };
        serve::Options {
            puppet: puppet.to_string(),
            motion: self.motion.clone().or(own_motion),
            seed: self.seed,
            flip: self.flip,
            drop: self.drop,
            burst: self.burst.clone(),
            pull: self.pull.clone(),
            restart: self.restart.clone(),
            ..serve::Options::default()
        }
    }

    /// The same as a command line for a second process.
    pub fn arguments(&self, puppet: &str) -> Vec<String> {
        let options = self.options(puppet);
        let mut arguments = vec![options.puppet, format!("--seed={}", options.seed)];
        arguments.extend(options.motion.map(|motion| format!("--motion={motion}")));
        arguments.extend([format!("--flip={}", options.flip), format!("--drop={}", options.drop)]);
        arguments.extend(options.burst.iter().map(|burst| format!("--burst={burst}")));
        arguments.extend(options.pull.iter().map(|pull| format!("--pull={pull}")));
        arguments.extend(options.restart.iter().map(|restart| format!("--restart={restart}")));
        arguments
    }
}

/// `armature replay`
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// The take
    pub take: PathBuf,
    /// Write a picture of the character at this second of the take
    #[arg(long, value_name = "SECONDS", requires = "picture")]
    pub at: Option<f64>,
    /// The picture's file
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// The character for the picture; without it, the one the take was recorded with
    #[arg(short, long)]
    pub character: Option<String>,
}

/// `armature export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The take
    pub take: PathBuf,
    /// Where to: a .bvh or .glb file
    #[arg(short, long, value_name = "FILE")]
    pub to: PathBuf,
    /// Frames a second of the exported motion; the take's own time stamps are resampled to it
    #[arg(long, default_value_t = 60.0, value_parser = sample_rate)]
    pub fps: f64,
    /// The character whose mesh goes into a GLB; without it, the one the take was recorded with
    #[arg(short, long)]
    pub character: Option<String>,
}

/// `armature bench`
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Which benchmarks: any part of their names; all without it
    pub what: Option<String>,
    /// One JSON object a line
    #[arg(long)]
    pub json: bool,
    /// Only list the names
    #[arg(long)]
    pub list: bool,
    /// Mesh and skeleton to bind in `heat/…` (an OBJ and a TGF)
    #[arg(long, num_args = 2, value_names = ["MESH", "SKELETON"])]
    pub model: Option<Vec<PathBuf>>,
    /// Seconds of the stream benchmark
    #[arg(long, default_value_t = 60.0, value_parser = positive_seconds)]
    pub stream_seconds: f64,
    /// A Python that has Blender's `bpy` module, to run Blender's automatic weights beside ours
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_BPY_PYTHON")]
    pub bpy_python: Option<PathBuf>,
}

/// `armature sim`
#[derive(Debug, Args)]
pub struct SimArgs {
    /// The puppet and what goes wrong.
    #[command(flatten)]
    pub options: serve::Options,
    /// Serve on this TCP address in place of a pseudo-terminal; port 0 picks a free one
    #[arg(long, value_name = "HOST:PORT")]
    pub tcp: Option<String>,
    /// Stop when standard input ends, as it does when the program that started this one is gone
    #[arg(long)]
    pub until_input_ends: bool,
}

/// `armature window`
#[derive(Debug, Default, Args)]
pub struct WindowArgs {
    /// Connect to this puppet at once
    #[arg(short, long)]
    pub device: Option<String>,
    /// Load this character
    #[arg(short, long, default_value = "human")]
    pub character: String,
}

fn positive_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| format!("{text:?} is not a number of seconds"))?;
    if seconds.is_finite() && seconds > 0.0 && seconds <= 86_400.0 {
        Ok(seconds)
    } else {
        Err("give a number of seconds above 0 and up to a day (86400)".into())
    }
}

fn sample_rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if rate.is_finite() && (1.0..=4000.0).contains(&rate) { Ok(rate) } else { Err("give 1 to 4000 a second".into()) }
}

fn influence_count(text: &str) -> Result<usize, String> {
    let count: usize = text.parse().map_err(|_| format!("{text:?} is not a whole number"))?;
    if (1..=8).contains(&count) { Ok(count) } else { Err("give 1 to 8; most engines take 4".into()) }
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
    match command.unwrap_or_else(|| Command::Window(WindowArgs { device: None, character: "human".into() })) {
        Command::Demo(args) => commands::demo(&args, talk),
        Command::Devices => commands::devices(),
        Command::Inspect(args) => commands::inspect(&args),
        Command::Bind(args) => commands::bind(&args, talk),
        Command::Run(args) => commands::run(&args, talk),
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
    let subscriber = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).without_time();
    // A second subscriber in one process (tests) keeps the first.
    let _ = subscriber.try_init();
}
