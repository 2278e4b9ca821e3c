//! Materials as networks around a `UsdPreviewSurface`.

use std::sync::Arc;

use super::identifiers::Identifiers;
use super::layer::{Layer, tuple};
use super::stage::Stage;
use crate::model::{AlphaMode, Material, Texture, Wrap};
use crate::text::quoted;

/// The materials that were written, in their order.
pub(super) struct Materials(Vec<Written>);

/// A material that was written.
pub(super) struct Written {
    pub(super) path: String,
    pub(super) double_sided: bool,
}

impl Materials {
    pub(super) fn get(&self, material: u32) -> Option<&Written> {
        self.0.get(material as usize)
    }
}

/// The images of materials, as files beside the layer; an image that several maps share is one.
pub(super) struct Images {
    /// Whether there is a place for files.
    packed: bool,
    written: Vec<(String, Arc<Texture>)>,
}

impl Images {
    /// For a layer alone.
    pub(super) fn none() -> Self {
        Self { packed: false, written: Vec::new() }
    }

    /// For a package.
    pub(super) fn packed() -> Self {
        Self { packed: true, written: Vec::new() }
    }

    /// Names and contents.
    pub(super) fn files(&self) -> impl Iterator<Item = (&str, &[u8])> {
        self.written.iter().map(|(name, image)| (name.as_str(), image.bytes.as_slice()))
    }

    fn name(&mut self, map: &Arc<Texture>) -> String {
        let same = |(_, image): &&(String, Arc<Texture>)| (&image.mime, &image.bytes) == (&map.mime, &map.bytes);
        if let Some((name, _)) = self.written.iter().find(same) {
            return name.clone();
        }
        let extension = if map.mime == "image/png" { "png" } else { "jpg" };
        let name = format!("textures/image_{}.{extension}", self.written.len() + 1);
        self.written.push((name.clone(), Arc::clone(map)));
        name
    }
}

/// Writes materials below a scope. What a preview surface cannot say is added to `left_out`, in sentences.
pub(super) fn write_materials(
    stage: &mut Stage,
    materials: &[Material],
    images: &mut Images,
    left_out: &mut Vec<String>,
) -> Materials {
    if materials.is_empty() {
        return Materials(Vec::new());
    }
    let scope = stage.name("Materials", "Materials");
    stage.layer().open("def Scope", &scope, &[], "");
    let mut names = Identifiers::default();
    let mut written = Vec::with_capacity(materials.len());
    for material in materials {
        let shown = if material.name.is_empty() { "skin" } else { &material.name };
        let name = names.give(shown, "material");
        let path = stage.path(&format!("{scope}/{name}"));
        stage.layer().open("def Material", &name, &[], shown);
        Network { layer: stage.layer(), images, path: &path }.write(material);
        stage.layer().close();
        written.push(Written { path, double_sided: material.double_sided });
        if material.unlit {
            left_out.push(format!("USD has no place for parts of the material {}: that it is unlit", quoted(shown)));
        }
    }
    stage.layer().close();
    if !images.packed && materials.iter().any(|material| material.maps().iter().any(Option::is_some)) {
        left_out.push("A .usda file has no place for images; a .usdz has".to_owned());
    }
    Materials(written)
}

/// A material while it is written.
struct Network<'n> {
    layer: &'n mut Layer,
    images: &'n mut Images,
    path: &'n str,
}

/// An image as a preview surface reads it: value times `scale` plus `bias`.
struct Lookup<'n> {
    name: &'n str,
    map: Option<&'n Arc<Texture>>,
    scale: [f32; 4],
    bias: [f32; 4],
    is_color: bool,
}

impl Network<'_> {
    fn write(&mut self, material: &Material) {
        let [r, g, b, a] = material.base_color.unwrap_or([1.0; 4]);
        let [x, y, z] = material.emissive;
        let normal = material.normal_scale;
        let plain = |name, map, scale, is_color| Lookup { name, map, scale, bias: [0.0; 4], is_color };
        let base = self.lookup(&plain("base_color_map", material.base_color_map.as_ref(), [r, g, b, a], true));
        let rough_scale = [1.0, material.roughness, material.metallic, 1.0];
        let rough =
            self.lookup(&plain("metallic_roughness_map", material.metallic_roughness_map.as_ref(), rough_scale, false));
        let glow = self.lookup(&plain("emissive_map", material.emissive_map.as_ref(), [x, y, z, 1.0], true));
        let bumps = self.lookup(&Lookup {
            bias: [-normal, -normal, -1.0, 0.0],
            ..plain("normal_map", material.normal_map.as_ref(), [2.0 * normal, 2.0 * normal, 2.0, 1.0], false)
        });
        let path = self.path;
        if base || rough || glow || bumps {
            self.layer.open("def Shader", "st", &[], "");
            self.layer.line("uniform token info:id = \"UsdPrimvarReader_float2\"");
            self.layer.line("string inputs:varname = \"st\"");
            self.layer.line("float2 outputs:result");
            self.layer.close();
        }
        let from = |map: &str, output: &str| format!("<{path}/{map}.outputs:{output}>");
        let layer = &mut *self.layer;
        layer.open("def Shader", "surface", &[], "");
        layer.line("uniform token info:id = \"UsdPreviewSurface\"");
        let input =
            |layer: &mut Layer, kind: &str, name: &str, connected: Option<String>, value: String| match connected {
                Some(source) => layer.line(format_args!("{kind} inputs:{name}.connect = {source}")),
                None => layer.line(format_args!("{kind} inputs:{name} = {value}")),
            };
        input(layer, "color3f", "diffuseColor", base.then(|| from("base_color_map", "rgb")), tuple([r, g, b]));
        input(layer, "color3f", "emissiveColor", glow.then(|| from("emissive_map", "rgb")), tuple([x, y, z]));
        let rough_map = |output| rough.then(|| from("metallic_roughness_map", output));
        input(layer, "float", "roughness", rough_map("g"), material.roughness.to_string());
        input(layer, "float", "metallic", rough_map("b"), material.metallic.to_string());
        if material.alpha != AlphaMode::Opaque {
            input(layer, "float", "opacity", base.then(|| from("base_color_map", "a")), a.to_string());
        }
        if let AlphaMode::Mask { cutoff } = material.alpha {
            layer.line(format_args!("float inputs:opacityThreshold = {cutoff}"));
        }
        if bumps {
            layer.line(format_args!("normal3f inputs:normal.connect = {}", from("normal_map", "rgb")));
        }
        layer.line("token outputs:surface");
        layer.close();
        layer.line(format_args!("token outputs:surface.connect = <{path}/surface.outputs:surface>"));
    }

    /// Whether there is such an image.
    fn lookup(&mut self, lookup: &Lookup) -> bool {
        let Some(map) = lookup.map.filter(|_| self.images.packed) else { return false };
        let file = self.images.name(map);
        let wrap = |wrap: Wrap| match wrap {
            Wrap::Repeat => "repeat",
            Wrap::Mirror => "mirror",
            Wrap::Clamp => "clamp",
        };
        let layer = &mut *self.layer;
        layer.open("def Shader", lookup.name, &[], "");
        layer.line("uniform token info:id = \"UsdUVTexture\"");
        layer.line(format_args!("asset inputs:file = @{file}@"));
        layer.line(format_args!("float2 inputs:st.connect = <{}/st.outputs:result>", self.path));
        layer.line(format_args!("token inputs:wrapS = \"{}\"", wrap(map.wrap[0])));
        layer.line(format_args!("token inputs:wrapT = \"{}\"", wrap(map.wrap[1])));
        layer
            .line(format_args!("token inputs:sourceColorSpace = \"{}\"", if lookup.is_color { "sRGB" } else { "raw" }));
        layer.line(format_args!("float4 inputs:scale = {}", tuple(lookup.scale)));
        layer.line(format_args!("float4 inputs:bias = {}", tuple(lookup.bias)));
        ["r", "g", "b", "a"].iter().for_each(|channel| layer.line(format_args!("float outputs:{channel}")));
        layer.line("float3 outputs:rgb");
        layer.close();
        true
    }
}
