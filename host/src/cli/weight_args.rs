//! What the subcommands that compute weights can be told.

use std::path::PathBuf;

use armature_character::{BiharmonicTier, BindMethod, Partition, WEIGHT_VOLUME_VERTICES, WeightsOn};
use clap::{ArgGroup, Args, ValueEnum};

use super::args::volume_vertices;

/// How weights are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Bounded biharmonic weights, each within 0.002 of the optimal one
    #[default]
    Bbw,
    /// Bounded biharmonic weights, optimal to 0.00001 and to ten digits of the energy
    BbwCertified,
    /// Bone heat on the surface
    Heat,
}

impl Method {
    /// Most influences a vertex may have unless told otherwise. Smooth weights reach far: where many bones meet, four
    /// would leave seams.
    pub fn influences(self) -> usize {
        if self == Self::Heat { 4 } else { 8 }
    }

    /// For binding.
    pub fn for_bind(self) -> BindMethod {
        match self {
            Self::Bbw => BindMethod::Biharmonic(BiharmonicTier::Interactive),
            Self::BbwCertified => BindMethod::Biharmonic(BiharmonicTier::Certified),
            Self::Heat => BindMethod::BoneHeat,
        }
    }
}

/// How weights are computed for other tools.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum HandleMethod {
    /// Bounded biharmonic weights, each handle by itself, within 0.002 of the optimal ones
    #[default]
    Bbw,
    /// Bounded biharmonic weights, each handle by itself, optimal to 0.00001 and to ten digits of the energy
    BbwCertified,
    /// Bounded biharmonic weights of all handles together, so that they sum to one by themselves; within 0.002 of the
    /// optimal ones
    BbwExact,
    /// Bone heat on the surface
    Heat,
}

impl HandleMethod {
    /// How good bounded biharmonic weights have to be.
    pub fn tier(self) -> BiharmonicTier {
        if self == Self::BbwCertified { BiharmonicTier::Certified } else { BiharmonicTier::Interactive }
    }

    /// How they come to sum to one.
    pub fn partition(self, left: bool) -> Partition {
        match (self, left) {
            (Self::BbwExact, _) => Partition::Exact,
            (_, true) => Partition::Left,
            (_, false) => Partition::Normalised,
        }
    }
}

/// What bounded biharmonic weights are computed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum On {
    /// A volume made for it; of a flat mesh the triangles that fill it
    Volume,
    /// The triangles of the surface alone: faster, but blind to what is near through the inside
    Surface,
}

/// The shape that weights are computed on.
#[derive(Clone, Copy, Debug, Args)]
pub struct DomainArgs {
    /// What bounded biharmonic weights are computed on; without it the volume, and for a tetrahedral mesh given to
    /// `armature weights` its own tetrahedra
    #[arg(long, value_enum)]
    pub on: Option<On>,
    /// About how many vertices the volume has (5000 unless told otherwise)
    #[arg(long, value_parser = volume_vertices)]
    pub vertices: Option<usize>,
}

impl DomainArgs {
    /// As the solver is told; `otherwise` where nothing was asked for.
    pub fn weights_on(&self, otherwise: WeightsOn) -> WeightsOn {
        let volume = WeightsOn::Volume { vertices: self.vertices.unwrap_or(WEIGHT_VOLUME_VERTICES) };
        match (self.on, self.vertices) {
            (Some(On::Surface), _) => WeightsOn::Surface,
            (Some(On::Volume), _) | (None, Some(_)) => volume,
            (None, None) => otherwise,
        }
    }

    /// For a mesh that is to be filled unless told otherwise.
    pub fn volume_or_asked(&self) -> WeightsOn {
        self.weights_on(WeightsOn::Volume { vertices: WEIGHT_VOLUME_VERTICES })
    }
}

const BIND_HELP: &str = "\
The mesh is filled with tetrahedra that have vertices along the bones; bounded biharmonic weights (Jacobson et al. 2011) are \
computed on them and carried to the mesh's own vertices. The character remembers how its weights were made and how far \
they can be from the optimal ones. Binding the same files again takes the result from a cache.

  armature bind armadillo.obj --skeleton armadillo.tgf -o armadillo.armature
  armature bind armadillo.obj -s armadillo.tgf --method heat                    bone heat, for comparison
  armature bind fox.glb                                                         an artist's own weights stay
  armature bind body.obj -s bones.tgf --picture body.png --picture-of bone_3    where one bone moves the mesh";

/// `armature bind`
#[derive(Debug, Args)]
#[command(after_help = BIND_HELP)]
pub struct BindArgs {
    /// The mesh (obj, ply, stl, off, gltf, glb, mesh)
    pub mesh: PathBuf,
    /// The skeleton (tgf, bvh, or a gltf/glb with a skin); a rigged glTF brings its own
    #[arg(short, long)]
    pub skeleton: Option<PathBuf>,
    /// Where to save the character
    #[arg(short, long, default_value = "character.armature")]
    pub output: PathBuf,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = Method::Bbw)]
    pub method: Method,
    /// What on.
    #[command(flatten)]
    pub domain: DomainArgs,
    /// Most bones a vertex may follow, 1 to 8; without it 8, and 4 with bone heat
    #[arg(long, value_parser = influence_count)]
    pub influences: Option<usize>,
    /// Replace the skeleton and weights that the file itself brings
    #[arg(long)]
    pub replace_rig: bool,
    /// Compute again even if the same input was bound before
    #[arg(long)]
    pub no_cache: bool,
    /// Write a picture of the bound character
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// Show the weights in the picture: of one bone with lines of equal weight, or `all` in colours
    #[arg(long, value_name = "BONE", requires = "picture")]
    pub picture_of: Option<String>,
}

const WEIGHTS_HELP: &str = "\
Handles come from a TGF file: edges are bones, or with the columns \"0 0 1\" behind their ends (as libigl reads them) edges \
of a cage, open or closed, along which weights are linear; nodes that no bone touches are points. Columns of the result are \
the points in the order of the file, then the bones. Bones let go of the shape over a quarter of their length at joints they \
share, so that weights do not depend on how fine the volume is. Rows are the vertices of the mesh: all of them, in the order of the file. A \
tetrahedral .mesh is used as it is, any other mesh is filled with tetrahedra first. For each handle the report says the \
energy, how far a weight leaves 0 to 1, the largest multiplier of the wrong sign, how many active sets were tried, how far \
a weight can be from the optimal one, and whether it converged; if one did not, the exit code is 5.

  armature weights hand.mesh --handles hand.tgf -o weights.npy --picture weights.png
  armature weights hand.mesh --boundary b.npy bc.npy --no-normalize --method bbw-certified -o weights.npy
                                            b: fixed vertices, from 0; bc: their weights, a column for each handle
  armature weights body.obj --handles bones.tgf -o weights.dmat --json     as libigl reads them, and a report for scripts";

/// `armature weights`
#[derive(Debug, Args)]
#[command(after_help = WEIGHTS_HELP, group = ArgGroup::new("held").required(true).args(["handles", "boundary"]))]
pub struct WeightsArgs {
    /// The mesh (obj, ply, stl, off, gltf, glb, mesh)
    pub mesh: PathBuf,
    /// Bones, points and cages
    #[arg(long, value_name = "TGF")]
    pub handles: Option<PathBuf>,
    /// Fixed vertices of the mesh and their weights, as the boundary conditions of libigl
    #[arg(long, num_args = 2, value_names = ["B.npy", "BC.npy"])]
    pub boundary: Option<Vec<PathBuf>>,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = HandleMethod::Bbw)]
    pub method: HandleMethod,
    /// What on.
    #[command(flatten)]
    pub domain: DomainArgs,
    /// Leave each handle's weights as they were computed; without it those of a vertex are scaled to sum to one
    /// (bbw-exact needs no scaling)
    #[arg(long)]
    pub no_normalize: bool,
    /// Where to write the weights: a .npy or .dmat file
    #[arg(short, long, default_value = "weights.npy")]
    pub output: PathBuf,
    /// Write a picture of the weights on the mesh
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// Show the weights of one handle with lines of equal weight in place of all in colours
    #[arg(long, value_name = "HANDLE", requires = "picture")]
    pub picture_of: Option<String>,
    /// One JSON object in place of words
    #[arg(long)]
    pub json: bool,
}

fn influence_count(text: &str) -> Result<usize, String> {
    let count: usize = text.parse().map_err(|_| format!("{text:?} is not a whole number"))?;
    if (1..=8).contains(&count) { Ok(count) } else { Err("give 1 to 8; most engines take 4".into()) }
}
