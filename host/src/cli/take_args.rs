//! The options of the subcommands that work on takes.

use std::path::PathBuf;

use armature_rig::{BoneNames, RestPose};
use armature_take::FrameRate;
use clap::Args;

use super::numbers::positive;
use crate::characters::ground::GroundArgs;
use crate::characters::shapes::ShapeArgs;
use crate::characters::skin::SkinArgs;
use crate::files::Overwrite;

/// The order in which a BVH names rotations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
#[expect(missing_docs, reason = "the axes need no words")]
pub enum RotationOrder {
    #[default]
    Zxy,
    Xyz,
    Xzy,
    Yxz,
    Yzx,
    Zyx,
}

impl RotationOrder {
    /// The axes, x = 0.
    pub fn axes(self) -> [usize; 3] {
        match self {
            Self::Zxy => [2, 0, 1],
            Self::Xyz => [0, 1, 2],
            Self::Xzy => [0, 2, 1],
            Self::Yxz => [1, 0, 2],
            Self::Yzx => [1, 2, 0],
            Self::Zyx => [2, 1, 0],
        }
    }
}

/// A unit of length.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum LengthUnit {
    /// Metres: the character's own numbers
    #[default]
    M,
    /// Centimetres: a hundred times as many
    Cm,
}

impl LengthUnit {
    /// How many of it are a metre.
    pub fn of_metre(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Cm => 100.0,
        }
    }
}

/// `armature replay`
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// The take
    pub take: PathBuf,
    /// Compare with the poses recorded in this other take instead of its own, and report the first difference: joint, time
    /// and angle. For CI: keep a take that is right, and replay its samples with every new version
    #[arg(long, value_name = "TAKE")]
    pub verify: Option<PathBuf>,
    /// With --verify: rotations may differ by this many degrees, and places by what that angle makes of the skeleton's
    /// size; without it, every bit counts
    #[arg(long, value_name = "DEGREES", requires = "verify", value_parser = positive)]
    pub tolerance: Option<f64>,
    /// Draw the character at this second of the take
    #[arg(long, value_name = "SECONDS", requires = "picture")]
    pub at: Option<f64>,
    /// Where to write the picture
    #[arg(long, value_name = "PNG", requires = "at")]
    pub picture: Option<PathBuf>,
    /// Draw moments of the take side by side on one floor, seen from the character's right
    #[arg(long, value_name = "PNG")]
    pub filmstrip: Option<PathBuf>,
    /// How many moments are on the filmstrip
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u8).range(2..=32))]
    pub moments: u8,
    /// Where the filmstrip begins and ends, seconds of the take; without it, the whole take
    #[arg(long, value_name = "SECONDS", num_args = 2, requires = "filmstrip")]
    pub between: Option<Vec<f64>>,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// The samples are solved again like this; without it, as the take was recorded.
    #[command(flatten)]
    pub ground: GroundArgs,
    /// The character, for the picture and for bones posed by inverse kinematics; without it, the one the take was
    /// recorded with
    #[arg(short, long)]
    pub character: Option<String>,
    /// Shapes of the character in the picture.
    #[command(flatten)]
    pub shapes: ShapeArgs,
    /// Its skin in the picture.
    #[command(flatten)]
    pub skin: SkinArgs,
}

/// `armature retarget`
#[derive(Debug, Args)]
pub struct RetargetArgs {
    /// The motion: a .bvh, .fbx, .glb or .gltf, a take, or an edit list
    pub motion: PathBuf,
    /// The character that shall move so: human, or a file with a skeleton
    #[arg(short, long)]
    pub character: String,
    /// The file to write: a .take, which can be played, edited and exported, or any format of `armature export`
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// The clip, if the file has several; without it, the first
    #[arg(long, value_name = "NAME")]
    pub clip: Option<String>,
    /// Frames per second of the file that is written; without it, the motion's own
    #[arg(long)]
    pub fps: Option<FrameRate>,
    /// How much larger the way of the hips is; without it, as much as the character's legs are longer
    #[arg(long, value_name = "FACTOR", value_parser = positive)]
    pub scale: Option<f64>,
    /// Turn bones only: feet that stand in the motion may slide
    #[arg(long)]
    pub no_contacts: bool,
}

/// `armature export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The take, an edit list (.edit), or a motion file (.bvh, .fbx, .glb, .gltf); or several, with a folder as --to
    #[arg(required = true)]
    pub take: Vec<PathBuf>,
    /// The file to write, or a folder for several: .bvh (skeleton and motion), .glb, .fbx, .usdz and .usda (with the
    /// character's mesh; a .usda without images), .vrma (a human's motion for any VRM avatar), .csv, .npz and .mcap
    /// (samples, angles and poses as numbers: a table, arrays for Python, a log for Foxglove)
    #[arg(short, long, value_name = "FILE")]
    pub to: PathBuf,
    /// The format, by its extension, where --to is a folder
    #[arg(long, value_name = "EXTENSION")]
    pub format: Option<String>,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Frames per second of the exported motion: a number, a fraction such as 24000/1001, or 29.97df or 59.94df for drop
    /// frame. 23.976, 29.97 and 59.94 are the exact rates of film and video. The take is resampled from its own time
    /// stamps; .csv and .mcap hold its samples as they are
    #[arg(long, default_value = "60")]
    pub fps: FrameRate,
    /// Remove what moves faster than half the frame rate where the rate falls; otherwise a tremor comes back as a slow
    /// wobble
    #[arg(long)]
    pub low_pass: bool,
    /// Timecode of the first frame, HH:MM:SS:FF (HH:MM:SS;FF for drop frame). GLB and VRMA keep it in the animation's
    /// extras, FBX in properties of the armature, USD in the layer's custom data; the others have no place for it
    #[arg(long, value_name = "TIMECODE")]
    pub start_timecode: Option<String>,
    /// Arms and legs rest in a T or an A in the file, whatever the character's own rest pose is; the motion stays the same
    #[arg(long, value_name = "t|a")]
    pub rest: Option<RestPose>,
    /// The first frame is the rest pose, and the motion begins with the second
    #[arg(long)]
    pub rest_first: bool,
    /// Call the bones that are recognised as another program does: mixamo, unreal, metahuman, vrm or cmu
    #[arg(long, value_name = "PROGRAM")]
    pub names: Option<BoneNames>,
    /// The order of the rotations of a BVH
    #[arg(long, value_enum, default_value_t)]
    pub rotation_order: RotationOrder,
    /// The unit of a BVH, which does not say it: a unit of the character counts as a metre
    #[arg(long, value_enum, default_value_t)]
    pub unit: LengthUnit,
    /// Also write the receipt as JSON: rate, jitter, losses, gaps, lag and drift of the take, and what was exported
    #[arg(long, value_name = "JSON")]
    pub receipt: Option<PathBuf>,
    /// Keep only the keys that are needed (GLB): no bone's rotation differs at any frame by more than this many degrees,
    /// and no translation by more than --feet or a thousandth of the skeleton's size
    #[arg(long, value_name = "DEGREES", num_args = 0..=1, default_missing_value = "0.5", value_parser = positive)]
    pub reduce_keys: Option<f64>,
    /// With --reduce-keys: no foot moves by more than this, in the character's unit. Feet are the ends of chains that are
    /// on the ground in the rest pose
    #[arg(long, value_name = "DISTANCE", requires = "reduce_keys", value_parser = positive)]
    pub feet: Option<f64>,
    /// With --reduce-keys: cubic splines between keys instead of straight lines, for programs that read their tangents
    /// (Blender puts its own in their place)
    #[arg(long, requires = "reduce_keys")]
    pub splines: bool,
    /// The samples are solved again like this; without it, as the take was recorded.
    #[command(flatten)]
    pub ground: GroundArgs,
    /// The character whose mesh is exported in a GLB, FBX or USD; without it, the one the take was recorded with. One with another
    /// skeleton performs the take anew: its samples are solved again, with a mapping that is proposed or given
    #[arg(short, long)]
    pub character: Option<String>,
    /// Which joint drives which bone (TOML): the samples are solved again with it
    #[arg(long, value_name = "TOML")]
    pub mapping: Option<PathBuf>,
    /// Shapes of the character.
    #[command(flatten)]
    pub shapes: ShapeArgs,
}
