//! From glTF materials and their images to ours.

use std::sync::Arc;

use gltf_json::material::{AlphaMode as GltfAlpha, Material as GltfMaterial};
use gltf_json::texture::WrappingMode;
use gltf_json::validation::Checked;
use gltf_json::{Index, Value, texture};
use serde_json::Map;

use super::container::Document;
use crate::FormatError;
use crate::model::texture::texture;
use crate::model::{AlphaMode, Material, Resolver, Texture, Wrap};
use crate::text::quoted;

/// Where a map lies on the surface: which texture coordinates, and what is done to them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placement {
    pub(super) set: u32,
    offset: [f32; 2],
    /// Radians.
    rotation: f32,
    scale: [f32; 2],
}

impl Placement {
    /// That of the material's first map, which all its maps should share.
    pub(super) fn of_material(material: &GltfMaterial) -> Self {
        let first = placed_maps(material).into_iter().flatten().next();
        first.map_or(Self::plain(0), |(_, placement)| placement)
    }

    fn plain(set: u32) -> Self {
        Self { set, offset: [0.0; 2], rotation: 0.0, scale: [1.0; 2] }
    }

    /// By `KHR_texture_transform`, where a texture has it and its numbers are finite.
    fn read(set: u32, extensions: Option<&Map<String, Value>>) -> Self {
        let Some(transform) = extensions.and_then(|e| e.get("KHR_texture_transform")) else { return Self::plain(set) };
        let number = |value: &Value| value.as_f64().map(|v| v as f32).filter(|v| v.is_finite());
        let pair = |name: &str| {
            let values = transform.get(name)?.as_array()?;
            Some([number(values.first()?)?, number(values.get(1)?)?])
        };
        let plain = Self::plain(set);
        Self {
            set: transform.get("texCoord").and_then(Value::as_u64).map_or(set, |set| set as u32),
            offset: pair("offset").unwrap_or(plain.offset),
            rotation: transform.get("rotation").and_then(number).unwrap_or_default(),
            scale: pair("scale").unwrap_or(plain.scale),
        }
    }

    /// Texture coordinates as the image is sampled.
    pub(super) fn apply(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        if *self == Self::plain(self.set) {
            return [u, v];
        }
        let (sin, cos) = (libm::sinf(self.rotation), libm::cosf(self.rotation));
        let [u, v] = [u * self.scale[0], v * self.scale[1]];
        [cos * u + sin * v + self.offset[0], cos * v - sin * u + self.offset[1]]
    }
}

type PlacedMap = Option<(Index<texture::Texture>, Placement)>;

/// Base colour, metallic-roughness, normal, emissive.
fn placed_maps(material: &GltfMaterial) -> [PlacedMap; 4] {
    let plain = |info: &Option<texture::Info>| {
        let info = info.as_ref()?;
        Some((info.index, Placement::read(info.tex_coord, info.extensions.as_ref().map(|e| &e.others))))
    };
    let surface = &material.pbr_metallic_roughness;
    let normal = material
        .normal_texture
        .as_ref()
        .map(|info| (info.index, Placement::read(info.tex_coord, info.extensions.as_ref().map(|e| &e.others))));
    [
        plain(&surface.base_color_texture),
        plain(&surface.metallic_roughness_texture),
        normal,
        plain(&material.emissive_texture),
    ]
}

/// The materials with these numbers, in this order. An image that several maps use is fetched once.
pub(super) fn read_materials(
    document: &Document,
    resolver: Resolver,
    used: &[usize],
    warnings: &mut Vec<String>,
) -> Result<Vec<Material>, FormatError> {
    let mut images = Images { document, resolver, fetched: Vec::new() };
    let mut occlusion = false;
    let mut materials = Vec::with_capacity(used.len());
    for &index in used {
        // `used` holds materials that were found before.
        let Some(material) = document.root.materials.get(index) else { continue };
        occlusion |= material.occlusion_texture.is_some();
        materials.push(read_material(material, &mut images, warnings)?);
    }
    if occlusion {
        warnings.push("Maps of ambient occlusion are not used.".to_owned());
    }
    Ok(materials)
}

fn read_material(
    material: &GltfMaterial,
    images: &mut Images,
    warnings: &mut Vec<String>,
) -> Result<Material, FormatError> {
    let name = material.name.clone().unwrap_or_default();
    let placement = Placement::of_material(material);
    let mut maps = [None, None, None, None];
    let kinds = ["colour", "metallic-roughness", "normal", "emissive"];
    for ((slot, map), kind) in maps.iter_mut().zip(placed_maps(material)).zip(kinds) {
        let Some((texture, own)) = map else { continue };
        if own == placement {
            *slot = images.get(texture, warnings)?;
        } else {
            let named = quoted(&name);
            warnings.push(format!(
                "The {kind} map of the material {named} is ignored: it lies elsewhere on the surface than its other maps."
            ));
        }
    }
    let [base_color_map, metallic_roughness_map, normal_map, emissive_map] = maps;
    let surface = &material.pbr_metallic_roughness;
    let unit = |value: f32, default: f32| if value.is_finite() { value.clamp(0.0, 1.0) } else { default };
    let color = surface.base_color_factor.0;
    let extension = |name: &str| material.extensions.as_ref().and_then(|e| e.others.get(name));
    let strength = extension("KHR_materials_emissive_strength").and_then(|e| e.get("emissiveStrength")?.as_f64());
    let strength = strength.map_or(1.0, |s| s as f32);
    let emitted = |value: f32| if (value * strength).is_finite() { (value * strength).max(0.0) } else { 0.0 };
    let alpha = match material.alpha_mode {
        Checked::Valid(GltfAlpha::Mask) => {
            AlphaMode::Mask { cutoff: material.alpha_cutoff.map_or(0.5, |cutoff| unit(cutoff.0, 0.5)) }
        }
        Checked::Valid(GltfAlpha::Blend) => AlphaMode::Blend,
        Checked::Valid(GltfAlpha::Opaque) | Checked::Invalid => AlphaMode::Opaque,
    };
    Ok(Material {
        name,
        base_color: color.iter().all(|c| c.is_finite()).then(|| color.map(|c| c.clamp(0.0, 1.0))),
        base_color_map,
        metallic: unit(surface.metallic_factor.0, 1.0),
        roughness: unit(surface.roughness_factor.0, 1.0),
        metallic_roughness_map,
        normal_map,
        normal_scale: material.normal_texture.as_ref().map(|t| t.scale).filter(|s| s.is_finite()).unwrap_or(1.0),
        emissive: material.emissive_factor.0.map(emitted),
        emissive_map,
        alpha,
        double_sided: material.double_sided,
        unlit: extension("KHR_materials_unlit").is_some(),
    })
}

/// The number of an image in the file, and what is beside it.
type ImageUse = (usize, [Wrap; 2]);

/// Images by their number in the file.
struct Images<'d> {
    document: &'d Document<'d>,
    resolver: Resolver<'d>,
    fetched: Vec<(ImageUse, Option<Arc<Texture>>)>,
}

impl Images<'_> {
    /// The image of a texture; one that cannot be used becomes a warning.
    fn get(
        &mut self,
        index: Index<texture::Texture>,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Arc<Texture>>, FormatError> {
        let texture = self.document.get(&self.document.root.textures, index, "texture")?;
        let key = (texture.source.value(), self.wrap(texture)?);
        if let Some((_, image)) = self.fetched.iter().find(|(known, _)| *known == key) {
            return Ok(image.clone());
        }
        let image = self.fetch(key, warnings)?;
        self.fetched.push((key, image.clone()));
        Ok(image)
    }

    fn wrap(&self, texture: &texture::Texture) -> Result<[Wrap; 2], FormatError> {
        let Some(sampler) = texture.sampler else { return Ok([Wrap::Repeat; 2]) };
        let sampler = self.document.get(&self.document.root.samplers, sampler, "sampler")?;
        Ok([sampler.wrap_s, sampler.wrap_t].map(|mode| match mode {
            Checked::Valid(WrappingMode::ClampToEdge) => Wrap::Clamp,
            Checked::Valid(WrappingMode::MirroredRepeat) => Wrap::Mirror,
            Checked::Valid(WrappingMode::Repeat) | Checked::Invalid => Wrap::Repeat,
        }))
    }

    fn fetch(&self, (number, wrap): ImageUse, warnings: &mut Vec<String>) -> Result<Option<Arc<Texture>>, FormatError> {
        let Some(image) = self.document.root.images.get(number) else {
            warnings.push("The texture is ignored: its image format needs an extension.".to_owned());
            return Ok(None);
        };
        Ok(match (image.buffer_view, &image.uri) {
            (Some(view), _) => texture("of the file", self.document.view(view)?.0.to_vec(), wrap, warnings),
            (None, Some(uri)) => match self.document.fetch(uri, self.resolver) {
                Ok(bytes) => texture(image.name.as_deref().unwrap_or("beside the file"), bytes, wrap, warnings),
                Err(error) => {
                    warnings.push(format!("The texture is ignored: {}.", error.what));
                    None
                }
            },
            (None, None) => None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As Blender's importer has it: a quarter turn takes the top of the image to its left.
    #[test]
    fn texture_coordinates_are_scaled_turned_and_moved() {
        let json = serde_json::json!({"KHR_texture_transform": {
            "offset": [0.5, 0.25], "rotation": std::f32::consts::FRAC_PI_2, "scale": [2, 3], "texCoord": 1
        }});
        let placement = Placement::read(0, json.as_object());
        assert_eq!(placement.set, 1);
        let near = |a: [f32; 2], b: [f32; 2]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
        assert!(near(placement.apply([0.0, 0.0]), [0.5, 0.25]));
        assert!(near(placement.apply([1.0, 0.0]), [0.5, -1.75]));
        assert!(near(placement.apply([0.0, 1.0]), [3.5, 0.25]));
        let wrong = serde_json::json!({"KHR_texture_transform": {"offset": "no", "scale": [1], "rotation": []}});
        assert_eq!(Placement::read(3, wrong.as_object()), Placement::plain(3));
    }
}
