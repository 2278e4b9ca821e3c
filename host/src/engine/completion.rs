//! Whether, and how, bones without a joint are turned.

use std::convert::Infallible;

use armature_character::{BoneRole, InverseKinematics, PinnedBone, PreferredBone, UnknownPreference};
use clap::{Args, ValueEnum};

use super::actor::Actor;
use crate::failure::Failure;

/// When inverse kinematics turns bones that no joint drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum IkMode {
    /// Always; a character without a mesh is an error
    On,
    /// Never: bones without a joint stay as they are at rest
    Off,
    /// If the character has a mesh
    #[default]
    Auto,
}

/// What the user chose about bones without a joint.
#[derive(Clone, Debug, Default, PartialEq, Eq, Args)]
pub struct IkArgs {
    /// Whether bones without a joint follow by inverse kinematics, as the character's shape wants it
    #[arg(long, value_enum, default_value_t = IkMode::Auto)]
    pub ik: IkMode,
    /// Bones that stay where they are at rest, with commas between; without it, the root. BONE:turning leaves its turn
    /// free, BONE:upright its height: LeftFoot,RightFoot,Hips:upright lets a puppet on a stand squat, LeftHand:turning
    /// lets it hang
    #[arg(long, value_name = "BONE", value_delimiter = ',')]
    pub pin: Vec<String>,
    /// How a bone without a joint prefers to turn against the bone above, with commas between: BONE:stiff=0.5 resists
    /// (10 hardly bends at all), BONE:swing=40:twist=-60..60 is how far it goes to any side and about itself, degrees
    #[arg(long, value_name = "BONE:WHAT=N", value_delimiter = ',')]
    pub prefer: Vec<String>,
}

impl IkArgs {
    /// Inverse kinematics for a character, if it was chosen and is possible.
    pub fn of_actor(&self, actor: &Actor) -> Result<Option<InverseKinematics>, Failure> {
        if self.ik == IkMode::Off {
            let needless =
                [("--pin", &self.pin), ("--prefer", &self.prefer)].into_iter().find(|(_, words)| !words.is_empty());
            return match needless {
                Some((option, _)) => {
                    Err(Failure::usage(format!("{option} needs inverse kinematics"), "leave --ik off away"))
                }
                None => Ok(None),
            };
        }
        let Some(character) = &actor.character else {
            let wanted = self.ik == IkMode::On || !self.pin.is_empty() || !self.prefer.is_empty();
            let what = format!("{} has no mesh, and inverse kinematics follows the shape", actor.name);
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
        let made = InverseKinematics::new(character, &pins).and_then(|mut ik| {
            ik.prefer_all(&preferred)?;
            Ok(ik)
        });
        made.map(Some).map_err(|e| {
            Failure::usage(format!("{}: {e}", actor.name), "`armature inspect` lists the bones of a character")
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
    /// Going along with their parents.
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
            "{driven} bones driven by joints, {solved} solved by inverse kinematics, {held} held, {following} go along"
        )
    }
}
