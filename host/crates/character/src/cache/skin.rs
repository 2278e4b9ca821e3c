//! How a character's skin follows its bones, as bytes and back.

use std::sync::Arc;

use super::bytes::{Reader, Writer};
use super::error::CacheError;
use crate::character::Character;
use crate::skin_kind::{EndpointMethod, Endpoints, SkinKind};

/// Whether there is anything that older layouts do not hold.
pub(super) fn has_skin(character: &Character) -> bool {
    character.skin != SkinKind::Linear || character.surface.endpoints.is_some()
}

/// In the file, a kind or method is its index in `ALL`.
pub(super) fn write_skin(w: &mut Writer, character: &Character) {
    let kind = SkinKind::ALL.iter().position(|kind| *kind == character.skin);
    w.byte(kind.unwrap_or_default() as u8);
    w.option(character.surface.endpoints.as_ref(), |w, Endpoints { method, weights }| {
        let method = EndpointMethod::ALL.iter().position(|known| known == method);
        w.byte(method.unwrap_or_default() as u8);
        w.list(weights, |w, &weight| w.f32s([weight]));
    });
}

pub(super) fn read_skin(r: &mut Reader, character: &mut Character) -> Result<(), CacheError> {
    let kind = r.byte()?;
    let unknown = || r.bad(format!("a skin of an unknown kind, {kind}"));
    character.skin = *SkinKind::ALL.get(usize::from(kind)).ok_or_else(unknown)?;
    let endpoints = r.option(|r| {
        let method = r.byte()?;
        let unknown = || r.bad(format!("endpoint weights of an unknown kind, {method}"));
        let method = *EndpointMethod::ALL.get(usize::from(method)).ok_or_else(unknown)?;
        let weights: Vec<f32> = r.list(4, |r| Ok(r.f32s::<1>()?[0]))?;
        Ok(Endpoints { method, weights })
    })?;
    if let Some(Endpoints { weights, .. }) = &endpoints {
        if weights.len() != character.surface.influences.bones().len() {
            return Err(r.bad("endpoint weights and influences differ in number"));
        }
        if !weights.iter().all(|weight| (0.0..=1.0).contains(weight)) {
            return Err(r.bad("an endpoint weight that is not within 0 to 1"));
        }
    }
    Arc::make_mut(&mut character.surface).endpoints = endpoints;
    Ok(())
}
