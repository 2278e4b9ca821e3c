//! The options of the subcommands that fit a skeleton into a mesh.

use std::path::PathBuf;
use std::str::FromStr;

use armature_character::rigging::RigSettings;
use clap::Args;

use super::numbers::finite;
use crate::files::Overwrite;

/// A direction in the mesh's own axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction(pub [f64; 3]);

impl FromStr for Direction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let axis = match text.trim_start_matches('+') {
            "x" => Some([1.0, 0.0, 0.0]),
            "y" => Some([0.0, 1.0, 0.0]),
            "z" => Some([0.0, 0.0, 1.0]),
            "-x" => Some([-1.0, 0.0, 0.0]),
            "-y" => Some([0.0, -1.0, 0.0]),
            "-z" => Some([0.0, 0.0, -1.0]),
            _ => None,
        };
        let numbers = || text.split(',').map(|word| finite(word.trim()).ok()).collect::<Option<Vec<f64>>>();
        let given = axis.or_else(|| <[f64; 3]>::try_from(numbers()?).ok());
        let usable = |way: &[f64; 3]| way.iter().any(|&n| n != 0.0);
        given
            .filter(usable)
            .map(Self)
            .ok_or_else(|| "give x, y, z, -x, -y, -z, or three numbers such as 1,0,0.5".to_owned())
    }
}

/// How a template is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Args)]
pub struct TemplateArgs {
    /// Which way is up in the mesh: x, y, z, -x, -y, -z or three numbers; without it, found out
    #[arg(long, value_name = "DIRECTION", allow_hyphen_values = true)]
    pub up: Option<Direction>,
    /// Which way the figure looks; without it, found out
    #[arg(long, value_name = "DIRECTION", allow_hyphen_values = true)]
    pub front: Option<Direction>,
    /// Place left and right each on its own, even where the mesh is nearly symmetric
    #[arg(long)]
    pub no_symmetry: bool,
}

impl TemplateArgs {
    /// For the fit.
    pub fn settings(&self) -> RigSettings {
        RigSettings { up: self.up.map(|way| way.0), front: self.front.map(|way| way.0), symmetric: !self.no_symmetry }
    }
}

const RIG_HELP: &str = "\
The inside of the mesh is sampled by its winding number, so the mesh may be open or consist of several pieces. The template \
is embedded where its limbs fit those of the mesh in length, direction and symmetry (after Baran and Popović 2007), and its \
joints go to the middle of the limbs: where a limb bends, else in the template's proportions. Each bone is reported with how \
sure it is, and what the shape cannot tell is said. The bones' names are those that mappings and the recogniser know.

The extension of the result chooses the format: .bvh and .glb keep the names, .tgf numbers the bones. Correct a joint in any \
program that reads them, then bind.

  armature rig body.obj --template human -o body.bvh --picture body.png
  armature bind body.obj --skeleton body.bvh -o body.armature
  armature bind body.obj --template human -o bound.armature      both at once
  armature rig model.obj --template bones.tgf -o model.tgf       any tree of bones as a template
  armature rig model.obj -t human --up z --front -y -o up.bvh    where the mesh does not say how it stands";

/// `armature rig`
#[derive(Debug, Args)]
#[command(after_help = RIG_HELP)]
pub struct RigArgs {
    /// The mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh)
    pub mesh: PathBuf,
    /// The skeleton that is fitted: human, quadruped, hand, spider, the sim:NAME of a puppet, or a file with a skeleton
    /// (tgf, bvh, fbx, gltf, glb)
    #[arg(short, long, value_name = "TEMPLATE")]
    pub template: String,
    /// Where to write the skeleton: a .bvh, .glb or .tgf file
    #[arg(short, long, default_value = "skeleton.bvh")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// How it is fitted.
    #[command(flatten)]
    pub how: TemplateArgs,
    /// Write a picture of the skeleton in the mesh: green bones are sure, red ones are not
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_axes_or_three_numbers_and_nothing_else() {
        let read = |text: &str| text.parse::<Direction>().ok().map(|way| way.0);
        assert_eq!(read("+y"), Some([0.0, 1.0, 0.0]));
        assert_eq!(read("-z"), Some([0.0, 0.0, -1.0]));
        assert_eq!(read("1, 0,0.5"), Some([1.0, 0.0, 0.5]));
        for bad in ["", "w", "1,0", "0,o,1,0", "1,0,0,", "0,0,0", "nan,0,1", "1,0,inf"] {
            assert_eq!(read(bad), None, "{bad:?}");
        }
    }
}
