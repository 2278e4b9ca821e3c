//! How a character's skin follows its bones, chosen for one run.

use armature_character::skin::projected_endpoints;
use armature_character::{EndpointMethod, Progress, SkinKind};
use clap::Args;

use super::{Found, LoadedCharacter, OWN, own_twisting};
use crate::failure::Failure;

/// Help of `--skin`, without what it is without the option.
const WAYS: &str = "How the skin follows the bones: lbs (linear blending, as other programs do), dqs (dual quaternions: no \
                    joint collapses), stretch-twist or stretch-twist-dqs (over either: a turned hand twists the whole \
                    forearm, and a bone out of reach stretches)";

/// Help of `--skin`, and what it is without the option.
pub fn skin_help(without: &str) -> String {
    format!("{WAYS}{without}")
}

/// How the skin follows the bones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Args)]
pub struct SkinArgs {
    #[arg(long, value_name = "KIND", help = skin_help("; without it, as the character's file says"))]
    #[expect(missing_docs, reason = "its help is put together with that of bind")]
    pub skin: Option<SkinKind>,
}

impl SkinArgs {
    /// The character with the skin that was chosen, if one was.
    pub fn apply(self, found: Found, progress: Progress) -> Result<Found, Failure> {
        let Some(kind) = self.skin else { return Ok(found) };
        with_skin(found, kind, progress)
    }
}

/// A character whose skin is of this kind, with a warning if it lacks what makes that smooth. Our own characters get it.
fn with_skin(found: Found, kind: SkinKind, progress: Progress) -> Result<Found, Failure> {
    let Found { mut character, mut warnings } = found;
    let LoadedCharacter { name, source, shape, .. } = &mut character;
    let Some(shape) = shape else {
        return Err(Failure::usage(format!("{source} has no mesh, so it has no skin"), "leave out --skin"));
    };
    let bound = &mut shape.character;
    if kind.stretches() && bound.surface.endpoints.is_none() && OWN.contains(&source.as_str()) {
        *bound = own_twisting(source, bound.clone(), progress)?;
    }
    bound.skin = kind;
    if kind.stretches() && bound.surface.endpoints.is_none() {
        let failed =
            |e: armature_deform::skin::SkinError| Failure::input(format!("{name}: {e}"), "bind the character again");
        let endpoints = projected_endpoints(bound).map_err(failed)?;
        std::sync::Arc::make_mut(&mut bound.surface).endpoints = Some(endpoints);
    }
    let method = bound.surface.endpoints.as_ref().map(|endpoints| endpoints.method);
    if kind.stretches() && method == Some(EndpointMethod::Projection) {
        warnings.push(format!(
            "{name} was bound without smooth endpoint weights, so its skin may have kinks at the joints where it twists \
             or stretches; `armature bind --skin {kind}` computes them"
        ));
    }
    Ok(Found { character, warnings })
}
