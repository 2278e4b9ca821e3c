//! What a mesh part looks like.

use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::{Vec3, Vec4};

use crate::srgb::linear_from_srgb;
use crate::{Picture, RenderError};

/// A metallic-roughness material, as in glTF. Its numbers are linear light.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Red, green, blue and opacity, 0 to 1; multiplies the map. `None`: that of [`clay`](crate::Look::clay) (white if there is a map).
    pub base_color: Option<[f32; 4]>,
    /// Base colour (sRGB) and opacity.
    pub base_color_map: Option<Map>,
    /// 0 (plastic) to 1 (metal); multiplies the map.
    pub metallic: f32,
    /// 0 (mirror) to 1 (chalk); multiplies the map.
    pub roughness: f32,
    /// Roughness in its green and metallic in its blue channel, linear.
    pub metallic_roughness_map: Option<Map>,
    /// Tangent-space normals, linear: x along the first texture coordinate, y against the second, z out of the surface.
    pub normal_map: Option<Map>,
    /// Multiplies x and y of the normal map.
    pub normal_scale: f32,
    /// Emitted light; multiplies the map.
    pub emissive: [f32; 3],
    /// Emitted light, sRGB.
    pub emissive_map: Option<Map>,
    /// What opacity means.
    pub alpha: Alpha,
    /// Whether the backs of triangles are drawn.
    pub double_sided: bool,
    /// Whether it is drawn in its base colour whatever the light is.
    pub unlit: bool,
}

/// An image on the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Map {
    /// Its pixels.
    pub picture: Arc<Picture>,
    /// What is beside it, across and down.
    pub wrap: [Wrap; 2],
}

/// What a map shows outside of its image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
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
pub enum Alpha {
    /// Nothing: everything is opaque.
    #[default]
    Opaque,
    /// Below the cutoff nothing is drawn; from it on, everything is opaque.
    Mask {
        /// The least opacity that is drawn.
        cutoff: f32,
    },
    /// How much it covers what lies behind. Its triangles are drawn after all others, the farthest first.
    Blend,
}

impl Default for Material {
    fn default() -> Self {
        Self::CLAY
    }
}

impl Map {
    /// An image that repeats.
    pub fn repeating(picture: Arc<Picture>) -> Self {
        Self { picture, wrap: [Wrap::Repeat; 2] }
    }
}

impl Material {
    /// Clay, seen from both sides.
    pub const CLAY: Self = Self {
        base_color: None,
        base_color_map: None,
        metallic: 0.0,
        roughness: 0.8,
        metallic_roughness_map: None,
        normal_map: None,
        normal_scale: 1.0,
        emissive: [0.0; 3],
        emissive_map: None,
        alpha: Alpha::Opaque,
        double_sided: true,
        unlit: false,
    };

    /// An opaque colour (sRGB, 0 to 1) without maps.
    pub fn of_color(srgb: [f32; 3]) -> Self {
        let [red, green, blue] = srgb.map(linear_from_srgb);
        Self { base_color: Some([red, green, blue, 1.0]), ..Self::default() }
    }

    /// Its maps, in the order of the shader's bindings: base colour, metallic-roughness, normal, emissive.
    pub(crate) fn maps(&self) -> [Option<&Map>; MAPS] {
        let Self { base_color_map, metallic_roughness_map, normal_map, emissive_map, .. } = self;
        [base_color_map, metallic_roughness_map, normal_map, emissive_map].map(Option::as_ref)
    }

    /// Checks that the images' bytes fill their sizes.
    pub(crate) fn validate(&self, texture_limit: u32) -> Result<(), RenderError> {
        self.maps().into_iter().flatten().try_for_each(|map| {
            let Picture { width, height, ref rgba } = *map.picture;
            let expected = (u64::from(width) * u64::from(height)).saturating_mul(4);
            if expected != 0 && expected == rgba.len() as u64 && width.max(height) <= texture_limit {
                return Ok(());
            }
            Err(RenderError::BadTexture { width, height, expected, got: rgba.len(), limit: texture_limit })
        })
    }
}

/// How much less than the cutoff an opacity may be that was interpolated between vertices.
const ROUNDING: f32 = 1e-4;

/// How many maps a material has.
pub(crate) const MAPS: usize = 4;
/// Whether each map's colours are sRGB.
pub(crate) const MAP_IS_SRGB: [bool; MAPS] = [true, false, false, true];
/// Which of the maps is the normal map.
pub(crate) const NORMAL_MAP: usize = 2;

/// The struct `Material` of `shader/mesh.wgsl`, field by field; the comments are there.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct MaterialUniforms {
    pub(crate) base_color: Vec4,
    pub(crate) surface: Vec4,
    pub(crate) emissive: Vec4,
    pub(crate) flags: Vec4,
}

impl MaterialUniforms {
    /// `clay`: sRGB, for what has no colour of its own. `has_maps`: whether the mesh has texture coordinates.
    pub(crate) fn new(material: &Material, clay: [f32; 3], has_maps: bool) -> Self {
        let maps = material.maps().map(|map| map.is_some() && has_maps);
        let plain = if maps[0] { Vec4::ONE } else { Vec3::from(clay.map(linear_from_srgb)).extend(1.0) };
        let cutoff = if let Alpha::Mask { cutoff } = material.alpha { cutoff - ROUNDING } else { -1.0 };
        let flag = |set: bool| f32::from(u8::from(set));
        Self {
            base_color: material.base_color.map_or(plain, Vec4::from),
            surface: Vec4::new(material.metallic, material.roughness, material.normal_scale, cutoff),
            emissive: Vec3::from(material.emissive).extend(0.0),
            flags: Vec4::new(
                flag(material.unlit),
                flag(maps[NORMAL_MAP]),
                flag(!material.double_sided),
                flag(material.alpha == Alpha::Blend),
            ),
        }
    }
}
