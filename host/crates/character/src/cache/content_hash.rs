//! By which bytes a take knows its character. The recipe never changes, so that takes of any age find theirs.

use std::borrow::Cow;
use std::sync::Arc;

use armature_formats::model::Material;

use super::file::{Layout, laid_out};
use super::parts::{drop_wraps, has_wraps};
use super::provenance::write_old_provenance;
use super::skin::has_skin;
use crate::character::{Character, Surface};
use crate::skin_kind::SkinKind;

/// The layout of files whose bytes are hashed, for all that it can hold.
const LAYOUT: u32 = 3;

/// A BLAKE3 hash of all that determines how a character moves, and of its looks as far as they were known when this was
/// laid down.
pub fn content_hash(character: &Character) -> [u8; 32] {
    let how = Layout { single_mesh: LAYOUT, write_provenance: write_old_provenance };
    content_hash_of(&laid_out(&as_once_known(&without_skin(character)), how))
}

/// A character that follows its bones linearly: takes move the bones, and how the skin follows is no part of them.
fn without_skin(character: &Character) -> Cow<'_, Character> {
    if !has_skin(character) {
        return Cow::Borrowed(character);
    }
    let mut known = character.clone();
    known.skin = SkinKind::Linear;
    Arc::make_mut(&mut known.surface).endpoints = None;
    Cow::Owned(known)
}

/// A character of one mesh without what materials and vertices were given later.
fn as_once_known(character: &Character) -> Cow<'_, Character> {
    let Character { surface, materials, skins, .. } = character;
    let is_one = surface.parts == [Surface::one_part(&surface.mesh)];
    let ([material], true, true, true) = (&**materials, is_one, surface.morph_targets.is_empty(), skins.is_empty())
    else {
        return without_latest(character);
    };
    let Material { base_color, base_color_map, .. } = material.clone();
    let mut known = character.clone();
    known.materials = vec![Material { base_color, base_color_map, ..Material::default() }];
    let mut known = without_latest(&known).into_owned();
    if known.surface.vertex_colors.is_some() {
        Arc::make_mut(&mut known.surface).vertex_colors = None;
    }
    Cow::Owned(known)
}

/// A character without avatar whose images repeat: what files held before they held these.
fn without_latest(character: &Character) -> Cow<'_, Character> {
    if !has_wraps(&character.materials) && character.avatar.is_none() {
        return Cow::Borrowed(character);
    }
    let mut known = character.clone();
    known.avatar = None;
    drop_wraps(&mut known.materials);
    Cow::Owned(known)
}

/// The same of a character that is nothing but these bytes, as a bare skeleton is.
pub fn content_hash_of(bytes: &[u8]) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    hasher.update(b"armature character");
    hasher.update(&LAYOUT.to_le_bytes());
    hasher.update(&1_u64.to_le_bytes());
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
    // What the settings for binding were by default when this was laid down.
    hasher.update(&[0, 0, 1, 0]);
    hasher.update(&5000_u64.to_le_bytes());
    hasher.update(&8_u64.to_le_bytes());
    for number in [3.0_f64, 1e-4, 1e-7] {
        hasher.update(&number.to_le_bytes());
    }
    *hasher.finalize().as_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn takes_find_a_character_whose_material_is_known_better() {
        let mut character = crate::own::hand().unwrap();
        let hash = content_hash(&character);
        character.materials[0].roughness = 0.25;
        character.materials[0].name = "skin".to_owned();
        let vertices = character.surface.mesh.vertices.len();
        Arc::make_mut(&mut character.surface).vertex_colors = Some(vec![[0.5; 4]; vertices]);
        character.skin = SkinKind::StretchTwist;
        let endpoints = crate::skin::projected_endpoints(&character).unwrap();
        Arc::make_mut(&mut character.surface).endpoints = Some(endpoints);
        assert_eq!(content_hash(&character), hash);
        character.materials[0].base_color = Some([0.5; 4]);
        assert_ne!(content_hash(&character), hash);
    }

    /// From the headers of takes that were recorded with the first version that had inverse kinematics.
    #[test]
    fn takes_of_any_age_find_the_built_in_characters() {
        let hex = |hash: [u8; 32]| blake3::Hash::from_bytes(hash).to_hex().to_string();
        let hashes = [
            (crate::own::human(), "599092fd326ca690f02ebc82ddcf74686a9df0f68218b533a262af0cfe648172"),
            (crate::own::spider(), "666edf8f2ff05f461d42bcf203e45856bde225dd0a46e2216280229954499261"),
            (crate::own::hand(), "4b125bfcaa3677cc17fce5900a5e7e6bbbbbc15a8c2ada79f49b65de62ee329d"),
        ];
        for (character, expected) in hashes {
            assert_eq!(hex(content_hash(&character.unwrap())), expected);
        }
    }
}
