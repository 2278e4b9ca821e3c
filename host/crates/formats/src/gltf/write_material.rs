//! Materials and their images to glTF.

use std::sync::Arc;

use gltf_json::extensions::material::Material as Extensions;
use gltf_json::material::{
    AlphaCutoff, AlphaMode as GltfAlpha, EmissiveFactor, Material as GltfMaterial, NormalTexture, PbrBaseColorFactor,
    PbrMetallicRoughness, StrengthFactor,
};
use gltf_json::texture::WrappingMode;
use gltf_json::validation::Checked;
use gltf_json::{Index, image, texture};
use serde_json::{Map, json};

use super::buffer::Builder;
use crate::model::{AlphaMode, Material, Texture, Wrap};

/// Writes materials, or a plain one if there are none. An image that several maps share is written once.
pub(super) fn write_materials(builder: &mut Builder, materials: &[Material]) -> Vec<Index<GltfMaterial>> {
    let plain = [Material::default()];
    let materials = if materials.is_empty() { &plain } else { materials };
    let mut images = Images::default();
    materials.iter().map(|material| write_material(builder, &mut images, material)).collect()
}

/// Images already written, by their address.
#[derive(Default)]
struct Images(Vec<(*const Texture, Index<texture::Texture>)>);

impl Images {
    fn info(&mut self, builder: &mut Builder, map: Option<&Arc<Texture>>) -> Option<texture::Info> {
        let index = self.write(builder, map?);
        Some(texture::Info { index, tex_coord: 0, extensions: None, extras: gltf_json::Extras::default() })
    }

    fn write(&mut self, builder: &mut Builder, map: &Arc<Texture>) -> Index<texture::Texture> {
        if let Some((_, index)) = self.0.iter().find(|(known, _)| *known == Arc::as_ptr(map)) {
            return *index;
        }
        let view = builder.view(&map.bytes, None);
        let image = image::Image {
            buffer_view: Some(view),
            mime_type: Some(image::MimeType(map.mime.clone())),
            name: None,
            uri: None,
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        let source = Index::push(&mut builder.root.images, image);
        let [wrap_s, wrap_t] = map.wrap.map(|wrap| {
            Checked::Valid(match wrap {
                Wrap::Repeat => WrappingMode::Repeat,
                Wrap::Mirror => WrappingMode::MirroredRepeat,
                Wrap::Clamp => WrappingMode::ClampToEdge,
            })
        });
        let sampler = texture::Sampler { wrap_s, wrap_t, ..texture::Sampler::default() };
        let sampler = Index::push(&mut builder.root.samplers, sampler);
        let texture = texture::Texture {
            name: None,
            sampler: Some(sampler),
            source,
            extensions: None,
            extras: gltf_json::Extras::default(),
        };
        let index = Index::push(&mut builder.root.textures, texture);
        self.0.push((Arc::as_ptr(map), index));
        index
    }
}

fn write_material(builder: &mut Builder, images: &mut Images, material: &Material) -> Index<GltfMaterial> {
    let unit = |value: f32| value.clamp(0.0, 1.0);
    let base_color_texture = images.info(builder, material.base_color_map.as_ref());
    let metallic_roughness_texture = images.info(builder, material.metallic_roughness_map.as_ref());
    let normal_texture = material.normal_map.as_ref().map(|map| NormalTexture {
        index: images.write(builder, map),
        scale: material.normal_scale,
        tex_coord: 0,
        extensions: None,
        extras: gltf_json::Extras::default(),
    });
    let emissive_texture = images.info(builder, material.emissive_map.as_ref());
    let (alpha_mode, alpha_cutoff) = match material.alpha {
        AlphaMode::Opaque => (GltfAlpha::Opaque, None),
        AlphaMode::Mask { cutoff } => (GltfAlpha::Mask, Some(AlphaCutoff(unit(cutoff)))),
        AlphaMode::Blend => (GltfAlpha::Blend, None),
    };
    let brightest = material.emissive.iter().fold(1.0_f32, |most, &c| most.max(c));
    let mut others = Map::new();
    if material.unlit {
        others.insert("KHR_materials_unlit".to_owned(), json!({}));
    }
    if brightest > 1.0 {
        others.insert("KHR_materials_emissive_strength".to_owned(), json!({ "emissiveStrength": brightest }));
    }
    for name in others.keys().filter(|name| !builder.root.extensions_used.contains(name)).collect::<Vec<_>>() {
        builder.root.extensions_used.push(name.clone());
    }
    let name = if material.name.is_empty() { "skin" } else { &material.name };
    let material = GltfMaterial {
        name: Some(name.to_owned()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: PbrBaseColorFactor(material.base_color.unwrap_or([1.0; 4]).map(unit)),
            base_color_texture,
            metallic_factor: StrengthFactor(unit(material.metallic)),
            roughness_factor: StrengthFactor(unit(material.roughness)),
            metallic_roughness_texture,
            ..PbrMetallicRoughness::default()
        },
        normal_texture,
        emissive_texture,
        emissive_factor: EmissiveFactor(material.emissive.map(|c| unit(c / brightest))),
        alpha_mode: Checked::Valid(alpha_mode),
        alpha_cutoff,
        double_sided: material.double_sided,
        extensions: (!others.is_empty()).then_some(Extensions { others }),
        ..GltfMaterial::default()
    };
    Index::push(&mut builder.root.materials, material)
}
