//! A bound character as bytes, and back.
//!
//! ```text
//! 0   8  "ARMATURE"
//! 8   4  format version (little-endian, as all numbers)
//! 12  8  length of the body
//! 20  32 BLAKE3 hash of the body
//! 52     body
//! ```

use std::sync::Arc;

use armature_formats::model::Material;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, Skeleton, Transform};
use glam::{Quat, Vec3};

use super::avatar::{read_avatar, write_avatar};
use super::bytes::{Reader, Writer};
use super::error::CacheError;
use super::format::{
    AVATAR_VERSION, COLORS_VERSION, FORMAT_VERSION, HEADER, MAGIC, MONOTONE_VERSION, OLDEST_VERSION,
    SINGLE_MESH_VERSION, SKIN_VERSION,
};
use super::parts::{
    has_wraps, read_colors, read_image, read_parts, read_wraps, write_colors, write_parts, write_wraps,
};
use super::provenance::{read_provenance, write_provenance};
use super::skin::{has_skin, read_skin, write_skin};
use crate::character::{Character, Provenance, Surface, WeightsRecord};
use crate::skin_kind::SkinKind;

/// Writes a character, in the older layout if that can represent all of it.
pub fn to_bytes(character: &Character) -> Vec<u8> {
    laid_out(character, Layout { single_mesh: SINGLE_MESH_VERSION, write_provenance })
}

/// What distinguishes the layouts for a single mesh.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    /// The number of the layout.
    pub(super) single_mesh: u32,
    pub(super) write_provenance: fn(&mut Writer, &Provenance),
}

/// A character's bytes in a layout for a single mesh, or in the oldest that can represent all of it if there is more.
pub(super) fn laid_out(character: &Character, how: Layout) -> Vec<u8> {
    let is_monotone = matches!(character.provenance.record(), Some(WeightsRecord::Monotone(_)));
    let has_skin = has_skin(character);
    let is_single = !is_monotone && !has_skin && is_single_mesh(character);
    let is_known_better = has_wraps(&character.materials) || character.avatar.is_some();
    let version = match (is_single, is_known_better, is_monotone) {
        _ if has_skin => SKIN_VERSION,
        (true, ..) => how.single_mesh,
        (false, true, _) => AVATAR_VERSION,
        (false, false, true) => MONOTONE_VERSION,
        (false, false, false) => COLORS_VERSION,
    };
    let mut body = Writer::default();
    write_body(&mut body, character, if is_single { how.write_provenance } else { write_provenance });
    if !is_single {
        write_parts(&mut body, character);
        write_colors(&mut body, character);
        if version >= AVATAR_VERSION {
            write_wraps(&mut body, &character.materials);
            write_avatar(&mut body, character.avatar.as_ref());
        }
        if version >= SKIN_VERSION {
            write_skin(&mut body, character);
        }
    }
    let mut out = Vec::with_capacity(HEADER + body.0.len());
    out.extend(MAGIC);
    out.extend(version.to_le_bytes());
    out.extend((body.0.len() as u64).to_le_bytes());
    out.extend(blake3::hash(&body.0).as_bytes());
    out.extend(body.0);
    out
}

/// Whether there is nothing but one mesh and one material with a colour and its map.
fn is_single_mesh(character: &Character) -> bool {
    let Character { surface, materials, skins, avatar, .. } = character;
    let [material] = materials.as_slice() else { return false };
    let (base_color, base_color_map) = (material.base_color, material.base_color_map.clone());
    surface.parts == [Surface::one_part(&surface.mesh)]
        && surface.morph_targets.is_empty()
        && surface.vertex_colors.is_none()
        && skins.is_empty()
        && base_color.is_some()
        && !has_wraps(materials)
        && avatar.is_none()
        && *material == Material { base_color, base_color_map, ..Material::default() }
}

/// Reads a character; what [`to_bytes`] wrote is read back bit for bit.
pub fn from_bytes(bytes: &[u8]) -> Result<Character, CacheError> {
    let mut reader = Reader::new(bytes);
    if reader.array::<8>().ok() != Some(MAGIC) {
        return Err(CacheError::NotACharacter);
    }
    let found = reader.u32()?;
    if !(OLDEST_VERSION..=FORMAT_VERSION).contains(&found) {
        return Err(CacheError::Version { found });
    }
    let length = u64::from_le_bytes(reader.array()?);
    let hash = reader.array::<32>()?;
    if length != reader.left() as u64 {
        let needed = usize::try_from(length).unwrap_or(usize::MAX);
        return Err(if needed > reader.left() {
            CacheError::Truncated { byte: reader.at(), needed, left: reader.left() }
        } else {
            reader.bad(format!("{} bytes follow, {length} were announced", reader.left()))
        });
    }
    if *blake3::hash(&bytes[HEADER..]).as_bytes() != hash {
        return Err(CacheError::Checksum);
    }
    let mut character = read_body(&mut reader)?;
    if found > SINGLE_MESH_VERSION {
        read_parts(&mut reader, &mut character)?;
    }
    if found >= COLORS_VERSION {
        read_colors(&mut reader, &mut character)?;
    }
    if found >= AVATAR_VERSION {
        read_wraps(&mut reader, &mut character.materials)?;
        character.avatar = read_avatar(&mut reader, &character)?;
    }
    if found >= SKIN_VERSION {
        read_skin(&mut reader, &mut character)?;
    }
    if reader.left() > 0 {
        return Err(reader.bad(format!("{} bytes too many", reader.left())));
    }
    Ok(character)
}

/// A whole character of one mesh.
fn write_body(w: &mut Writer, character: &Character, write_provenance: fn(&mut Writer, &Provenance)) {
    // Destructured, so that a new field cannot be forgotten: parts, morph targets, skins and the rest of the materials
    // are written by `write_parts`,
    // `write_colors` and `write_wraps`, the avatar by `write_avatar`, the kind of skin and endpoint weights by `write_skin`.
    let Character { name, surface, materials, skeleton, skins: _, avatar: _, skin: _, provenance, warnings } =
        character;
    let Surface {
        mesh,
        normals,
        texture_coordinates,
        vertex_colors: _,
        influences,
        endpoints: _,
        parts: _,
        morph_targets: _,
    } = &**surface;
    let first = materials.first();
    w.bytes(name.as_bytes());
    w.list(&mesh.vertices, |w, p| p.iter().for_each(|&c| w.f64(c)));
    w.list(&mesh.triangles, |w, t| t.iter().for_each(|v| w.0.extend(v.to_le_bytes())));
    w.list(normals, |w, n| w.f32s(*n));
    w.option(texture_coordinates.as_ref(), |w, coordinates| w.list(coordinates, |w, t| w.f32s(*t)));
    w.f32s(first.and_then(|material| material.base_color).unwrap_or([1.0; 4]));
    w.option(first.and_then(|material| material.base_color_map.as_ref()), |w, map| {
        w.bytes(map.mime.as_bytes());
        w.bytes(&map.bytes);
    });
    w.list(skeleton.bones(), write_bone);
    w.count(influences.per_vertex());
    w.list(influences.bones(), |w, b| w.0.extend(b.to_le_bytes()));
    w.list(influences.weights(), |w, &weight| w.f32s([weight]));
    write_provenance(w, provenance);
    w.list(warnings, |w, text| w.bytes(text.as_bytes()));
}

fn write_bone(w: &mut Writer, bone: &Bone) {
    w.bytes(bone.name.as_bytes());
    // No skeleton has as many bones as u32::MAX.
    let parent = bone.parent.map_or(u32::MAX, |p| p as u32);
    w.0.extend(parent.to_le_bytes());
    w.f32s(bone.rest.translation.to_array());
    w.f32s(bone.rest.rotation.to_array());
    w.f32s(bone.rest.scale.to_array());
    w.f32s(bone.tail.to_array());
}

fn read_body(r: &mut Reader) -> Result<Character, CacheError> {
    let name = r.text()?;
    let vertices = r.list(24, |r| Ok([r.f64()?, r.f64()?, r.f64()?]))?;
    let triangles = r.list(12, |r| Ok([r.u32()?, r.u32()?, r.u32()?]))?;
    let mesh = TriangleMesh { vertices, triangles };
    mesh.validate().map_err(|error| r.bad(error.to_string()))?;
    let vertex_count = mesh.vertices.len();
    let normals = r.list(12, Reader::f32s::<3>)?;
    if normals.len() != vertex_count {
        return Err(r.bad(format!("{} normals for {vertex_count} vertices", normals.len())));
    }
    let texture_coordinates = r.option(|r| r.list(8, Reader::f32s::<2>))?;
    if texture_coordinates.as_ref().is_some_and(|t| t.len() != vertex_count) {
        return Err(r.bad("texture coordinates and vertices differ in number"));
    }
    let base_color = r.f32s::<4>()?;
    let base_color_map = r.option(read_image)?;
    let bones = r.list(64, read_bone)?;
    let skeleton = Skeleton::new(bones).map_err(|error| r.bad(error.to_string()))?;
    let influences = read_influences(r, vertex_count, skeleton.len())?;
    let provenance = read_provenance(r)?;
    let warnings = r.list(8, Reader::text)?;
    let parts = vec![Surface::one_part(&mesh)];
    Ok(Character {
        name,
        surface: Arc::new(Surface {
            mesh,
            normals,
            texture_coordinates,
            vertex_colors: None,
            influences,
            endpoints: None,
            parts,
            morph_targets: Vec::new(),
        }),
        materials: vec![Material { base_color: Some(base_color), base_color_map, ..Material::default() }],
        skeleton,
        skins: Vec::new(),
        avatar: None,
        skin: SkinKind::Linear,
        provenance,
        warnings,
    })
}

fn read_bone(r: &mut Reader) -> Result<Bone, CacheError> {
    let name = r.text()?;
    let parent = r.u32()?;
    Ok(Bone {
        name,
        parent: (parent != u32::MAX).then_some(parent as usize),
        rest: Transform {
            translation: Vec3::from_array(r.f32s()?),
            rotation: Quat::from_array(r.f32s()?),
            scale: Vec3::from_array(r.f32s()?),
        },
        tail: Vec3::from_array(r.f32s()?),
    })
}

fn read_influences(r: &mut Reader, vertex_count: usize, bone_count: usize) -> Result<Influences, CacheError> {
    let per_vertex = usize::try_from(u64::from_le_bytes(r.array()?)).unwrap_or(usize::MAX);
    let bones = r.list(2, Reader::u16)?;
    let weights: Vec<f32> = r.list(4, |r| Ok(r.f32s::<1>()?[0]))?;
    let expected = per_vertex.checked_mul(vertex_count);
    if expected != Some(bones.len()) {
        return Err(r.bad(format!("{} influences for {vertex_count} vertices with {per_vertex} each", bones.len())));
    }
    Influences::restore(per_vertex, bones, weights, bone_count).map_err(|error| r.bad(error.to_string()))
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
