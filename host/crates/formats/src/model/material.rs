//! What a mesh part looks like.

use std::sync::Arc;

/// A metallic-roughness material, as in glTF. Maps are shared between materials that use the same image.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Its name in the file; may be empty.
    pub name: String,
    /// Linear red, green, blue and opacity, each in 0..=1; multiplies the map. `None` where the file gives none.
    pub base_color: Option<[f32; 4]>,
    /// Base colour and opacity, sRGB.
    pub base_color_map: Option<Arc<Texture>>,
    /// 0 (plastic) to 1 (metal); multiplies the map.
    pub metallic: f32,
    /// 0 (mirror) to 1 (chalk); multiplies the map.
    pub roughness: f32,
    /// Roughness in its green and metallic in its blue channel, linear.
    pub metallic_roughness_map: Option<Arc<Texture>>,
    /// Tangent-space normals: x right, y up, z out of the surface, linear.
    pub normal_map: Option<Arc<Texture>>,
    /// How far the normal map tilts: multiplies its x and y.
    pub normal_scale: f32,
    /// Emitted light, linear, not negative, and above 1 where it shines brighter than paper; multiplies the map.
    pub emissive: [f32; 3],
    /// Emitted light, sRGB.
    pub emissive_map: Option<Arc<Texture>>,
    /// What opacity means.
    pub alpha: AlphaMode,
    /// Whether the backs of triangles are drawn.
    pub double_sided: bool,
    /// Whether it is drawn in its own colour whatever the light is.
    pub unlit: bool,
}

/// Images of roughness and metallic apart, as FBX has them: grey, linear. A [`Material`] has both in one image, which has
/// to be made of these by decoding them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GreyMaps {
    /// Zero-based material.
    pub material: u32,
    /// In place of the material's number, not multiplied by it.
    pub roughness: Option<Arc<Texture>>,
    /// The same.
    pub metallic: Option<Arc<Texture>>,
}

/// An image as its file's bytes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Texture {
    /// `image/png` or `image/jpeg`.
    pub mime: String,
    /// The encoded image.
    pub bytes: Vec<u8>,
    /// What is beside it on the surface, across and down.
    pub wrap: [Wrap; 2],
}

/// What a map shows where texture coordinates are outside of its image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image again.
    #[default]
    Repeat,
    /// The image again, every other one mirrored.
    Mirror,
    /// The pixels of its edge.
    Clamp,
}

/// What the opacity of a [`Material`] means.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum AlphaMode {
    /// Nothing: everything is opaque.
    #[default]
    Opaque,
    /// Below the cutoff nothing is drawn; from it on, everything is opaque.
    Mask {
        /// The least opacity that is drawn.
        cutoff: f32,
    },
    /// How much it covers what lies behind.
    Blend,
}

impl Default for Material {
    /// Neither metal nor mirror, without a colour of its own, and seen from both sides.
    fn default() -> Self {
        Self {
            name: String::new(),
            base_color: None,
            base_color_map: None,
            metallic: 0.0,
            roughness: 0.8,
            metallic_roughness_map: None,
            normal_map: None,
            normal_scale: 1.0,
            emissive: [0.0; 3],
            emissive_map: None,
            alpha: AlphaMode::default(),
            double_sided: true,
            unlit: false,
        }
    }
}

impl Material {
    /// Its maps: base colour, metallic-roughness, normal, emissive.
    pub fn maps(&self) -> [Option<&Arc<Texture>>; 4] {
        let Self { base_color_map, metallic_roughness_map, normal_map, emissive_map, .. } = self;
        [base_color_map, metallic_roughness_map, normal_map, emissive_map].map(Option::as_ref)
    }

    /// The same, to be replaced.
    pub fn maps_mut(&mut self) -> [&mut Option<Arc<Texture>>; 4] {
        let Self { base_color_map, metallic_roughness_map, normal_map, emissive_map, .. } = self;
        [base_color_map, metallic_roughness_map, normal_map, emissive_map]
    }

    /// Whether all its numbers are finite.
    pub fn is_finite(&self) -> bool {
        let cutoff = if let AlphaMode::Mask { cutoff } = self.alpha { cutoff } else { 0.0 };
        let numbers = [self.metallic, self.roughness, self.normal_scale, cutoff];
        let mut all = self.base_color.iter().flatten().chain(&self.emissive).chain(&numbers);
        all.all(|number| number.is_finite())
    }
}
