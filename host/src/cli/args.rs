//! What each subcommand can be told.

use std::path::PathBuf;

use armature_sim::serve;
use clap::{Args, ValueEnum};

use crate::engine::completion::IkArgs;
use crate::engine::simulated::SimulatedArgs;
use crate::slice::Axis;

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
    /// The simulated puppet: human, human8 (eight joints for all of a human), spider, hand
    #[arg(long, default_value = "human")]
    pub puppet: String,
    /// What the puppet does: walk, wave, walk+wave, wiggle, or a BVH file of a human figure
    #[arg(long)]
    pub motion: Option<String>,
    /// What becomes of bones without a joint.
    #[command(flatten)]
    pub ik: IkArgs,
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

const VOLUME_HELP: &str = "\
What is inside is told by the generalized winding number, so that the mesh may be open, cut itself, and have parts that \
are inside out; a flat mesh is filled with triangles. The file is chosen by its extension: .mesh (Medit), .msh (Gmsh) and \
.vtu (VTK, ParaView); the last two hold the winding number of every cell.

  armature volume truck.obj -o truck.vtu --slice truck.png --slice-axis x
  armature volume body.obj --skeleton bones.tgf -o body.mesh            vertices along every bone
  armature volume body.obj --conforming -o body.msh                     every vertex of the mesh is one of the volume";

/// What a volume can be asked to obey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum VolumeRequirement {
    /// Each facet of the surface has an element, so that thin accessories stay
    Facets,
    /// The boundary is a manifold: no two parts meet in an edge or a vertex alone
    Manifold,
}

/// `armature volume`
#[derive(Debug, Args)]
#[command(after_help = VOLUME_HELP)]
pub struct VolumeArgs {
    /// The mesh (obj, ply, stl, off, gltf, glb, mesh)
    pub mesh: PathBuf,
    /// The skeleton (tgf, bvh, or a gltf/glb with a skin); vertices are put along its bones. A rigged glTF brings its own
    #[arg(short, long)]
    pub skeleton: Option<PathBuf>,
    /// Point handles: every node of a TGF file becomes a vertex
    #[arg(long, value_name = "TGF")]
    pub points: Option<PathBuf>,
    /// Where to write the volume: a .mesh, .msh or .vtu file
    #[arg(short, long, default_value = "volume.mesh")]
    pub output: PathBuf,
    /// Keep every vertex of the mesh and as many of its facets as can be had; slower and larger than a coarser volume
    /// around it, which is the default
    #[arg(long, conflicts_with = "vertices")]
    pub conforming: bool,
    /// About how many vertices a coarser volume has (10000 unless told otherwise)
    #[arg(long, value_parser = volume_vertices)]
    pub vertices: Option<usize>,
    /// What the volume has to obey besides, one or both with a comma between
    #[arg(long, value_enum, value_delimiter = ',')]
    pub require: Vec<VolumeRequirement>,
    /// Write a picture of a slice through the volume, coloured by winding number
    #[arg(long, value_name = "PNG")]
    pub slice: Option<PathBuf>,
    /// The axis that the slice stands across; without it, the one along which the mesh is shortest
    #[arg(long, value_enum, requires = "slice")]
    pub slice_axis: Option<Axis>,
    /// Where along the axis: 0 at the low end of the mesh, 1 at the high end
    #[arg(long, default_value_t = 0.5, value_parser = share)]
    pub slice_at: f64,
    /// One JSON object in place of words
    #[arg(long)]
    pub json: bool,
}

/// `armature run`
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The puppet: sim:human, sim:human8, sim:spider, sim:hand, sim:FILE.bvh, serial:PATH[@BAUD],
    /// usb:VID:PID[,SERIAL], hid:VID:PID[,SERIAL], tcp:HOST:PORT, or an arm of servos: feetech:PATH[@BAUD],
    /// dynamixel:PATH[@BAUD]
    #[arg(short, long, default_value = "sim:human")]
    pub device: String,
    /// Which arm of servos: so101-leader, koch-leader, gello, gello-franka
    #[arg(long, value_name = "ARM")]
    pub preset: Option<String>,
    /// Set the servos' return delay to 0; this is written to their memory once and stays
    #[arg(long)]
    pub servo_return_delay_zero: bool,
    /// The character: human, spider, hand, a .armature file, or a mesh or motion file that brings a skeleton; without
    /// it, the one like the simulated puppet, else human
    #[arg(short, long)]
    pub character: Option<String>,
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
    /// What is done to the readings of joints that have no filter of their own in the calibration file: none, hold:MS
    /// or one-euro:HERTZ,BETA (the cutoff at rest, and how it grows with the speed); the lag it adds is told
    #[arg(long)]
    pub filter: Option<armature_rig::Filter>,
    /// What becomes of bones without a joint.
    #[command(flatten)]
    pub ik: IkArgs,
    /// What a simulated puppet does.
    #[command(flatten)]
    pub simulated: SimulatedArgs,
    /// Run a simulated puppet on a clock of its own, as fast as the machine can and the same every time
    #[arg(long)]
    pub virtual_clock: bool,
}

const CALIBRATE_HELP: &str = "\
Steps, in the order in which they make sense; each counts down first, and nothing is changed before it is over:
  zero       the rest pose
  sweep      range, direction and wrap-around of every sensor that is moved from stop to stop
  mounting   how each part is turned against what is meant, from a bend and a twist
  heading    which way the puppet faces

  armature calibrate --device serial:/dev/ttyACM0 --step zero,sweep
  armature calibrate --device sim:human --step zero,sweep -o sim.toml

The calibration is kept by the parts' own numbers, so it stays true wherever a part is plugged in. The file can be read
and edited; the former one stays beside it as .bak.";

/// `armature calibrate`
#[derive(Debug, Args)]
#[command(after_help = CALIBRATE_HELP)]
pub struct CalibrateArgs {
    /// The puppet, as for `armature run`
    #[arg(short, long, default_value = "sim:human")]
    pub device: String,
    /// Which arm of servos: so101-leader, koch-leader, gello, gello-franka
    #[arg(long, value_name = "ARM")]
    pub preset: Option<String>,
    /// What to calibrate: zero, sweep, mounting, heading; several with commas between. Without it, zero
    #[arg(long, value_delimiter = ',')]
    pub step: Vec<armature_rig::CalibrationStep>,
    /// Seconds to get ready before each measurement
    #[arg(long, default_value_t = 3.0, value_parser = seconds)]
    pub countdown: f64,
    /// Seconds for which a pose is held
    #[arg(long, default_value_t = 0.5, value_parser = positive_seconds)]
    pub hold: f64,
    /// Seconds of the sweep
    #[arg(long, default_value_t = 20.0, value_parser = positive_seconds)]
    pub sweep_seconds: f64,
    /// Calibration file to use and update; without it, the one kept for this user
    #[arg(short, long, value_name = "TOML")]
    pub output: Option<PathBuf>,
    /// Which joint drives which bone (TOML); without it the program proposes
    #[arg(long, value_name = "TOML")]
    pub mapping: Option<PathBuf>,
    /// The character whose bones are driven
    #[arg(short, long)]
    pub character: Option<String>,
    /// What a simulated puppet does.
    #[command(flatten)]
    pub simulated: SimulatedArgs,
    /// Calibrate a simulated puppet on a clock of its own, as fast as the machine can
    #[arg(long)]
    pub virtual_clock: bool,
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
    /// The character, for the picture and for bones that inverse kinematics turned; without it, the one the take was
    /// recorded with
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
    /// Seconds of virtual time of `device/soak-…`
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u64).range(10..=86_400))]
    pub soak_seconds: u64,
    /// How often `device/replug-…` pulls the cable
    #[arg(long, default_value_t = 100, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=10_000))]
    pub replugs: usize,
    /// A Python that has Blender's `bpy` module, to run Blender's automatic weights beside ours
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_BPY_PYTHON")]
    pub bpy_python: Option<PathBuf>,
    /// A Python that has `libigl`, to run its winding numbers beside ours
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_IGL_PYTHON")]
    pub igl_python: Option<PathBuf>,
    /// A Python that has `tetgen`, to run it beside our volumes
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_TETGEN_PYTHON")]
    pub tetgen_python: Option<PathBuf>,
    /// Where to draw the times of `volume/growth` against the size
    #[arg(long, value_name = "SVG")]
    pub plot: Option<PathBuf>,
}

/// `armature devices`
#[derive(Debug, Default, Args)]
pub struct DevicesArgs {
    /// Go on looking, and tell what is plugged in and out (Ctrl-C ends)
    #[arg(long)]
    pub watch: bool,
    /// Watch for so long
    #[arg(long, value_name = "SECONDS", requires = "watch")]
    pub seconds: Option<f64>,
    /// Tell in words what the bytes of a capture (raw, or as hexadecimal digits; - is standard input) or of a device
    /// mean, and precisely what is wrong with each frame that is malformed
    #[arg(long, value_name = "FILE|ADDRESS", conflicts_with = "watch")]
    pub decode: Option<String>,
    /// Print the rules that let Linux users open puppets and servo adapters without being in a group:
    /// `armature devices --udev-rules | sudo tee /etc/udev/rules.d/70-armature.rules`, then
    /// `sudo udevadm control --reload`, and plug the device in again
    #[arg(long, conflicts_with_all = ["watch", "decode"])]
    pub udev_rules: bool,
    /// For how long to listen to a device that is decoded
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0, value_parser = positive_seconds)]
    pub listen: f64,
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
    /// Load this character; without it, the one like the simulated puppet, else human
    #[arg(short, long)]
    pub character: Option<String>,
}

fn positive_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| format!("{text:?} is not a number of seconds"))?;
    if seconds.is_finite() && seconds > 0.0 && seconds <= 86_400.0 {
        Ok(seconds)
    } else {
        Err("give a number of seconds above 0 and up to a day (86400)".into())
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    if text.parse() == Ok(0.0) { Ok(0.0) } else { positive_seconds(text) }
}

fn sample_rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if rate.is_finite() && (1.0..=4000.0).contains(&rate) { Ok(rate) } else { Err("give 1 to 4000 a second".into()) }
}

pub(super) fn volume_vertices(text: &str) -> Result<usize, String> {
    let count: usize = text.parse().map_err(|_| format!("{text:?} is not a whole number"))?;
    if (100..=5_000_000).contains(&count) { Ok(count) } else { Err("give 100 to 5000000 vertices".into()) }
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err("give a number from 0 to 1".into()) }
}
