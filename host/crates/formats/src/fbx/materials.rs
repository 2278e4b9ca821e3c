//! Materials and their images, inside the file or beside it.

use std::sync::Arc;

use ufbx::{MaterialMap, Texture as FbxTexture, WrapMode};

use crate::model::texture::{forward_slashes, texture};
use crate::model::{AlphaMode, GreyMaps, Material, Resolver, Texture, Wrap};
use crate::text::quoted;

/// The materials that are used, in order of appearance. An image that several maps use is fetched once.
pub(super) struct Materials<'r> {
    resolver: Resolver<'r>,
    /// The library's number of each.
    numbers: Vec<u32>,
    pub(super) read: Vec<Material>,
    pub(super) grey_maps: Vec<GreyMaps>,
    /// How texture coordinates of each become places in its image, if they are changed.
    placements: Vec<Option<[[f64; 3]; 2]>>,
    images: Vec<(u32, Option<Arc<Texture>>)>,
    pub(super) warnings: Vec<String>,
}

impl<'r> Materials<'r> {
    pub(super) fn new(resolver: Resolver<'r>) -> Self {
        Self {
            resolver,
            numbers: Vec::new(),
            read: Vec::new(),
            grey_maps: Vec::new(),
            placements: Vec::new(),
            images: Vec::new(),
            warnings: Vec::new(),
        }
    }

    /// Our number of a material, which is read when it is first asked for.
    pub(super) fn number(&mut self, material: &ufbx::Material) -> u32 {
        let id = material.element.element_id;
        let known = self.numbers.iter().position(|&number| number == id);
        known.unwrap_or_else(|| {
            let read = self.read_material(material);
            self.numbers.push(id);
            self.read.push(read);
            let m = base_map(material).filter(|map| map.has_uv_transform).map(|map| &map.uv_to_texture);
            self.placements.push(m.map(|m| [[m.m00, m.m01, m.m03], [m.m10, m.m11, m.m13]]));
            self.numbers.len() - 1
        }) as u32
    }

    /// Texture coordinates as the image is sampled, from its upper left corner.
    pub(super) fn placed(&self, material: Option<u32>, [u, v]: [f64; 2]) -> [f32; 2] {
        let placement = material.and_then(|number| *self.placements.get(number as usize)?);
        let [u, v] = placement.map_or([u, v], |rows| rows.map(|[a, b, c]| a * u + b * v + c));
        [u as f32, (1.0 - v) as f32]
    }

    fn read_material(&mut self, material: &ufbx::Material) -> Material {
        let name = material.element.name.to_string();
        let pbr = &material.pbr;
        let number = |map: &MaterialMap, default: f64| {
            let value = if map.has_value { map.value_vec4.x } else { default };
            if value.is_finite() { value } else { default }
        };
        let unit = |value: f64| value.clamp(0.0, 1.0) as f32;
        let factor = number(&pbr.base_factor, 1.0);
        let color = if pbr.base_color.has_value {
            pbr.base_color.value_vec4
        } else {
            ufbx::Vec4 { x: 1.0, y: 1.0, z: 1.0, w: 1.0 }
        };
        let base_color_map = self.map(&pbr.base_color);
        // A colour under an image is often left black.
        let color = if base_color_map.is_some() { [1.0; 3] } else { [color.x, color.y, color.z].map(|c| c * factor) };
        let opacity = number(&pbr.opacity, opacity_of_phong(&material.fbx));
        let clear = [&pbr.opacity, &material.fbx.transparency_color, &material.fbx.transparency_factor];
        let shares_image = clear.iter().any(|map| map.texture.is_some() && map.texture_enabled);
        let is_glossiness = material.features.roughness_as_glossiness.enabled;
        if is_glossiness && pbr.roughness.texture.is_some() && pbr.roughness.texture_enabled {
            let named = quoted(&name);
            self.warnings.push(format!("The map of the material {named} that holds glossiness is not used."));
        }
        let roughness = if is_glossiness { None } else { self.map(&pbr.roughness) };
        let metallic = self.map(&pbr.metalness);
        if roughness.is_some() || metallic.is_some() {
            self.grey_maps.push(GreyMaps { material: self.read.len() as u32, roughness, metallic });
        }
        let strength = number(&pbr.emission_factor, 1.0);
        let emission = if pbr.emission_color.has_value { pbr.emission_color.value_vec4 } else { ufbx::Vec4::default() };
        let emissive_map = self.map(&pbr.emission_color);
        let emitted = |c: f64| if (c * strength).is_finite() { (c * strength).max(0.0) as f32 } else { 0.0 };
        let finite = color.iter().all(|c| c.is_finite());
        let [red, green, blue] = color.map(unit);
        Material {
            name,
            base_color: finite.then(|| [red, green, blue, unit(opacity)]),
            base_color_map,
            metallic: unit(number(&pbr.metalness, 0.0)),
            roughness: unit(number(&pbr.roughness, 0.8)),
            metallic_roughness_map: None,
            normal_map: self.map(&pbr.normal_map),
            normal_scale: 1.0,
            emissive: [emission.x, emission.y, emission.z].map(emitted),
            emissive_map,
            alpha: if opacity < 1.0 || shares_image { AlphaMode::Blend } else { AlphaMode::Opaque },
            // FBX says this of objects at most, and few programs write or heed it.
            double_sided: true,
            unlit: material.features.unlit.enabled,
        }
    }

    /// The image of a map; one that cannot be used becomes a warning.
    fn map(&mut self, map: &MaterialMap) -> Option<Arc<Texture>> {
        let found = map.texture.as_deref().filter(|_| map.texture_enabled)?;
        // Several layers: the lowest image.
        let found = found.file_textures.first().map_or(found, |file| &**file);
        let id = found.element.element_id;
        if let Some((_, image)) = self.images.iter().find(|(known, _)| *known == id) {
            return image.clone();
        }
        let image = self.fetch(found);
        self.images.push((id, image.clone()));
        image
    }

    fn fetch(&mut self, found: &FbxTexture) -> Option<Arc<Texture>> {
        let relative = forward_slashes(&found.relative_filename);
        let path = if relative.is_empty() { forward_slashes(&found.filename) } else { relative };
        let file = path.rsplit('/').next().unwrap_or(&path).to_owned();
        let wrap = [found.wrap_u, found.wrap_v].map(|mode| match mode {
            WrapMode::Clamp => Wrap::Clamp,
            WrapMode::Repeat => Wrap::Repeat,
        });
        if !found.content.is_empty() {
            return texture(&quoted(&file), found.content.to_vec(), wrap, &mut self.warnings);
        }
        if file.is_empty() {
            return None;
        }
        // Where the exporter had it, as far as that is below the file's own folder; else beside the file.
        let is_below = !path.starts_with('/') && !path.contains(':') && !path.split('/').any(|step| step == "..");
        let bytes = match (self.resolver)(if is_below { &path } else { &file }) {
            Err(_) if is_below && path != file => (self.resolver)(&file),
            other => other,
        };
        match bytes {
            Ok(bytes) => texture(&quoted(&file), bytes, wrap, &mut self.warnings),
            Err(error) => {
                let elsewhere = if is_below { String::new() } else { format!(" ({} is not followed)", quoted(&path)) };
                self.warnings.push(format!("The texture {} is missing: {error}{elsewhere}.", quoted(&file)));
                None
            }
        }
    }
}

/// The format's oldest materials say how much shines through: a colour times a factor. Where that would be everything,
/// nobody would have drawn the mesh: exporters leave both at 1 in materials that are opaque.
fn opacity_of_phong(material: &ufbx::MaterialFbxMaps) -> f64 {
    let (color, factor) = (&material.transparency_color, &material.transparency_factor);
    if !(color.has_value && factor.has_value) {
        return 1.0;
    }
    let ufbx::Vec4 { x, y, z, .. } = color.value_vec4;
    let opacity = 1.0 - factor.value_vec4.x * (x + y + z) / 3.0;
    if opacity > 0.0 && opacity <= 1.0 { opacity } else { 1.0 }
}

/// The set of texture coordinates that a material's image lies on, by name.
pub(super) fn uv_set(material: &ufbx::Material) -> Option<&str> {
    base_map(material).map(|map| map.uv_set.as_ref()).filter(|name| !name.is_empty())
}

/// The image of the base colour.
fn base_map(material: &ufbx::Material) -> Option<&FbxTexture> {
    material.pbr.base_color.texture.as_deref().filter(|_| material.pbr.base_color.texture_enabled)
}
