//! Who is on the stage: a character ready to be posed, or a bare skeleton.

use armature_character::{BindSettings, Character};
use armature_deform::LinearBlendSkin;
use armature_rig::Skeleton;

use crate::failure::Failure;

/// A character, or only its bones.
#[derive(Debug)]
pub struct Actor {
    /// For lists, takes and exports.
    pub name: String,
    /// What the user typed to get it; a take remembers it.
    pub source: String,
    /// The bones.
    pub skeleton: Skeleton,
    /// The mesh as it is drawn; `None` for a bare skeleton.
    pub shape: Option<Shape>,
    /// The bound character behind `shape`, for exports.
    pub character: Option<Character>,
}

/// A character's mesh in the form in which it is drawn.
#[derive(Debug)]
pub struct Shape {
    /// n rest positions, model space.
    pub positions: Vec<[f32; 3]>,
    /// n unit rest normals.
    pub normals: Vec<[f32; 3]>,
    /// Vertex triples, counter-clockwise from outside.
    pub triangles: Vec<[u32; 3]>,
    /// n texture coordinates (origin at the upper left), or none.
    pub uv: Vec<[f32; 2]>,
    /// sRGB, 0 to 1.
    pub base_color: Option<[f32; 3]>,
    /// The base colour image, decoded.
    pub texture: Option<Image>,
}

/// An image in memory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// 4·width·height bytes, sRGB and alpha, rows from the top.
    pub rgba: Vec<u8>,
}

/// Textures larger than this are a mistake that would only fill the memory.
const LARGEST_TEXTURE_SIDE: u32 = 16_384;

impl Actor {
    /// A bare skeleton.
    pub fn bare(name: &str, source: &str, skeleton: Skeleton) -> Self {
        Self { name: name.into(), source: source.into(), skeleton, shape: None, character: None }
    }

    /// A bound character. A texture that cannot be decoded is left out of the drawing (not out of exports), which
    /// the second value says.
    pub fn of_character(source: &str, character: Character) -> (Self, Option<String>) {
        let (texture, warning) = match character.texture.as_ref().map(|t| decode(&t.bytes)) {
            None => (None, None),
            Some(Ok(image)) => (Some(image), None),
            Some(Err(reason)) => (None, Some(format!("the texture of {} is not drawn: {reason}", character.name))),
        };
        let [red, green, blue, _] = character.base_color;
        let shape = Shape {
            positions: character.rest_positions(),
            normals: character.normals.clone(),
            triangles: character.mesh.triangles.clone(),
            uv: character.texture_coordinates.clone().unwrap_or_default(),
            base_color: Some([red, green, blue].map(srgb)),
            texture,
        };
        let actor = Self {
            name: character.name.clone(),
            source: source.into(),
            skeleton: character.skeleton.clone(),
            shape: Some(shape),
            character: Some(character),
        };
        (actor, warning)
    }

    /// A hash of everything that decides how it moves and looks.
    pub fn content_hash(&self) -> [u8; 32] {
        let bytes = match &self.character {
            Some(character) => armature_character::to_bytes(character),
            None => format!("{:?}", self.skeleton).into_bytes(),
        };
        *armature_character::cache_key(&[&bytes], &BindSettings::default()).as_bytes()
    }

    /// The skin made ready for every frame; `None` for a bare skeleton.
    pub fn precompute_skin(&self) -> Result<Option<LinearBlendSkin>, Failure> {
        let skin = self.character.as_ref().map(Character::skin).transpose();
        skin.map_err(|e| Failure::input(format!("{}: {e}", self.name), "bind the character again"))
    }
}

fn decode(bytes: &[u8]) -> Result<Image, String> {
    let mut reader =
        image::ImageReader::new(std::io::Cursor::new(bytes)).with_guessed_format().map_err(|e| e.to_string())?;
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(LARGEST_TEXTURE_SIDE);
    limits.max_image_height = Some(LARGEST_TEXTURE_SIDE);
    reader.limits(limits);
    let rgba = reader.decode().map_err(|e| e.to_string())?.into_rgba8();
    Ok(Image { width: rgba.width(), height: rgba.height(), rgba: rgba.into_raw() })
}

/// Linear light to sRGB.
fn srgb(linear: f32) -> f32 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 }
}
