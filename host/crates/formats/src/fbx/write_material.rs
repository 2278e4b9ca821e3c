//! Materials, with their images inside the file.

use std::sync::Arc;

use super::write_document::{
    Document, Id, Node, Value, enum_property, number_property, object_name, properties, property, text_property,
    vector_property,
};
use crate::model::{AlphaMode, Material, Texture, Wrap};
use crate::text::quoted;

/// The name of the texture coordinates.
pub(super) const UV_SET: &str = "UVMap";

/// Writes materials as the format's oldest kind (Phong), which every program reads. An image that several maps share is
/// written once. What that kind cannot say is added to `left_out`, in sentences.
pub(super) fn write_materials(
    document: &mut Document,
    materials: &[Material],
    name: &str,
    left_out: &mut Vec<String>,
) -> Vec<Id> {
    let mut images = Images { name, written: Vec::new() };
    materials.iter().map(|material| write_material(document, &mut images, material, left_out)).collect()
}

/// A material for parts that have none.
pub(super) fn write_plain_material(document: &mut Document) -> Id {
    let mut images = Images { name: "", written: Vec::new() };
    let plain = Material { name: "plain".to_owned(), ..Material::default() };
    write_material(document, &mut images, &plain, &mut Vec::new())
}

/// Images already written, by their address.
struct Images<'n> {
    name: &'n str,
    written: Vec<(*const Texture, Id)>,
}

impl Images<'_> {
    fn write(&mut self, document: &mut Document, map: &Arc<Texture>) -> Id {
        if let Some((_, id)) = self.written.iter().find(|(known, _)| *known == Arc::as_ptr(map)) {
            return *id;
        }
        let extension = if map.mime == "image/png" { "png" } else { "jpg" };
        let plain: String = self.name.chars().map(|c| if c.is_alphanumeric() { c } else { '_' }).collect();
        let file = format!("{plain}_{}.{extension}", self.written.len() + 1);
        let video = vec![
            Node::of("Type", "Clip"),
            properties(vec![property("Path", ["KString", "XRefUrl", ""], vec![file.as_str().into()])]),
            Node::of("UseMipMap", 0),
            Node::of("Filename", file.as_str()),
            Node::of("RelativeFilename", file.as_str()),
            Node::of("Content", Value::Bytes(map.bytes.clone())),
        ];
        let video = document.add("Video", [&file, "Video"], "Clip", video);
        let full = |class| Value::Text(object_name([&file, class]));
        let texture = vec![
            Node::of("Type", "TextureVideoClip"),
            Node::of("Version", 202),
            Node::of("TextureName", full("Texture")),
            Node::of("Media", full("Video")),
            Node::of("FileName", file.as_str()),
            Node::of("RelativeFilename", file.as_str()),
            properties(vec![
                text_property("UVSet", UV_SET),
                property("UseMaterial", ["bool", "", ""], vec![1.into()]),
                enum_property("CurrentMappingType", 0),
                enum_property("WrapModeU", (map.wrap[0] == Wrap::Clamp).into()),
                enum_property("WrapModeV", (map.wrap[1] == Wrap::Clamp).into()),
            ]),
            Node::new("ModelUVTranslation", vec![0.0.into(), 0.0.into()]),
            Node::new("ModelUVScaling", vec![1.0.into(), 1.0.into()]),
            Node::of("Texture_Alpha_Source", "None"),
            Node::new("Cropping", vec![Value::Int(0); 4]),
        ];
        let texture = document.add("Texture", [&file, "Texture"], "", texture);
        document.connect(video, texture);
        self.written.push((Arc::as_ptr(map), texture));
        texture
    }
}

fn write_material(document: &mut Document, images: &mut Images, material: &Material, left_out: &mut Vec<String>) -> Id {
    let unit = |value: f32| f64::from(value.clamp(0.0, 1.0));
    let [red, green, blue, opacity] = material.base_color.unwrap_or([1.0; 4]).map(unit);
    let brightest = material.emissive.iter().fold(1.0_f32, |most, &c| most.max(c));
    let emissive = material.emissive.map(|c| unit(c / brightest));
    let roughness = unit(material.roughness);
    // As programs with rough materials read the exponent of a highlight.
    let shininess = (1.0 - roughness) * (1.0 - roughness) * 100.0;
    let color = |name, rgb| vector_property(name, ["Color", "", "A"], rgb);
    let number = |name, value: f64| number_property(name, value);
    let own = vec![
        color("DiffuseColor", [red, green, blue]),
        number("DiffuseFactor", 1.0),
        color("EmissiveColor", emissive),
        number("EmissiveFactor", f64::from(brightest)),
        color("AmbientColor", [0.0; 3]),
        number("AmbientFactor", 0.0),
        color("TransparentColor", [1.0; 3]),
        number("TransparencyFactor", 1.0 - opacity),
        number("Opacity", opacity),
        color("SpecularColor", [1.0; 3]),
        number("SpecularFactor", 0.25),
        number("Shininess", shininess),
        number("ShininessExponent", shininess),
        color("ReflectionColor", [1.0; 3]),
        number("ReflectionFactor", unit(material.metallic)),
        number("BumpFactor", f64::from(material.normal_scale)),
    ];
    let name = if material.name.is_empty() { "skin" } else { &material.name };
    let children =
        vec![Node::of("Version", 102), Node::of("ShadingModel", "Phong"), Node::of("MultiLayer", 0), properties(own)];
    let id = document.add("Material", [name, "Material"], "", children);
    let is_clear = material.alpha != AlphaMode::Opaque;
    let maps = [
        (material.base_color_map.as_ref(), "DiffuseColor"),
        (material.base_color_map.as_ref().filter(|_| is_clear), "TransparencyFactor"),
        (material.normal_map.as_ref(), "NormalMap"),
        (material.emissive_map.as_ref(), "EmissiveColor"),
    ];
    for (map, property) in maps {
        if let Some(map) = map {
            let texture = images.write(document, map);
            document.connect_property(texture, id, property);
        }
    }
    let missing = [
        (material.metallic_roughness_map.is_some(), "its metallic-roughness map"),
        (matches!(material.alpha, AlphaMode::Mask { .. }), "the cutoff of its opacity"),
        (material.unlit, "that it is unlit"),
        (!material.double_sided, "that it shows one side"),
    ];
    let missing: Vec<&str> = missing.iter().filter(|(is, _)| *is).map(|(_, what)| *what).collect();
    if !missing.is_empty() {
        left_out.push(format!("FBX has no place for parts of the material {}: {}", quoted(name), missing.join(", ")));
    }
    id
}
