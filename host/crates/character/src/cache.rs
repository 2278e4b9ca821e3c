//! A bound character as bytes, and back.
//!
//! ```text
//! 0   8  "ARMATURE"
//! 8   4  format version (little-endian, as all numbers)
//! 12  8  length of the body
//! 20  32 BLAKE3 hash of the body
//! 52     body
//! ```

use armature_formats::Texture;
use armature_geometry::{Influences, TriangleMesh};
use armature_rig::{Bone, Skeleton, Transform};
use glam::{Quat, Vec3};

use crate::Character;
use crate::cache_bytes::{Reader, Writer};
use crate::cache_record::{read_provenance, write_provenance};

/// File name extension, without the dot.
pub const CACHE_EXTENSION: &str = "armature";
/// Raised with every change of the layout or of what binding computes from the same input.
pub(crate) const FORMAT_VERSION: u32 = 3;
/// The oldest layout that is still read: it knew bone heat alone.
const OLDEST_VERSION: u32 = 1;

const MAGIC: [u8; 8] = *b"ARMATURE";
const HEADER: usize = 52;

/// Why bytes are not a character.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CacheError {
    /// The file does not begin as a character file does.
    #[error("this is no character file (it does not begin with {:?}); bind a mesh to make one", "ARMATURE")]
    NotACharacter,
    /// The file was written in another layout.
    #[error("this character file has format {found}, this program reads {FORMAT_VERSION}; bind the mesh again")]
    Version {
        /// The version in the file.
        found: u32,
    },
    /// The file ends too early.
    #[error(
        "the character file ends too early: {needed} bytes needed at byte {byte}, {left} left; bind the mesh again"
    )]
    Truncated {
        /// Where reading stopped.
        byte: usize,
        /// Bytes wanted there.
        needed: usize,
        /// Bytes there.
        left: usize,
    },
    /// The checksum does not belong to the body.
    #[error("the character file is damaged: its checksum does not match; bind the mesh again")]
    Checksum,
    /// A value makes no sense.
    #[error("byte {byte} of the character file: {what}; bind the mesh again")]
    Malformed {
        /// Where, in the file; just behind the value.
        byte: usize,
        /// What is wrong.
        what: String,
    },
}

/// Writes a character.
pub fn to_bytes(character: &Character) -> Vec<u8> {
    let mut body = Writer::default();
    write_body(&mut body, character);
    let mut out = Vec::with_capacity(HEADER + body.0.len());
    out.extend(MAGIC);
    out.extend(FORMAT_VERSION.to_le_bytes());
    out.extend((body.0.len() as u64).to_le_bytes());
    out.extend(blake3::hash(&body.0).as_bytes());
    out.extend(body.0);
    out
}

/// Reads a character; what [`to_bytes`] wrote comes back bit for bit.
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
    let character = read_body(&mut reader)?;
    if reader.left() > 0 {
        return Err(reader.bad(format!("{} bytes too many", reader.left())));
    }
    Ok(character)
}

fn write_body(w: &mut Writer, character: &Character) {
    // Taken apart by name, so that a new field cannot be forgotten here.
    let Character {
        name,
        mesh,
        normals,
        texture_coordinates,
        base_color,
        texture,
        skeleton,
        influences,
        provenance,
        warnings,
    } = character;
    w.bytes(name.as_bytes());
    w.list(&mesh.vertices, |w, p| p.iter().for_each(|&c| w.f64(c)));
    w.list(&mesh.triangles, |w, t| t.iter().for_each(|v| w.0.extend(v.to_le_bytes())));
    w.list(normals, |w, n| w.f32s(*n));
    w.byte(u8::from(texture_coordinates.is_some()));
    if let Some(coordinates) = texture_coordinates {
        w.list(coordinates, |w, t| w.f32s(*t));
    }
    w.f32s(*base_color);
    w.byte(u8::from(texture.is_some()));
    if let Some(texture) = texture {
        w.bytes(texture.mime.as_bytes());
        w.bytes(&texture.bytes);
    }
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
    let texture = r.option(|r| Ok(Texture { mime: r.text()?, bytes: r.bytes()?.to_vec() }))?;
    let bones = r.list(64, read_bone)?;
    let skeleton = Skeleton::new(bones).map_err(|error| r.bad(error.to_string()))?;
    let influences = read_influences(r, vertex_count, skeleton.len())?;
    let provenance = read_provenance(r)?;
    let warnings = r.list(8, Reader::text)?;
    Ok(Character {
        name,
        mesh,
        normals,
        texture_coordinates,
        base_color,
        texture,
        skeleton,
        influences,
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
#[path = "cache_tests.rs"]
mod tests;
