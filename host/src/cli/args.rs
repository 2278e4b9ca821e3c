//! The options of each subcommand.

use std::path::PathBuf;

use armature_sim::serve;
use clap::{Args, ValueEnum};

use super::names::{arm_help, character_help, device_help, puppet_help, vertices_help};
use crate::characters::dynamics::DynamicsArgs;
use crate::characters::ground::GroundArgs;
use crate::characters::inverse_kinematics::IkArgs;
use crate::characters::shapes::ShapeArgs;
use crate::characters::skin::SkinArgs;
use crate::characters::targets::TargetArgs;
use crate::engine::puppet_rest::PuppetRest;
use crate::engine::sources::simulated::SimulatedArgs;
use crate::files::Overwrite;
use crate::pictures::slice::Axis;
use crate::streams::StreamArgs;

/// `armature demo`
#[derive(Debug, Args)]
pub struct DemoArgs {
    /// Folder for the take, the exports and the picture; without it armature-demo, or the first of armature-demo-2 and
    /// so on that is not there yet
    #[arg(short, long)]
    pub output: Option<PathBuf>,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// How long the puppet performs
    #[arg(long, default_value_t = 10.0, value_parser = positive_seconds)]
    pub seconds: f64,
    /// Samples per second
    #[arg(long, default_value_t = 200.0, value_parser = sample_rate)]
    pub rate: f64,
    /// Seed of the simulated puppet
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[arg(long, default_value = "human", help = puppet_help())]
    #[expect(missing_docs, reason = "its help is put together from the puppets there are")]
    pub puppet: String,
    /// What the puppet does: walk, wave, walk+wave, wiggle, squat, sit, kick, reach, cartwheel, or a BVH file of a human
    /// figure
    #[arg(long)]
    pub motion: Option<String>,
    /// Bones without a joint.
    #[command(flatten)]
    pub ik: IkArgs,
    /// The skin.
    #[command(flatten)]
    pub skin: SkinArgs,
}

/// `armature inspect`
#[derive(Debug, Args)]
pub struct InspectArgs {
    /// A mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh), skeleton (tgf), motion (bvh), character (armature) or take
    pub file: PathBuf,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

const VOLUME_HELP: &str = "\
The generalized winding number decides what is inside, so the mesh may be open, self-intersecting, or partly inside \
out. A flat mesh is filled with triangles. The extension chooses the format: .mesh (Medit), .msh (Gmsh) or .vtu (VTK, \
ParaView); the last two hold the winding number of every cell.

  armature volume truck.obj -o truck.vtu --slice truck.png --slice-axis x
  armature volume body.obj --skeleton bones.tgf -o body.mesh            vertices along every bone
  armature volume body.obj --conforming -o body.msh                     every vertex of the mesh is one of the volume";

/// What else a volume must satisfy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum VolumeRequirement {
    /// An element inside at every facet of the surface that was recovered, so that thin accessories stay; without
    /// --conforming these are facets of the simplified surface. Not for flat meshes. The report counts exceptions
    Facets,
    /// A manifold boundary: no two parts meet only in an edge or a vertex. Not for flat meshes
    Manifold,
}

/// `armature volume`
#[derive(Debug, Args)]
#[command(after_help = VOLUME_HELP)]
pub struct VolumeArgs {
    /// The mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh)
    pub mesh: PathBuf,
    /// The skeleton (tgf, bvh, fbx, or a gltf/glb with a skin); the volume gets vertices along its bones. A rigged glTF uses
    /// its own unless this is given
    #[arg(short, long)]
    pub skeleton: Option<PathBuf>,
    /// Point handles: every node of this TGF file becomes a vertex of the volume
    #[arg(long, value_name = "TGF")]
    pub points: Option<PathBuf>,
    /// Where to write the volume: a .mesh, .msh or .vtu file
    #[arg(short, long, default_value = "volume.mesh")]
    pub output: PathBuf,
    /// Keep every vertex of the mesh and as many of its facets as possible. Slower and larger than the default, a coarser
    /// volume around the mesh
    #[arg(long, conflicts_with = "vertices")]
    pub conforming: bool,
    #[arg(long, value_parser = volume_vertices, help = vertices_help())]
    #[expect(missing_docs, reason = "its help takes the number from the default")]
    pub vertices: Option<usize>,
    /// What else the volume must satisfy; separate several with commas
    #[arg(long, value_enum, value_delimiter = ',')]
    pub require: Vec<VolumeRequirement>,
    /// Write a picture of a slice through the volume, coloured by winding number
    #[arg(long, value_name = "PNG")]
    pub slice: Option<PathBuf>,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// The axis that the slice is perpendicular to; without it, the one along which the mesh is shortest
    #[arg(long, value_enum, requires = "slice")]
    pub slice_axis: Option<Axis>,
    /// Where along the axis: 0 at the low end of the mesh, 1 at the high end
    #[arg(long, default_value_t = 0.5, value_parser = share)]
    pub slice_at: f64,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

/// `armature run`
#[derive(Debug, Args)]
#[expect(clippy::struct_excessive_bools, reason = "each is an option of the command line")]
pub struct RunArgs {
    #[arg(short, long, default_value = "sim:human", help = device_help())]
    #[expect(missing_docs, reason = "its help is put together from the puppets there are")]
    pub device: String,
    #[arg(long, value_name = "ARM", help = arm_help())]
    #[expect(missing_docs, reason = "its help is put together from the arms there are")]
    pub preset: Option<String>,
    /// Set the servos' return delay to 0. This is written to their memory and stays
    #[arg(long)]
    pub servo_return_delay_zero: bool,
    #[arg(short, long, help = character_help())]
    #[expect(missing_docs, reason = "its help is put together from the characters there are")]
    pub character: Option<String>,
    /// How long to run, counted from the first pose; without it, until Ctrl-C. A puppet that has not given one 12 s after
    /// its line was opened, and a lost line that is not back after 30 s, end the run
    #[arg(short, long, value_parser = positive_seconds)]
    pub seconds: Option<f64>,
    /// Record the performance into this take
    #[arg(short, long, value_name = "TAKE")]
    pub record: Option<PathBuf>,
    /// Samples per second to ask the puppet for
    #[arg(long, default_value_t = 200.0, value_parser = sample_rate)]
    pub rate: f64,
    /// Which joint drives which bone (TOML); without it, proposed from the shapes of puppet and skeleton
    #[arg(long, value_name = "TOML")]
    pub mapping: Option<PathBuf>,
    /// The pose in which the puppet is zeroed: t (arms out), a (arms half down), puppet (what is known of a simulated
    /// one), or character (as the character rests: no bone is turned). Without it, what --mapping says; without that,
    /// puppet. --save-mapping writes what is turned
    #[arg(long, value_name = "POSE")]
    pub puppet_rest: Option<PuppetRest>,
    /// Save the mapping in use, so that you can correct it
    #[arg(long, value_name = "TOML")]
    pub save_mapping: Option<PathBuf>,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Calibration file to use and update; without it, the one kept for this user (never for a simulated puppet)
    #[arg(long, value_name = "TOML")]
    pub calibration: Option<PathBuf>,
    /// Use the pose at the start as the rest pose even if the joints are calibrated
    #[arg(long)]
    pub zero: bool,
    /// Filter for joints without their own in the calibration file: none, hold:MS, or one-euro:HERTZ,BETA (cutoff at
    /// rest, and how it grows with speed). Its lag is reported
    #[arg(long)]
    pub filter: Option<armature_rig::Filter>,
    /// Save --filter in the calibration file; without this, it is for this run only
    #[arg(long, requires = "filter")]
    pub save_filter: bool,
    /// Bones without a joint.
    #[command(flatten)]
    pub ik: IkArgs,
    /// Standing and walking.
    #[command(flatten)]
    pub ground: GroundArgs,
    /// Bones that swing.
    #[command(flatten)]
    pub dynamics: DynamicsArgs,
    /// Blend shapes.
    #[command(flatten)]
    pub shapes: ShapeArgs,
    /// The skin.
    #[command(flatten)]
    pub skin: SkinArgs,
    /// Dragging.
    #[command(flatten)]
    pub targets: TargetArgs,
    /// Other programs that get the poses.
    #[command(flatten)]
    pub streams: StreamArgs,
    /// The simulated puppet.
    #[command(flatten)]
    pub simulated: SimulatedArgs,
    /// Run a simulated puppet on a virtual clock: as fast as the machine can, and the same every time
    #[arg(long)]
    pub virtual_clock: bool,
}

const CALIBRATE_HELP: &str = "\
The steps, in their usual order. Each starts with a countdown, and nothing changes before it is finished:
  zero       the rest pose
  sweep      range, direction and wrap-around of every sensor that you move from stop to stop
  mounting   how each part is turned compared with how it should sit, from a bend and a twist
  heading    which way the puppet faces

  armature calibrate --device serial:/dev/ttyACM0 --step zero,sweep
  armature calibrate --device sim:human --step zero,sweep -o sim.toml

The calibration belongs to the parts' own numbers, so it stays valid wherever a part is plugged in. The file is plain
text that you can edit; the previous one is kept as .bak.";

/// `armature calibrate`
#[derive(Debug, Args)]
#[command(after_help = CALIBRATE_HELP)]
pub struct CalibrateArgs {
    /// The puppet, as for `armature run`
    #[arg(short, long, default_value = "sim:human")]
    pub device: String,
    #[arg(long, value_name = "ARM", help = arm_help())]
    #[expect(missing_docs, reason = "its help is put together from the arms there are")]
    pub preset: Option<String>,
    /// What to calibrate: zero, sweep, mounting, heading; separate several with commas. Without it, zero
    #[arg(long, value_delimiter = ',')]
    pub step: Vec<armature_rig::CalibrationStep>,
    /// Seconds to get ready before each measurement
    #[arg(long, default_value_t = 3.0, value_parser = seconds)]
    pub countdown: f64,
    /// Seconds to hold each pose
    #[arg(long, default_value_t = 0.5, value_parser = positive_seconds)]
    pub hold: f64,
    /// Seconds of the sweep
    #[arg(long, default_value_t = 20.0, value_parser = positive_seconds)]
    pub sweep_seconds: f64,
    /// Calibration file to use and update; without it, the one kept for this user
    #[arg(short, long, value_name = "TOML")]
    pub output: Option<PathBuf>,
    /// Which joint drives which bone (TOML); without it, proposed from the shapes of puppet and skeleton
    #[arg(long, value_name = "TOML")]
    pub mapping: Option<PathBuf>,
    /// The character whose bones are driven
    #[arg(short, long)]
    pub character: Option<String>,
    /// The simulated puppet.
    #[command(flatten)]
    pub simulated: SimulatedArgs,
    /// Calibrate a simulated puppet on a virtual clock, as fast as the machine can
    #[arg(long)]
    pub virtual_clock: bool,
}

/// `armature bench`
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Which benchmarks: any part of their names. Without it, all
    pub what: Option<String>,
    /// Print one JSON object per line
    #[arg(long)]
    pub json: bool,
    /// List the names only
    #[arg(long)]
    pub list: bool,
    /// Mesh (OBJ) and skeleton (TGF) to bind in `heat/…`
    #[arg(long, num_args = 2, value_names = ["MESH", "SKELETON"])]
    pub model: Option<Vec<PathBuf>>,
    /// Seconds of the stream benchmark
    #[arg(long, default_value_t = 60.0, value_parser = positive_seconds)]
    pub stream_seconds: f64,
    /// Seconds of virtual time of `device/soak-…`
    #[arg(long, default_value_t = 600, value_parser = clap::value_parser!(u64).range(10..=86_400))]
    pub soak_seconds: u64,
    /// How many times `device/replug-…` pulls the cable
    #[arg(long, default_value_t = 100, value_parser = clap::builder::RangedU64ValueParser::<usize>::new().range(1..=10_000))]
    pub replugs: usize,
    /// A Python with Blender's `bpy` module, to compare with its automatic weights and its importer
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_BPY_PYTHON")]
    pub bpy_python: Option<PathBuf>,
    /// A Python with `libigl`, to compare with its winding numbers and weights
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_IGL_PYTHON")]
    pub igl_python: Option<PathBuf>,
    /// A Python with `tetgen`, to compare with its volumes
    #[arg(long, value_name = "PYTHON", env = "ARMATURE_TETGEN_PYTHON")]
    pub tetgen_python: Option<PathBuf>,
    /// Where to write the plot of `volume/growth`, `weights/growth`, `weights/convergence` or `surface/convergence`
    #[arg(long, value_name = "SVG")]
    pub plot: Option<PathBuf>,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
}

/// `armature devices`
#[derive(Debug, Default, Args)]
pub struct DevicesArgs {
    /// Keep watching, and report what is plugged in and out (Ctrl-C ends)
    #[arg(long)]
    pub watch: bool,
    /// Stop watching after this time
    #[arg(long, value_name = "SECONDS", requires = "watch", value_parser = seconds)]
    pub seconds: Option<f64>,
    /// Explain the bytes of a capture (raw, or as hexadecimal digits; - is standard input) or of a device, and what is
    /// wrong with each malformed frame
    #[arg(long, value_name = "FILE|ADDRESS", conflicts_with = "watch")]
    pub decode: Option<String>,
    /// Print the udev rules that let any Linux user open puppets and servo adapters:
    /// `armature devices --udev-rules | sudo tee /etc/udev/rules.d/70-armature.rules`, then
    /// `sudo udevadm control --reload`, and plug the device in again
    #[arg(long, conflicts_with_all = ["watch", "decode"])]
    pub udev_rules: bool,
    /// How long to listen to the device that is decoded, from its first byte on
    #[arg(long, value_name = "SECONDS", default_value_t = 3.0, value_parser = positive_seconds)]
    pub listen: f64,
}

/// `armature sim`
#[derive(Debug, Args)]
pub struct SimArgs {
    /// The puppet and its faults.
    #[command(flatten)]
    pub options: serve::Options,
    /// Serve on this TCP address instead of a pseudo-terminal; port 0 picks a free one
    #[arg(long, value_name = "HOST:PORT")]
    pub tcp: Option<String>,
    /// Stop when standard input ends, as it does when the program that started this one has ended
    #[arg(long)]
    pub until_input_ends: bool,
}

/// `armature window`
#[derive(Debug, Default, Args)]
pub struct WindowArgs {
    /// Connect to this puppet at start
    #[arg(short, long)]
    pub device: Option<String>,
    /// Load this character; without it, the one that matches the simulated puppet, else human
    #[arg(short, long)]
    pub character: Option<String>,
    /// The skins of this and all other characters that are loaded.
    #[command(flatten)]
    pub skin: SkinArgs,
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
