//! The options of the subcommands that compute weights.

use std::path::PathBuf;

use armature_character::bind::{BindMethod, MOST_INFLUENCES, TwistCurve, WEIGHT_VOLUME_VERTICES};
use armature_character::handle_weights::{BiharmonicTier, FLAT, Partition, WeightMethod, WeightsOn};
use armature_character::{EndpointMethod, SkinKind};
use armature_weights::biharmonic::{BiharmonicSettings, ExactPartitionSettings};
use armature_weights::endpoints::SplineFilter;
use armature_weights::handles::{FREE_NEAR_JOINTS, MOST_FREE_NEAR_JOINTS};
use clap::{ArgGroup, Args, ValueEnum};

use super::args::volume_vertices;
use super::rig_args::TemplateArgs;
use crate::characters::skin::skin_help;
use crate::failure::Failure;
use crate::files::Overwrite;
use crate::terminal::grouped;

/// How weights are computed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Method {
    /// Bounded biharmonic weights, good enough for any deformation
    #[default]
    #[value(help = tier_help(BiharmonicTier::Interactive))]
    Bbw,
    /// Bounded biharmonic weights, optimal to many digits
    #[value(help = tier_help(BiharmonicTier::Certified))]
    BbwCertified,
    /// Monotone weights: smooth, and without minima or maxima of their own (before they are scaled to sum to one)
    Monotone,
    /// Bone heat on the surface
    Heat,
}

impl Method {
    /// The default limit on a vertex's influences. Smooth weights reach far: where many bones meet, four would leave
    /// seams.
    pub fn influences(self) -> usize {
        if self == Self::Heat { 4 } else { 8 }
    }

    /// For binding; `order` is that of monotone weights.
    pub fn for_bind(self, order: u8) -> BindMethod {
        match self {
            Self::Monotone => BindMethod::Monotone { order },
            Self::Bbw => BindMethod::Biharmonic(BiharmonicTier::Interactive),
            Self::BbwCertified => BindMethod::Biharmonic(BiharmonicTier::Certified),
            Self::Heat => BindMethod::BoneHeat,
        }
    }
}

/// When a tier stops, in the words of the help.
fn tier_help(tier: BiharmonicTier) -> String {
    let BiharmonicSettings { error_bound, relative_gap, .. } = tier.settings();
    let digits = match tier {
        BiharmonicTier::Interactive => String::new(),
        BiharmonicTier::Certified => format!(", and their energies are right to {:.0} digits", -relative_gap.log10()),
    };
    format!(
        "Bounded biharmonic weights, each bone separately: weights are proven to be within {error_bound} of the optimal ones{digits}"
    )
}

/// When handles solved together stop. On three of the five shapes of `armature bench weights/partition` it is the step
/// limit.
fn together_help() -> String {
    let ExactPartitionSettings { error_bound, max_steps } = ExactPartitionSettings::default();
    format!(
        "Bounded biharmonic weights of all handles together, so that they sum to one without being scaled: stops within \
         {error_bound} of the optimal ones, or after {} steps, and reports what was reached",
        grouped(max_steps)
    )
}

/// How weights are computed for other tools.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum HandleMethod {
    /// Bounded biharmonic weights, each handle separately, good enough for any deformation
    #[default]
    #[value(help = tier_help(BiharmonicTier::Interactive))]
    Bbw,
    /// Bounded biharmonic weights, each handle separately, optimal to many digits
    #[value(help = tier_help(BiharmonicTier::Certified))]
    BbwCertified,
    /// Bounded biharmonic weights of all handles together
    #[value(help = together_help())]
    BbwExact,
    /// Monotone weights: smooth, and without minima or maxima other than where handles hold the shape (before they are
    /// scaled to sum to one)
    Monotone,
    /// Monotone weights of all handles together: they sum to one without being scaled, and none has a minimum or maximum
    /// of its own; for a few handles, since time and memory grow fast with their number
    MonotoneExact,
    /// Bone heat on the surface
    Heat,
}

impl HandleMethod {
    /// Which weights; `order` is that of monotone ones.
    pub fn of_order(self, order: u8) -> WeightMethod {
        match self {
            Self::Monotone | Self::MonotoneExact => WeightMethod::Monotone { order: usize::from(order) },
            Self::Bbw | Self::BbwCertified | Self::BbwExact | Self::Heat => WeightMethod::BoundedBiharmonic,
        }
    }

    /// How accurate bounded biharmonic weights must be.
    pub fn tier(self) -> BiharmonicTier {
        if self == Self::BbwCertified { BiharmonicTier::Certified } else { BiharmonicTier::Interactive }
    }

    /// How they are made to sum to one.
    pub fn partition(self, left: bool) -> Partition {
        match (self, left) {
            (Self::BbwExact | Self::MonotoneExact, _) => Partition::Exact,
            (_, true) => Partition::Left,
            (_, false) => Partition::Normalised,
        }
    }
}

/// What bounded biharmonic weights are computed on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum On {
    /// A volume around the mesh; for a flat mesh, the triangles that fill it
    Volume,
    /// The triangles of the surface alone: faster, but unaware of what is close through the inside
    Surface,
}

/// The shape that weights are computed on.
#[derive(Clone, Copy, Debug, Args)]
pub struct DomainArgs {
    /// What bounded biharmonic weights are computed on; without it, the volume, or for a tetrahedral mesh given to
    /// `armature weights` its own tetrahedra
    #[arg(long, value_enum)]
    pub on: Option<On>,
    /// About how many vertices the volume has
    #[arg(long, value_parser = volume_vertices, help = vertices_help())]
    pub vertices: Option<usize>,
}

impl DomainArgs {
    /// What the solver gets; `otherwise` if nothing was requested.
    pub fn weights_on(&self, otherwise: WeightsOn) -> WeightsOn {
        let volume = WeightsOn::Volume { vertices: self.vertices.unwrap_or(WEIGHT_VOLUME_VERTICES) };
        match (self.on, self.vertices) {
            (Some(On::Surface), _) => WeightsOn::Surface,
            (Some(On::Volume), _) | (None, Some(_)) => volume,
            (None, None) => otherwise,
        }
    }

    /// For a mesh that is to be filled by default.
    pub fn volume_or_asked(&self) -> WeightsOn {
        self.weights_on(WeightsOn::Volume { vertices: WEIGHT_VOLUME_VERTICES })
    }
}

fn vertices_help() -> String {
    format!("About how many vertices the volume has [default: {WEIGHT_VOLUME_VERTICES}]")
}

/// How far bones are released from the shape near the joints they share.
#[derive(Clone, Copy, Debug, Args)]
pub struct ReleaseArgs {
    /// The fraction of its length over which a bone is released from the shape at each joint that it shares
    #[arg(long, value_name = "SHARE", value_parser = joint_release, help = release_help())]
    pub joint_release: Option<f64>,
}

impl ReleaseArgs {
    /// As requested, or the default.
    pub fn share(self) -> f64 {
        self.joint_release.unwrap_or(FREE_NEAR_JOINTS)
    }

    /// Not an option of bone heat.
    pub fn refuse_for_heat(self) -> Result<(), Failure> {
        match self.joint_release {
            None => Ok(()),
            Some(_) => Err(Failure::usage(
                "--joint-release is for bounded biharmonic weights; with bone heat, bones hold nothing",
                "leave out --joint-release or --method heat",
            )),
        }
    }
}

/// The order of monotone weights.
#[derive(Clone, Copy, Debug, Args)]
pub struct OrderArgs {
    /// Order of smoothness of monotone weights
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(2..=4), help = order_help())]
    pub order: Option<u8>,
}

/// The order of monotone weights without `--order`.
const MONOTONE_ORDER: u8 = 2;

impl OrderArgs {
    /// As requested, or the default.
    pub fn order(self) -> u8 {
        self.order.unwrap_or(MONOTONE_ORDER)
    }

    /// Only an option of monotone weights.
    pub fn refuse_unless(self, is_monotone: bool) -> Result<(), Failure> {
        match self.order {
            Some(_) if !is_monotone => {
                Err(Failure::usage("--order is for monotone weights", "give --method monotone, or leave out --order"))
            }
            _ => Ok(()),
        }
    }
}

fn order_help() -> String {
    format!(
        "Order of smoothness of monotone weights, 2 to 4: higher ones are smoother at handles, and take a better mesh \
         [default: {MONOTONE_ORDER}]"
    )
}

fn release_help() -> String {
    format!(
        "The fraction of its length, 0 to {MOST_FREE_NEAR_JOINTS}, over which a bone is released from the shape at each \
         joint that it shares [default: {FREE_NEAR_JOINTS}]; with 0 bones hold to their ends, as in the papers and in libigl"
    )
}

fn joint_release(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    let possible = (0.0..=MOST_FREE_NEAR_JOINTS).contains(&share);
    if possible { Ok(share) } else { Err(format!("give 0 to {MOST_FREE_NEAR_JOINTS}")) }
}

/// The problem that the certificate is about.
fn problem_help() -> String {
    format!(
        "The certificate is about this problem: bones are released from the shape over {FREE_NEAR_JOINTS} of their length \
         at joints they share (--joint-release), so that weights do not depend on how fine the volume is; masses are \
         barycentric; and elements of the volume with six times their volume less than {FLAT} of the cube of their longest \
         edge are ignored. The report says so too."
    )
}

/// The persistence of `--smooth-weights` without a number.
const SMOOTHED: &str = "0.1";

fn smooth_help() -> String {
    format!(
        "Smooth weights that come with the file: noise goes, and minima and maxima of a bone's weights stay if they are at \
         least this much, 0 to 1, from their saddles [{SMOOTHED} without a number]"
    )
}

fn share(text: &str) -> Result<f64, String> {
    let share: f64 = text.parse().map_err(|_| format!("{text:?} is not a number"))?;
    if (0.0..=1.0).contains(&share) { Ok(share) } else { Err("give 0 to 1".into()) }
}

const BIND_HELP: &str = "\
The mesh is filled with tetrahedra that have vertices along the bones; bounded biharmonic weights (Jacobson et al. 2011) are \
computed on them and transferred to the mesh's own vertices. The character records how its weights were made and how far \
they can be from the optimal ones. {problem} Binding the same files again takes the result from a cache.

  armature bind armadillo.obj --skeleton armadillo.tgf -o armadillo.armature
  armature bind armadillo.obj -s armadillo.tgf --method monotone                nothing far from a bone wiggles or lags
  armature bind armadillo.obj -s armadillo.tgf --method heat                    bone heat, for comparison
  armature bind body.obj --template human -o body.armature                      a mesh without a skeleton
  armature bind fox.glb                                                         an artist's own weights stay
  armature bind fox.glb --skin stretch-twist                                    and its limbs twist along their length
  armature bind fox.glb --influences 4                                          no more than a game engine takes
  armature bind fox.glb --smooth-weights                                        without the noise of a brush
  armature bind body.obj -s bones.tgf --picture body.png --picture-of bone_3    where one bone moves the mesh";

/// `armature bind`
#[derive(Debug, Args)]
#[command(after_help = BIND_HELP.replace("{problem}", &problem_help()))]
pub struct BindArgs {
    /// The mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh)
    pub mesh: PathBuf,
    /// The skeleton (tgf, bvh, fbx, or a gltf/glb with a skin); a rigged glTF or FBX has its own
    #[arg(short, long)]
    pub skeleton: Option<PathBuf>,
    /// Fit this skeleton into the mesh first and bind to it: human, quadruped, hand, spider, or a file with a skeleton;
    /// `armature rig` writes it to be looked at and corrected
    #[arg(short, long, value_name = "TEMPLATE", conflicts_with = "skeleton")]
    pub template: Option<String>,
    /// How it is fitted.
    #[command(flatten)]
    pub how: TemplateArgs,
    /// Where to save the character
    #[arg(short, long, default_value = "character.armature")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = Method::Bbw)]
    pub method: Method,
    /// Monotone weights.
    #[command(flatten)]
    pub order: OrderArgs,
    /// What to compute on.
    #[command(flatten)]
    pub domain: DomainArgs,
    /// Near joints.
    #[command(flatten)]
    pub release: ReleaseArgs,
    /// Most bones that a vertex may follow, 1 to 16, also with weights that come with the file; without it, those stay, and
    /// computed ones have up to 8, or 4 with bone heat
    #[arg(long, value_parser = influence_count)]
    pub influences: Option<usize>,
    #[arg(long, value_name = "KIND", default_value_t = SkinKind::Linear, help = skin_help(". Kept in the character's file"))]
    #[expect(missing_docs, reason = "its help is put together with that of run")]
    pub skin: SkinKind,
    /// For a skin that stretches and twists, how it is found how far along its bones each vertex is: bbw (bounded biharmonic
    /// weights of the joints), heat (their bone heat weights), projection (the nearest place on the bone) or distance
    /// (inverse squared distances of the joints); without it, heat with --method heat, else bbw
    #[arg(long, value_name = "METHOD")]
    pub endpoints: Option<EndpointMethod>,
    /// Where along a bone its twist and stretch happen, BONE:PLACE=SHARE,…, both from 0 at its head to 1 at its tail; may be
    /// given several times. Spine:0.4=0.8 puts most of a twist into the lower part
    #[arg(long, value_name = "BONE:PLACE=SHARE", value_parser = twist_curve)]
    pub twist_curve: Vec<TwistCurve>,
    /// A part of the file, such as a shirt, that takes its weights from the other parts, even if it has some; may be given
    /// several times. Parts without weights do so by themselves where they lie on others
    #[arg(long, value_name = "PART")]
    pub transfer: Vec<String>,
    /// Replace the file's own skeleton and weights
    #[arg(long)]
    pub replace_rig: bool,
    /// Smooth weights that come with the file: noise goes, and minima and maxima of a bone's weights stay if they are at
    /// least this much from their saddles
    #[arg(long, value_name = "PERSISTENCE", num_args = 0..=1, default_missing_value = SMOOTHED, value_parser = share, help = smooth_help())]
    pub smooth_weights: Option<f64>,
    /// Close the holes of the mesh smoothly first, except those that seem to be meant (`armature surface fill --list`
    /// shows them)
    #[arg(long)]
    pub fill_holes: bool,
    /// Compute again even if the same input was bound before
    #[arg(long)]
    pub no_cache: bool,
    /// Write a picture of the bound character
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// Show weights in the picture: those of one bone with contour lines, or `all` in colours
    #[arg(long, value_name = "BONE", requires = "picture")]
    pub picture_of: Option<String>,
}

const WEIGHTS_HELP: &str = "\
Handles come from a TGF file: edges are bones, or with the columns \"0 0 1\" after their ends (as libigl reads them) edges \
of a cage, open or closed, along which weights are linear; nodes that no bone touches are points. Columns of the result are \
the points in the order of the file, then the bones. Rows are the vertices of the mesh: all of them, in the order of the file. A \
tetrahedral .mesh is used as it is, any other mesh is filled with tetrahedra first. For each handle the report gives the \
energy, how far a weight is outside 0 to 1, the largest multiplier of the wrong sign, how many active sets were tried, how \
far a weight can be from the optimal one, and whether it converged; if a handle did not, the exit code is 5. Spurious \
extrema, minima and maxima where no handle holds the shape, are counted before and after scaling, and the picture marks them, \
minima blue and maxima red. {problem}

  armature weights hand.mesh --handles hand.tgf -o weights.npy --picture weights.png
  armature weights hand.mesh --handles hand.tgf --joint-release 0 -o weights.npy    the boundary conditions of libigl
  armature weights hand.mesh --boundary b.npy bc.npy --no-normalize --method bbw-certified -o weights.npy
                                            b: fixed vertices, from 0; bc: their weights, a column for each handle
  armature weights body.obj --handles bones.tgf -o weights.dmat --json     as libigl reads them, and a report for scripts";

/// `armature weights`
#[derive(Debug, Args)]
#[command(after_help = WEIGHTS_HELP.replace("{problem}", &problem_help()), group = ArgGroup::new("held").required(true).args(["handles", "boundary"]))]
pub struct WeightsArgs {
    /// The mesh (fbx, gltf, glb, vrm, obj, ply, stl, off, mesh)
    pub mesh: PathBuf,
    /// Bones, points and cages
    #[arg(long, value_name = "TGF")]
    pub handles: Option<PathBuf>,
    /// Fixed vertices of the mesh and their weights, like libigl's boundary conditions
    #[arg(long, num_args = 2, value_names = ["B.npy", "BC.npy"], conflicts_with = "joint_release")]
    pub boundary: Option<Vec<PathBuf>>,
    /// How weights are computed
    #[arg(long, value_enum, default_value_t = HandleMethod::Bbw)]
    pub method: HandleMethod,
    /// Monotone weights.
    #[command(flatten)]
    pub order: OrderArgs,
    /// What to compute on.
    #[command(flatten)]
    pub domain: DomainArgs,
    /// Near joints.
    #[command(flatten)]
    pub release: ReleaseArgs,
    /// Keep each handle's weights as computed; without it, each vertex's weights are scaled to sum to one (bbw-exact
    /// and monotone-exact need no scaling)
    #[arg(long)]
    pub no_normalize: bool,
    /// Where to write the weights: a .npy or .dmat file
    #[arg(short, long, default_value = "weights.npy")]
    pub output: PathBuf,
    /// Files that are already there.
    #[command(flatten)]
    pub overwrite: Overwrite,
    /// Write a picture of the weights on the mesh
    #[arg(long, value_name = "PNG")]
    pub picture: Option<PathBuf>,
    /// Show one handle's weights with contour lines, instead of all in colours
    #[arg(long, value_name = "HANDLE", requires = "picture")]
    pub picture_of: Option<String>,
    /// Print one JSON object instead of text
    #[arg(long)]
    pub json: bool,
}

fn twist_curve(text: &str) -> Result<TwistCurve, String> {
    let wrong = || format!("{text:?} is no twist curve: write BONE:PLACE=SHARE, such as Spine:0.4=0.8");
    let (bone, points) = text.rsplit_once(':').ok_or_else(wrong)?;
    let point = |point: &str| {
        let (place, share) = point.split_once('=')?;
        Some([place.trim().parse().ok()?, share.trim().parse().ok()?])
    };
    let points = points.split(',').map(point).collect::<Option<Vec<[f64; 2]>>>().ok_or_else(wrong)?;
    let curve = SplineFilter::through(&points).map_err(|e| e.to_string())?;
    if bone.is_empty() { Err(wrong()) } else { Ok(TwistCurve { bone: bone.into(), curve }) }
}

fn influence_count(text: &str) -> Result<usize, String> {
    let count: usize = text.parse().map_err(|_| format!("{text:?} is not a whole number"))?;
    if (1..=MOST_INFLUENCES).contains(&count) {
        Ok(count)
    } else {
        Err(format!("give 1 to {MOST_INFLUENCES}; most engines take 4 or 8"))
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;
    use crate::cli::Cli;

    #[test]
    fn helps_say_what_the_constants_say() {
        for name in ["bind", "weights"] {
            let mut command = Cli::command();
            let command = command.find_subcommand_mut(name).expect("a subcommand");
            let help = command.render_long_help().to_string();
            // As a reader sees it, without the breaks of lines.
            let help = help.split_whitespace().collect::<Vec<_>>().join(" ");
            let BiharmonicSettings { error_bound, relative_gap, .. } = BiharmonicSettings::certified();
            let interactive = BiharmonicSettings::interactive().error_bound;
            let mut parts = vec![
                format!("proven to be within {interactive} of the optimal ones"),
                format!("proven to be within {error_bound} of the optimal ones, and their energies"),
                format!("right to {} digits", (1.0 / relative_gap).log10().round()),
                format!("[default: {WEIGHT_VOLUME_VERTICES}]"),
                format!("0 to {MOST_FREE_NEAR_JOINTS}, over which a bone is released"),
                format!("[default: {FREE_NEAR_JOINTS}]"),
                format!("over {FREE_NEAR_JOINTS} of their length"),
                format!("less than {FLAT} of the cube"),
            ];
            if name == "weights" {
                let together = ExactPartitionSettings::default();
                parts.push(format!("stops within {} of the optimal ones, or after 4,000 steps", together.error_bound));
                assert_eq!(together.max_steps, 4000, "as the line above says");
            }
            for part in parts {
                assert!(help.contains(&part), "{part:?} is not in the help of {name}: {help}");
            }
            assert!(!help.contains("{problem}") && !help.contains("0.00001 "), "{help}");
        }
    }

    #[test]
    fn the_guide_says_what_the_constants_say() {
        let guide = include_str!("../../WEIGHTS.md");
        let together = ExactPartitionSettings::default();
        for part in [
            format!("proven to be within {} of the optimal one.", BiharmonicSettings::interactive().error_bound),
            format!("proven to be within {} of the optimal ones", BiharmonicSettings::certified().error_bound),
            format!(
                "within {} of the optimal weights or after {} steps",
                together.error_bound,
                grouped(together.max_steps)
            ),
            format!("about {} vertices (`--vertices`", grouped(WEIGHT_VOLUME_VERTICES)),
            format!("`--joint-release`, 0 to {MOST_FREE_NEAR_JOINTS};"),
            format!("less than {FLAT} of the cube of their longest edge"),
        ] {
            assert!(guide.contains(&part), "{part:?} is not in WEIGHTS.md");
        }
    }

    #[test]
    fn a_twist_curve_is_a_bone_and_points() {
        let curve = twist_curve("mixamorig:Spine:0.4=0.8,0.6=0.9").unwrap();
        assert_eq!((curve.bone.as_str(), curve.curve.at(0.4)), ("mixamorig:Spine", 0.8));
        for wrong in
            ["", "Spine", "Spine:", "Spine:0.4", ":0.4=0.8", "Spine:0.4=x", "Spine:0.4=1.5", "Spine:0.6=0.1,0.4=0.2"]
        {
            assert!(twist_curve(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_share_that_is_none_is_refused() {
        assert_eq!(joint_release("0"), Ok(0.0));
        assert_eq!(joint_release("0.5"), Ok(MOST_FREE_NEAR_JOINTS));
        for text in ["-0.1", "0.51", "nan", "inf", "", "a quarter"] {
            assert!(joint_release(text).is_err(), "{text}");
        }
    }
}
