//! Options of inverse kinematics for bones without a joint.

use std::convert::Infallible;

use armature_character::inverse_kinematics::{
    BoneRole, IkBones, IkEnergy, IkSettings, InverseKinematics, LimitedBone, PinnedBone, PreferredBone, UnknownLimit,
    UnknownPreference, anatomical_limits,
};
use clap::{Args, ValueEnum};

use super::LoadedCharacter;
use crate::failure::Failure;

/// When inverse kinematics turns bones that no joint drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum IkMode {
    /// Always; a character without a mesh is an error
    On,
    /// Never: bones without a joint keep their rest pose
    Off,
    /// If the character has a mesh
    #[default]
    Auto,
}

/// Bones without a joint.
#[derive(Clone, Debug, Default, PartialEq, Eq, Args)]
pub struct IkArgs {
    /// Whether bones without a joint follow by shape-aware inverse kinematics
    #[arg(long, value_enum, default_value_t = IkMode::Auto)]
    pub ik: IkMode,
    /// Bones that stay in their rest place, separated by commas; without it, the root. BONE:turning may rotate,
    /// BONE:upright may move up and down: LeftFoot,RightFoot,Hips:upright lets a puppet on a stand squat,
    /// LeftHand:turning lets it hang
    #[arg(long, value_name = "BONE", value_delimiter = ',')]
    pub pin: Vec<String>,
    /// How a bone without a joint turns against its parent, separated by commas: BONE:stiff=0.5 resists (10 hardly
    /// bends), BONE:swing=40:twist=-60..60 limits how far it bends in any direction and twists, in degrees
    #[arg(long, value_name = "BONE:WHAT=N", value_delimiter = ',')]
    pub prefer: Vec<String>,
    /// How far a bone without a joint can turn against its parent, separated by commas: BONE:bend=LEAST..MOST, lean=, roll=
    /// in degrees, or BONE:free. Of a recognised human all joints have limits, which this changes; off: none has
    #[arg(long, value_name = "BONE:WHAT=A..B", value_delimiter = ',')]
    pub limit: Vec<String>,
    /// What resists deformation when bones without a joint are solved: the surface, like a thin shell, or the volume
    /// inside, like flesh. The volume is made before the first pose, which takes as long as binding
    #[arg(long, value_enum, default_value_t = Energy::Surface)]
    pub ik_energy: Energy,
    /// Into how many parts that turn as one the shape is divided when bones are solved; more follow it more closely and
    /// take longer. Without it, two for each bone that is solved
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=2048))]
    pub ik_clusters: Option<u32>,
    /// What bones without a joint may do: rigid ones turn and keep their lengths, loose ones also move and grow as the
    /// shape has it, which takes and exports hold too; stretch in one direction and shear are lost
    #[arg(long, value_enum, default_value_t = Bones::Rigid)]
    pub ik_bones: Bones,
    /// Whether roots stay where nothing below them is driven or pinned (held), or go with the shape (free), as skeletons
    /// in several pieces need
    #[arg(long, value_enum, default_value_t = Roots::Held)]
    pub ik_roots: Roots,
    /// How a take was solved, whatever is usual today.
    #[arg(skip)]
    pub recorded: Option<IkSettings>,
}

/// What resists deformation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Energy {
    /// The surface, like a thin shell
    #[default]
    Surface,
    /// The volume inside, like flesh
    Volume,
}

/// What bones without a joint may do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Bones {
    /// Turn
    #[default]
    Rigid,
    /// Turn, move and grow
    Loose,
}

/// What roots do when nothing below them is driven or pinned.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Roots {
    /// Stay at rest
    #[default]
    Held,
    /// Go with the shape
    Free,
}

/// The word of `--limit` for a human without limits of its own.
const NO_ANATOMY: &str = "off";

impl IkArgs {
    fn settings(&self) -> IkSettings {
        IkSettings {
            energy: if self.ik_energy == Energy::Volume { IkEnergy::Volume } else { IkEnergy::Surface },
            clusters: self.ik_clusters.map(|count| count as usize),
            bones: if self.ik_bones == Bones::Loose { IkBones::Loose } else { IkBones::Rigid },
            free_roots: self.ik_roots == Roots::Free,
            ..IkSettings::default()
        }
    }

    /// Inverse kinematics for a character, if chosen and possible.
    pub fn for_character(&self, character: &LoadedCharacter) -> Result<Option<InverseKinematics>, Failure> {
        if self.ik == IkMode::Off {
            let needless = [("--pin", &self.pin), ("--prefer", &self.prefer), ("--limit", &self.limit)]
                .into_iter()
                .find(|(_, words)| !words.is_empty());
            if needless.is_none() && self.settings() != IkSettings::default() {
                let what = "--ik-energy, --ik-clusters, --ik-bones and --ik-roots need inverse kinematics";
                return Err(Failure::usage(what, "leave out --ik off"));
            }
            return match needless {
                Some((option, _)) => {
                    Err(Failure::usage(format!("{option} needs inverse kinematics"), "leave out --ik off"))
                }
                None => Ok(None),
            };
        }
        let Some(bound) = character.character() else {
            let words = [&self.pin, &self.prefer, &self.limit];
            let wanted = self.ik == IkMode::On || words.into_iter().any(|words| !words.is_empty());
            let what = format!("{} has no mesh, and inverse kinematics follows the shape", character.name);
            return if wanted {
                Err(Failure::usage(what, "choose a character with a mesh, such as human"))
            } else {
                Ok(None)
            };
        };
        let pins: Vec<PinnedBone> =
            self.pin.iter().map(|text| text.parse().unwrap_or_else(|never: Infallible| match never {})).collect();
        let preferred: Result<Vec<PreferredBone>, _> = self.prefer.iter().map(|text| text.parse()).collect();
        let preferred = preferred.map_err(|e: UnknownPreference| Failure::usage(e.to_string(), ""))?;
        let anatomy = if self.limit.iter().any(|word| word == NO_ANATOMY) {
            Vec::new()
        } else {
            anatomical_limits(&character.skeleton)
        };
        let own = self.limit.iter().filter(|word| *word != NO_ANATOMY).map(|text| text.parse());
        let own = own.collect::<Result<Vec<LimitedBone>, UnknownLimit>>();
        let mut own = own.map_err(|e| Failure::usage(e.to_string(), ""))?;
        for limited in &mut own {
            let (wide, note) = limited.clone().around_rest();
            *limited = wide;
            note.iter().for_each(|note| tracing::warn!("{}: {note}", character.name));
        }
        let settings = self.recorded.clone().unwrap_or_else(|| self.settings());
        let made = InverseKinematics::new(bound, &pins).and_then(|ik| {
            let mut ik = ik.with_settings(settings);
            ik.prefer_all(&preferred)?;
            ik.limit_all(&anatomy)?;
            ik.limit_all(&own)?;
            Ok(ik)
        });
        made.map(Some).map_err(|e| {
            let names: Vec<&str> = character.skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
            Failure::usage(format!("{}: {e}", character.name), format!("its bones are {}", names.join(", ")))
        })
    }
}

/// How many bones have each role.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RoleCounts {
    /// Driven by joints.
    pub driven: usize,
    /// Solved by inverse kinematics.
    pub solved: usize,
    /// Held in place.
    pub held: usize,
    /// Following their parents.
    pub following: usize,
}

impl RoleCounts {
    /// Counts.
    pub fn of(roles: &[BoneRole]) -> Self {
        let count = |wanted: BoneRole| roles.iter().filter(|role| **role == wanted).count();
        Self {
            driven: count(BoneRole::Driven),
            solved: count(BoneRole::Solved),
            held: count(BoneRole::Held),
            following: count(BoneRole::Follows),
        }
    }
}

impl std::fmt::Display for RoleCounts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { driven, solved, held, following } = self;
        write!(
            f,
            "{driven} bones driven by joints, {solved} solved by inverse kinematics, {held} held, {following} following their parents"
        )
    }
}
