//! Options of standing and walking.

use armature_character::inverse_kinematics::{InverseKinematics, PinHold};
use armature_character::outermost_points;
use armature_rig::{Ground, GroundError, GroundMode};
use clap::{Args, ValueEnum};

use super::LoadedCharacter;
use crate::failure::Failure;

/// How the character stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum GroundChoice {
    /// On the spot: the foot on the floor stays, the hips move; after a step the character glides back
    Stand,
    /// Steps lead away
    Walk,
    /// The character's root stays where it is
    Off,
}

/// Standing and walking.
#[derive(Clone, Debug, Default, PartialEq, Eq, Args)]
pub struct GroundArgs {
    /// The floor carries the character: the foot on it stays in place, the hips move instead, and nothing is below it. Legs
    /// that no joint turns bend. With --pin the pinned bones say where the character is, and the floor only raises it
    #[arg(long, value_enum)]
    pub ground: Option<GroundChoice>,
    /// Bones that may carry the character, separated by commas, such as LeftHand,RightHand,LeftFoot,RightFoot for a
    /// cartwheel; without it, the feet that were recognised
    #[arg(long, value_name = "BONE", value_delimiter = ',', requires = "ground")]
    pub contacts: Vec<String>,
}

impl GroundArgs {
    /// How a character stands; `None` if it is not to, or if nothing was chosen. `ik`: what turns its bones without a joint;
    /// what it pins besides the roots says where the character is.
    pub fn for_character(
        &self,
        character: &LoadedCharacter,
        ik: Option<&InverseKinematics>,
    ) -> Result<Option<Ground>, Failure> {
        let mode = match self.ground {
            None | Some(GroundChoice::Off) => return Ok(None),
            Some(GroundChoice::Stand) => GroundMode::Stand,
            Some(GroundChoice::Walk) => GroundMode::Walk,
        };
        let skeleton = &character.skeleton;
        let bones = || {
            let names: Vec<&str> = skeleton.bones().iter().map(|bone| bone.name.as_str()).collect();
            format!("name the bones that carry it with --contacts; its bones are {}", names.join(", "))
        };
        let named = self.contacts.iter().map(|name| {
            let missing = || Failure::usage(format!("{}: there is no bone {name:?}", character.name), bones());
            skeleton.find(name).ok_or_else(missing)
        });
        let mut contacts = named.collect::<Result<Vec<_>, _>>()?;
        if contacts.is_empty() {
            contacts = Ground::feet(skeleton);
        }
        let made = match character.character() {
            Some(bound) => Ground::of_points(skeleton, mode, &contacts, &outermost_points(bound)),
            None => Ground::of_skeleton(skeleton, mode, &contacts),
        };
        let made = made.map_err(|error: GroundError| {
            Failure::usage(format!("{} cannot stand: {error}", character.name), bones())
        })?;
        if let Some(doubt) = made.doubt(skeleton) {
            tracing::warn!("{}: {doubt} (--contacts)", character.name);
        }
        Ok(Some(Ground { is_held: ik.is_some_and(|ik| places_roots(ik, character)), ..made }))
    }
}

/// Whether something but a root is pinned, so that pins say where the roots are.
pub fn places_roots(ik: &InverseKinematics, character: &LoadedCharacter) -> bool {
    let skeleton = &character.skeleton;
    let is_root = |name: &str| skeleton.find(name).is_some_and(|bone| skeleton.bones()[bone].parent.is_none());
    ik.pins().any(|pin| !(is_root(&pin.bone) && pin.hold == PinHold::Fixed))
}
