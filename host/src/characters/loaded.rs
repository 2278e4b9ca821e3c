//! A character as the program holds it while it is posed, drawn and exported: once in memory, behind one `Arc`.

use std::sync::Arc;

use armature_character::Character;
use armature_deform::skin::LinearBlendSkin;
use armature_formats::model::Texture;
use armature_geometry::Influences;
use armature_render::{Material, MeshPart, Picture, decode_picture};
use armature_rig::Skeleton;

use crate::failure::Failure;

/// A character ready to be posed, or a bare skeleton.
///
/// Triangles, normals, texture coordinates and weights are those of the bound [`Character`]; only what drawing needs in
/// another form is kept beside it.
#[derive(Debug, Default)]
pub struct LoadedCharacter {
    /// For lists, takes and exports.
    pub name: String,
    /// What the user typed to get it; a take remembers it.
    pub source: String,
    /// The bones.
    pub skeleton: Skeleton,
    /// The mesh bound to the bones; `None` for a bare skeleton.
    pub shape: Option<Shape>,
}

/// A bound character and what drawing it needs in another form.
#[derive(Debug)]
pub struct Shape {
    /// Surface, weights, and materials with their encoded images for exports.
    pub character: Character,
    /// n rest positions, model space, single precision as they are skinned and drawn.
    pub positions: Vec<[f32; 3]>,
    /// Which triangles are drawn with which material.
    pub parts: Vec<MeshPart>,
    /// Base colours and their images, decoded.
    pub materials: Vec<Material>,
}

/// A larger texture is a mistake and would only fill memory.
const LARGEST_TEXTURE_SIDE: u32 = 16_384;

impl Shape {
    /// Vertex triples, counter-clockwise from outside.
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.character.surface.mesh.triangles
    }

    /// n unit rest normals.
    pub fn normals(&self) -> &[[f32; 3]] {
        &self.character.surface.normals
    }

    /// n texture coordinates (origin at the upper left), if there are any.
    pub fn texture_coordinates(&self) -> Option<&[[f32; 2]]> {
        self.character.surface.texture_coordinates.as_deref().filter(|uv| !uv.is_empty())
    }

    /// Which bones move each vertex, and how much.
    pub fn influences(&self) -> &Influences {
        &self.character.surface.influences
    }
}

impl LoadedCharacter {
    /// A bare skeleton.
    pub fn bare(name: &str, source: &str, skeleton: Skeleton) -> Self {
        Self { name: name.into(), source: source.into(), skeleton, shape: None }
    }

    /// A bound character, and warnings about textures that cannot be decoded: they are not drawn, but exports keep them.
    pub fn bound(source: &str, character: Character) -> (Self, Vec<String>) {
        let (materials, warnings) = drawn_materials(&character);
        let loaded = Self {
            name: character.name.clone(),
            source: source.into(),
            skeleton: character.skeleton.clone(),
            shape: Some(Shape {
                positions: character.rest_positions(),
                parts: drawn_parts(&character),
                materials,
                character,
            }),
        };
        (loaded, warnings)
    }

    /// The bound character; `None` for a bare skeleton.
    pub fn character(&self) -> Option<&Character> {
        self.shape.as_ref().map(|shape| &shape.character)
    }

    /// A hash of everything that determines how it moves and looks, the same in every version of the program.
    pub fn content_hash(&self) -> [u8; 32] {
        match self.character() {
            Some(character) => armature_character::cache::content_hash(character),
            None => armature_character::cache::content_hash_of(format!("{:?}", self.skeleton).as_bytes()),
        }
    }

    /// The skin made ready for every frame; `None` for a bare skeleton.
    pub fn precompute_skin(&self) -> Result<Option<LinearBlendSkin>, Failure> {
        let skin = self.character().map(Character::skin).transpose();
        skin.map_err(|e| Failure::input(format!("{}: {e}", self.name), "bind the character again"))
    }
}

/// The parts of a character. Parts without a material get the default one, which comes last.
fn drawn_parts(character: &Character) -> Vec<MeshPart> {
    let plain = character.materials.len() as u32;
    let part = |part: &armature_formats::model::MeshPart| MeshPart {
        triangles: part.triangles.clone(),
        material: part.material.unwrap_or(plain),
    };
    character.surface.parts.iter().map(part).collect()
}

/// What the parts are drawn with, and warnings about what is not drawn. An image that several materials share is
/// decoded once.
fn drawn_materials(character: &Character) -> (Vec<Material>, Vec<String>) {
    let mut decoded: Vec<(*const Texture, Option<Arc<Picture>>)> = Vec::new();
    let mut warnings = Vec::new();
    let mut picture_of = |map: &Arc<Texture>| {
        if let Some((_, picture)) = decoded.iter().find(|(known, _)| *known == Arc::as_ptr(map)) {
            return picture.clone();
        }
        let picture = decode_picture(&map.bytes, LARGEST_TEXTURE_SIDE).map(Arc::new);
        let picture = picture
            .inspect_err(|reason| warnings.push(format!("the texture of {} is not drawn: {reason}", character.name)));
        decoded.push((Arc::as_ptr(map), picture.as_ref().ok().cloned()));
        picture.ok()
    };
    let mut material = |material: &armature_formats::model::Material| Material {
        base_color: material.base_color.map(|[red, green, blue, _]| [red, green, blue].map(srgb)),
        texture: material.base_color_map.as_ref().and_then(&mut picture_of),
    };
    let mut materials: Vec<Material> = character.materials.iter().map(&mut material).collect();
    if character.surface.parts.iter().any(|part| part.material.is_none()) {
        materials.push(Material::default());
    }
    (materials, warnings)
}

/// Linear light to sRGB.
fn srgb(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}
