//! The options of the subcommands that work on takes.

use std::path::PathBuf;

use armature_take::FrameRate;
use clap::Args;

use super::numbers::positive;
use crate::characters::ground::GroundArgs;
use crate::characters::shapes::ShapeArgs;
use crate::files::Overwrite;

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
}

/// `armature export`
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// The take, or an edit list (.edit)
    pub take: PathBuf,
    /// The file to write: .bvh, .glb or .fbx
    #[arg(short, long, value_name = "FILE")]
    pub to: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Frames per second of the exported motion: a number, a fraction such as 24000/1001, or 29.97df or 59.94df for drop
    /// frame. 23.976, 29.97 and 59.94 are the exact rates of film and video. The take is resampled from its own time
    /// stamps
    #[arg(long, default_value = "60")]
    pub fps: FrameRate,
    /// Remove what moves faster than half the frame rate where the rate falls; otherwise a tremor comes back as a slow
    /// wobble
    #[arg(long)]
    pub low_pass: bool,
    /// Timecode of the first frame, HH:MM:SS:FF (HH:MM:SS;FF for drop frame). GLB keeps it in the animation's extras, FBX
    /// in properties of the armature; BVH has no place for it
    #[arg(long, value_name = "TIMECODE")]
    pub start_timecode: Option<String>,
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
    /// The character whose mesh is exported in a GLB or FBX; without it, the one the take was recorded with
    #[arg(short, long)]
    pub character: Option<String>,
    /// Shapes of the character.
    #[command(flatten)]
    pub shapes: ShapeArgs,
}
