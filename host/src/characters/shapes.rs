//! Morph targets (blend shapes) of a character, set by name.

use std::str::FromStr;

use armature_character::Character;
use clap::Args;

use super::LoadedCharacter;
use crate::failure::Failure;

/// No more names than this are listed where one is not found.
const LISTED: usize = 12;

/// A morph target, or an expression, and how far the character is blended towards it.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeWeight {
    /// Its name in the file.
    pub name: String,
    /// 0 is not at all, 1 wholly; beyond these, it is exaggerated.
    pub weight: f32,
}

impl FromStr for ShapeWeight {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("{text:?} is no shape: write NAME=WEIGHT, such as smile=0.7");
        let (name, weight) = text.rsplit_once('=').ok_or_else(wrong)?;
        let weight: f32 = weight.trim().parse().map_err(|_| wrong())?;
        if name.is_empty() || !weight.is_finite() {
            return Err(wrong());
        }
        Ok(Self { name: name.into(), weight })
    }
}

/// Blend shapes.
#[derive(Clone, Debug, Default, PartialEq, Args)]
pub struct ShapeArgs {
    /// Blend the character towards one of its shapes (morph targets, blend shapes), such as smile=0.7; may be given
    /// several times. `armature inspect` lists the names
    #[arg(long = "shape", value_name = "NAME=WEIGHT")]
    pub shapes: Vec<ShapeWeight>,
}

/// Sets some weights of a character's morph targets (one per target); the others stay.
pub fn set_shapes(character: &LoadedCharacter, weights: &mut [f32], shapes: &[ShapeWeight]) -> Result<(), Failure> {
    for ShapeWeight { name, weight } in shapes {
        let is_known = character.character().is_some_and(|bound| bound.set_shape(weights, name, *weight));
        if !is_known {
            return Err(unknown(character, name));
        }
    }
    Ok(())
}

/// The weights of a character's morph targets with these set and the others as the file has them.
pub fn weights_with(character: &LoadedCharacter, shapes: &[ShapeWeight]) -> Result<Vec<f32>, Failure> {
    let mut weights = character.character().map(Character::default_weights).unwrap_or_default();
    set_shapes(character, &mut weights, shapes)?;
    Ok(weights)
}

/// A character whose file will say that it has these shapes; `None` if none is set.
pub fn reshaped(character: &LoadedCharacter, shapes: &[ShapeWeight]) -> Result<Option<Character>, Failure> {
    if shapes.is_empty() {
        return Ok(None);
    }
    let weights = weights_with(character, shapes)?;
    Ok(character.character().map(|bound| bound.reshaped(&weights)))
}

/// Whether a character has a shape of this name.
pub fn has(character: &LoadedCharacter, name: &str) -> bool {
    character.character().is_some_and(|bound| !bound.targets_of_shape(name).is_empty())
}

/// The error of a shape that a character does not have.
pub fn unknown(character: &LoadedCharacter, name: &str) -> Failure {
    let names = character.character().map(Character::shape_names).unwrap_or_default();
    let what = format!("{} has no shape {name:?}", character.name);
    if names.is_empty() {
        return Failure::usage(format!("{what}: it has none"), "leave out --shape");
    }
    let some: Vec<&str> = names.iter().take(LISTED).copied().collect();
    let dots = if names.len() > some.len() { ", …" } else { "" };
    Failure::usage(what, format!("choose {}{dots}", some.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shape_is_a_name_and_a_weight() {
        let parsed = |text: &str| text.parse::<ShapeWeight>();
        assert_eq!(parsed("smile=0.7"), Ok(ShapeWeight { name: "smile".into(), weight: 0.7 }));
        assert_eq!(parsed("a=b=-1"), Ok(ShapeWeight { name: "a=b".into(), weight: -1.0 }));
        for wrong in ["", "smile", "=1", "smile=", "smile=NaN", "smile=inf", "smile=much"] {
            assert!(parsed(wrong).unwrap_err().contains("smile=0.7"), "{wrong}");
        }
    }
}
