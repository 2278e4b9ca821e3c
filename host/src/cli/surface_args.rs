//! The options of `armature surface`.

use std::path::PathBuf;

use armature_fairing::{Domain, DomainSettings, Join, PatchSettings, RimShape};
use clap::{Args, Subcommand, ValueEnum};

use super::numbers::{finite, positive};
use crate::files::Overwrite;

/// `armature surface`
#[derive(Debug, Subcommand)]
pub enum SurfaceCommand {
    /// Close the holes of a mesh smoothly, but not openings that seem to be meant
    Fill(FillArgs),
    /// Join the rims of two or more holes by a smooth surface, as a limb to a body
    Blend(BlendArgs),
    /// Drag places of a surface; what is around them follows smoothly and keeps its detail
    Edit(EditArgs),
}

/// How a new surface meets what is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Smooth {
    /// Tangents go on (biharmonic)
    Tangent,
    /// Curvature goes on too (triharmonic)
    #[default]
    Curvature,
}

/// How patches are made.
#[derive(Clone, Copy, Debug, Args)]
pub struct JoinArgs {
    /// How the new surface meets what is around it
    #[arg(long, value_enum, default_value_t = Smooth::Curvature)]
    pub smooth: Smooth,
    /// Leave the rim at this angle from straight on, in degrees, outwards if positive, instead of going on smoothly
    #[arg(long, value_name = "DEGREES", conflicts_with = "smooth", allow_negative_numbers = true, value_parser = angle)]
    pub angle: Option<f64>,
    /// How far tangents reach in, with --angle: 1 is natural, more makes the surface fuller
    #[arg(long, requires = "angle", default_value_t = 1.0, value_parser = strength)]
    pub strength: f64,
    /// Curvature across the rim, with --angle: 1 / radius, outwards if positive
    #[arg(long, value_name = "CURVATURE", requires = "angle", allow_negative_numbers = true, value_parser = finite)]
    pub bend: Option<f64>,
    /// Length of the new surface's edges, in those of the rim
    #[arg(long, default_value_t = 1.0, value_parser = coarseness)]
    pub coarseness: f64,
}

impl JoinArgs {
    /// For the library.
    pub fn settings(&self) -> PatchSettings {
        let strength = self.strength;
        let join = match (self.angle, self.bend, self.smooth) {
            (Some(degrees), None, _) => Join::Angle { degrees, strength },
            (Some(degrees), Some(curvature), _) => Join::Bent { degrees, strength, curvature },
            (None, _, Smooth::Tangent) => Join::Tangent,
            (None, _, Smooth::Curvature) => Join::Curvature,
        };
        PatchSettings { join, coarseness: self.coarseness, ..PatchSettings::default() }
    }
}

/// What a blend is a function on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum BlendDomain {
    /// As long around as the rims are on average, and as high as they are apart
    Cylinder,
    /// Around a hole as long as the shorter rim, as wide as the rims are apart
    Annulus,
}

/// Blends that are functions on a parameter domain.
#[derive(Clone, Copy, Debug, Args)]
pub struct DomainArgs {
    /// Solve on this parameter domain, for two rims; otherwise on the surface itself, in rounds
    #[arg(long, value_enum, requires = "angle")]
    pub domain: Option<BlendDomain>,
    /// The angle at the rim with the larger number, if another one than at the first (degrees)
    #[arg(long, value_name = "DEGREES", requires = "domain", allow_negative_numbers = true, value_parser = angle)]
    pub second_angle: Option<f64>,
}

impl DomainArgs {
    /// For the library; `None` without a domain.
    pub fn settings(&self, join: &JoinArgs) -> Option<DomainSettings> {
        let domain = match self.domain? {
            BlendDomain::Cylinder => Domain::Cylinder,
            BlendDomain::Annulus => Domain::Annulus,
        };
        let first = join.angle.unwrap_or(0.0);
        let shapes = [first, self.second_angle.unwrap_or(first)].map(|degrees| RimShape {
            degrees,
            strength: join.strength,
            curvature: join.bend,
        });
        Some(DomainSettings { domain, shapes, coarseness: join.coarseness, ..DomainSettings::default() })
    }
}

const FILL_HELP: &str = "\
Every vertex and triangle of the mesh stays as it is; new ones are added. Openings that seem to be meant stay open unless \
they are asked for: the outer edge of a sheet, holes that are each other's mirror image (eyes, sleeves), and holes with a \
rim longer than the diagonal of their part's box. --list says which those are, and why.

  armature surface fill scan.obj --list                     the holes, numbered from the largest
  armature surface fill scan.obj -o whole.obj
  armature surface fill scan.obj --only 2,5 -o whole.obj
  armature surface fill scan.obj --up-to 0.1 -o whole.obj   holes with a rim of at most 0.1
  armature surface fill bowl.obj --all --angle 40 -o lid.obj";

/// `armature surface fill`
#[derive(Debug, Args)]
#[command(after_help = FILL_HELP)]
pub struct FillArgs {
    /// The mesh (obj, ply, stl, off, gltf, glb)
    pub mesh: PathBuf,
    /// Where to write the filled mesh: .obj or .glb (without bones and blend shapes)
    #[arg(short, long, default_value = "filled.obj")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Only list the holes
    #[arg(long, conflicts_with_all = ["all", "only", "up_to"])]
    pub list: bool,
    /// Fill all holes, also openings that seem to be meant
    #[arg(long, conflicts_with = "only")]
    pub all: bool,
    /// Fill these holes, by the numbers that --list gives
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', value_parser = number)]
    pub only: Vec<usize>,
    /// Leave holes with a longer rim open (mesh unit)
    #[arg(long, value_name = "LENGTH", value_parser = positive)]
    pub up_to: Option<f64>,
    /// The surface.
    #[command(flatten)]
    pub join: JoinArgs,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

const BLEND_HELP: &str = "\
Several meshes are put together as they lie. Holes are numbered over all of them, from the one with the longest rim; \
`armature surface blend` without --holes lists them.

  armature surface blend body.obj arm.obj                              the holes and their numbers
  armature surface blend body.obj arm.obj --holes 2,3 -o joined.obj
  armature surface blend cup.obj stem.obj --holes 1,2 --domain cylinder --angle 20 -o goblet.obj

With --domain the rims are laid on the two ends of a cylinder or annulus, by their length, and the surface is a function \
on it: one solution, no rounds, even triangles.";

/// `armature surface blend`
#[derive(Debug, Args)]
#[command(after_help = BLEND_HELP)]
pub struct BlendArgs {
    /// The meshes (obj, ply, stl, off, gltf, glb)
    #[arg(required = true)]
    pub meshes: Vec<PathBuf>,
    /// Where to write the joined mesh: .obj or .glb (without bones and blend shapes)
    #[arg(short, long, default_value = "blended.obj")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// The holes whose rims are joined, two or more; without it, the holes are listed
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', value_parser = number)]
    pub holes: Vec<usize>,
    /// The surface.
    #[command(flatten)]
    pub join: JoinArgs,
    /// Its parameter domain.
    #[command(flatten)]
    pub domain: DomainArgs,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

const EDIT_HELP: &str = "\
The conditions are a text file with one condition on each line; # starts a comment:

  smooth curvature                  or tangent: how the dragged region meets the rest (curvature unless given)
  within 0.3                        how far from dragged places the surface gives way, along it (mesh unit)
  region 0 1.5 0 0.4                or the places that give way: all vertices in this ball (centre, radius)
  drag 0 1.6 0.2 by 0 0 0.3         the vertex nearest to a point is moved by a vector
  drag vertex 17 by 0 0 0.3         the same for a vertex, counted from 0
  curve 17 18 25 by 0 0 0.3         vertices along a curve, moved together
  sharp 17 18 25 by 0 0 0.3         the same, with a crease along the curve
  sharp 17 18 25 by 0 0 0.3 slopes 0 0 -1 0 0 1
                                    the same, and how the displacement changes away from the curve, to its left and right
  hold 0 1.2 0.2                    the vertex nearest to a point stays where it is

  armature surface edit head.obj nose.txt -o longer.obj";

/// `armature surface edit`
#[derive(Debug, Args)]
#[command(after_help = EDIT_HELP)]
pub struct EditArgs {
    /// The mesh (obj, ply, stl, off, gltf, glb)
    pub mesh: PathBuf,
    /// The conditions: a text file
    pub conditions: PathBuf,
    /// Where to write the edited mesh: .obj or .glb (without bones and blend shapes)
    #[arg(short, long, default_value = "edited.obj")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

fn angle(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if value.abs() <= 180.0 { Ok(value) } else { Err("give an angle from -180 to 180".into()) }
}

fn strength(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if (0.0..=10.0).contains(&value) { Ok(value) } else { Err("give 0 to 10".into()) }
}

fn coarseness(text: &str) -> Result<f64, String> {
    let value = finite(text)?;
    if (0.1..=10.0).contains(&value) { Ok(value) } else { Err("give 0.1 to 10".into()) }
}

fn number(text: &str) -> Result<usize, String> {
    match text.trim().parse() {
        Ok(number) if number > 0 => Ok(number),
        _ => Err(format!("{text:?} is not the number of a hole; the first is 1")),
    }
}
