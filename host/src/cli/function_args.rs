//! The options of the subcommands that compute functions on a mesh other than weights.

use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};

use super::numbers::{not_negative, positive};
use crate::files::Overwrite;

/// Without `--detail`, this many mean edges of the mesh.
pub const DETAIL_EDGES: f64 = 10.0;
/// How often the order in which values rise is taken from the result, unless given.
const CONVEXIFICATIONS: usize = 3;

/// How smooth functions are solved for.
#[derive(Clone, Copy, Debug, Args)]
pub struct SolverArgs {
    /// Order of smoothness, 2 to 4: higher ones are smoother at extrema, and take a better mesh
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(2..=4), default_value_t = 2)]
    pub order: u8,
    /// How often, at most, the directions in which the function rises are taken from the result and it is solved for
    /// again; that lowers its energy, and stops when it gains nothing
    #[arg(long, value_name = "TIMES", default_value_t = CONVEXIFICATIONS)]
    pub convexify: usize,
}

const SMOOTH_HELP: &str = "\
Data, such as distances, measurements or painted weights, lose their noise, but of their minima and maxima exactly those stay \
that you keep, where they are and with their values; no new ones appear (topology-aware smoothing, Jacobson, Weinkauf & \
Sorkine 2012). An extremum's persistence is its difference to the saddle at which it meets a more extreme one. The report says \
how many extrema there were, which were kept, and how far values can be from the best function that rises along the same edges.

  armature smooth face.obj --data painted.npy --keep 6 -o smoothed.npy --picture smoothed.png
  armature smooth face.obj --data painted.npy --persistence 0.1 --detail 0.05 -o smoothed.dmat
  armature smooth face.obj --geodesic 0 --keep 2 -o distances.npy      distances along the surface, without their cusps";

/// `armature smooth`
#[derive(Debug, Args)]
#[command(after_help = SMOOTH_HELP, group = ArgGroup::new("kept").required(true).args(["keep", "persistence"]), group = ArgGroup::new("source").required(true).args(["data", "geodesic"]))]
pub struct SmoothArgs {
    /// The mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh)
    pub mesh: PathBuf,
    /// The data: a .npy or .dmat file with a row for each vertex of the mesh and a column for each function
    #[arg(long, value_name = "F.npy")]
    pub data: Option<PathBuf>,
    /// Instead of data, the distances along the surface from these vertices (counted from 0, separated by commas)
    #[arg(long, value_name = "VERTEX", value_delimiter = ',')]
    pub geodesic: Vec<usize>,
    /// Keep this many extrema, the most persistent; at least 2
    #[arg(long, value_name = "N")]
    pub keep: Option<usize>,
    /// Keep the extrema that are at least this persistent, in units of the data
    #[arg(long, value_name = "P", value_parser = not_negative)]
    pub persistence: Option<f64>,
    /// Waves of this length along the mesh lose half of their height, shorter ones more (mesh unit)
    #[arg(long, value_name = "LENGTH", value_parser = positive, help = detail_help())]
    pub detail: Option<f64>,
    /// How they are solved for.
    #[command(flatten)]
    pub solver: SolverArgs,
    /// Where to write the smoothed data: a .npy or .dmat file
    #[arg(short, long, default_value = "smoothed.npy")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Write a picture: the data on the left, smoothed on the right, minima blue and maxima red
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// The column to show, from 1
    #[arg(long, value_name = "COLUMN", requires = "picture", default_value_t = 1)]
    pub picture_of: usize,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

impl SmoothArgs {
    /// The file that errors in the data are about.
    pub fn source(&self) -> &Path {
        self.data.as_deref().unwrap_or(&self.mesh)
    }
}

fn detail_help() -> String {
    format!(
        "Waves of this length along the mesh lose half of their height, shorter ones more (mesh unit) [default: \
         {DETAIL_EDGES} mean edges]"
    )
}

const INTERPOLATE_HELP: &str = "\
Values or colours at points, curves and regions spread over a surface or a flat figure: each is blended by a monotone function \
that is one there, zero at the others, and has no other minima or maxima, so that no colour fades and comes back, and no value \
leaves the range of the given ones. The values are a text file with one line for each; # starts a comment:

  point 0 1.6 0.2 = 1 0 0           the vertex nearest to a point
  vertex 17 = #ff8800               a vertex, counted from 0; a colour as three numbers 0 to 1, or in hexadecimal
  curve 17 18 25 = 0 0 1            vertices along a curve
  region 0 1.5 0 0.4 = 0 1 0        all vertices in this ball (centre, radius)

All have as many numbers: one for a plain function, three for colours. Lines with equal values are blended as one.

  armature interpolate face.obj colours.txt -o colours.npy --picture colours.png";

/// `armature interpolate`
#[derive(Debug, Args)]
#[command(after_help = INTERPOLATE_HELP)]
pub struct InterpolateArgs {
    /// The mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh)
    pub mesh: PathBuf,
    /// The values: a text file
    pub values: PathBuf,
    /// How they are solved for.
    #[command(flatten)]
    pub solver: SolverArgs,
    /// Where to write the values of every vertex: a .npy or .dmat file
    #[arg(short, long, default_value = "interpolated.npy")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Write a picture: three numbers as colours, one with lines of equal value
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}
