//! A character as the program holds it while it is posed, drawn and exported: once in memory, behind one `Arc`.

use std::sync::Arc;

use armature_character::Character;
use armature_character::skin::CharacterSkin;
use armature_deform::skin::Morphs;
use armature_formats::model::{AlphaMode, Texture};
use armature_geometry::Influences;
use armature_render::{Alpha, Map, Material, MeshPart, Picture, Wrap, decode_picture};
use armature_rig::Skeleton;

use crate::failure::Failure;
use crate::files::grey_maps::LARGEST_TEXTURE_SIDE;

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
    /// Materials with their images decoded.
    pub materials: Vec<Material>,
}

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

    /// n colours, linear, and opacities, if there are any.
    pub fn vertex_colors(&self) -> Option<&[[f32; 4]]> {
        self.character.surface.vertex_colors.as_deref()
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
        let (materials, mut warnings) = drawn_materials(&character);
        let positions = character.positions_in_rest_pose().unwrap_or_else(|reason| {
            warnings.push(format!("{} is shown as it was bound, not at rest: {reason}", character.name));
            character.rest_positions()
        });
        let loaded = Self {
            name: character.name.clone(),
            source: source.into(),
            skeleton: character.skeleton.clone(),
            shape: Some(Shape { positions, parts: drawn_parts(&character), materials, character }),
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
    pub fn precompute_skin(&self) -> Result<Option<CharacterSkin>, Failure> {
        let skin = self.character().map(CharacterSkin::precompute).transpose();
        skin.map_err(|e| Failure::input(format!("{}: {e}", self.name), "bind the character again"))
    }

    /// Its morph targets made ready for blending; `None` if there are none.
    pub fn precompute_morphs(&self) -> Result<Option<Morphs>, Failure> {
        let morphs = self.character().map_or(Ok(None), Character::morphs);
        morphs.map_err(|e| Failure::input(format!("{}: {e}", self.name), "bind the character again"))
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

/// What the parts are drawn with, and warnings about maps that are not drawn. An image that several materials share is
/// decoded once.
fn drawn_materials(character: &Character) -> (Vec<Material>, Vec<String>) {
    let mut images = Images { of: &character.name, decoded: Vec::new(), warnings: Vec::new() };
    let is_clear = |color: &[f32; 4]| color[3] < 1.0;
    let clear_vertices = character.surface.vertex_colors.as_ref().is_some_and(|colors| colors.iter().any(is_clear));
    let mut materials: Vec<Material> =
        character.materials.iter().map(|material| drawn_material(material, clear_vertices, &mut images)).collect();
    if character.surface.parts.iter().any(|part| part.material.is_none()) {
        materials.push(Material::default());
    }
    (materials, images.warnings)
}

fn drawn_material(material: &armature_formats::model::Material, clear_vertices: bool, images: &mut Images) -> Material {
    let [base_color, metallic_roughness, normal, emissive] = material.maps();
    let mut map = |kind, map| images.map(material, kind, map);
    let base_color_map = map("base colour", base_color);
    // Exporters call materials blended that are not; those would only be sorted for nothing.
    let is_clear = clear_vertices
        || material.base_color.is_some_and(|[.., opacity]| opacity < 1.0)
        || base_color_map.as_ref().is_some_and(|map| map.picture.rgba.chunks_exact(4).any(|texel| texel[3] < 255));
    Material {
        base_color: material.base_color,
        base_color_map,
        metallic: material.metallic,
        roughness: material.roughness,
        metallic_roughness_map: map("metallic-roughness", metallic_roughness),
        normal_map: map("normal", normal),
        normal_scale: material.normal_scale,
        emissive: material.emissive,
        emissive_map: map("emissive", emissive),
        alpha: match material.alpha {
            AlphaMode::Mask { cutoff } => Alpha::Mask { cutoff },
            AlphaMode::Blend if is_clear => Alpha::Blend,
            AlphaMode::Opaque | AlphaMode::Blend => Alpha::Opaque,
        },
        double_sided: material.double_sided,
        unlit: material.unlit,
    }
}

/// Images by their addresses.
struct Images<'c> {
    /// The character's name.
    of: &'c str,
    decoded: Vec<(*const Texture, Option<Arc<Picture>>)>,
    warnings: Vec<String>,
}

impl Images<'_> {
    /// A map; without its image, the material's number or colour is drawn alone.
    fn map(
        &mut self,
        material: &armature_formats::model::Material,
        kind: &str,
        map: Option<&Arc<Texture>>,
    ) -> Option<Map> {
        let texture = map?;
        let wrap = texture.wrap.map(|wrap| match wrap {
            armature_formats::model::Wrap::Repeat => Wrap::Repeat,
            armature_formats::model::Wrap::Mirror => Wrap::Mirror,
            armature_formats::model::Wrap::Clamp => Wrap::Clamp,
        });
        if let Some((_, picture)) = self.decoded.iter().find(|(known, _)| *known == Arc::as_ptr(texture)) {
            return Some(Map { picture: picture.clone()?, wrap });
        }
        let picture = match decode_picture(&texture.bytes, LARGEST_TEXTURE_SIDE) {
            Ok(picture) => Some(Arc::new(picture)),
            Err(reason) => {
                let named = if material.name.is_empty() { String::new() } else { format!(" of {:?}", material.name) };
                self.warnings.push(format!("the {kind} map{named} of {} is not drawn: {reason}", self.of));
                None
            }
        };
        self.decoded.push((Arc::as_ptr(texture), picture.clone()));
        Some(Map { picture: picture?, wrap })
    }
}
