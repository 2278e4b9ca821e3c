//! What a graphics chip provides to shaders: textures and the functions of WGSL.

use glam::{Vec2, Vec3};

use crate::Picture;
use crate::contact_shadow::{ContactShadow, SHADOW_SIDE};
use crate::srgb::linear_from_srgb;

pub(crate) fn saturate(value: f32) -> f32 {
    value.clamp(0.0, 1.0)
}

pub(crate) fn mix(a: Vec3, b: Vec3, t: f32) -> Vec3 {
    a * (1.0 - t) + b * t
}

pub(crate) fn smoothstep(low: f32, high: f32, value: f32) -> f32 {
    let t = saturate((value - low) / (high - low));
    t * t * (3.0 - 2.0 * t)
}

/// The contact shadow at 0 to 1 across the map: bilinear, clamped.
pub(crate) fn shadow_at(shadow: &ContactShadow, texel: Vec2) -> f32 {
    let (low, share) = split(texel * SHADOW_SIDE as f32 - 0.5);
    let at = |dx: i64, dy: i64| {
        let clamp = |i: i64| i.clamp(0, SHADOW_SIDE as i64 - 1) as usize;
        f32::from(shadow.texels[clamp(low[1] + dy) * SHADOW_SIDE + clamp(low[0] + dx)]) / 255.0
    };
    let row = |dy: i64| at(0, dy) * (1.0 - share.x) + at(1, dy) * share.x;
    row(0) * (1.0 - share.y) + row(1) * share.y
}

/// The linear light of each byte of an sRGB texture.
pub(crate) struct LinearBytes([f32; 256]);

impl LinearBytes {
    pub(crate) fn new() -> Self {
        Self(std::array::from_fn(|byte| linear_from_srgb(byte as f32 / 255.0)))
    }
}

/// A base colour texture: bilinear, repeating, filtered in linear light. White without a texture.
pub(crate) struct TextureSampler<'a> {
    pub(crate) texture: Option<&'a Picture>,
    pub(crate) linear: &'a LinearBytes,
}

impl TextureSampler<'_> {
    pub(crate) fn sample(&self, uv: Vec2) -> Vec3 {
        let Some(texture) = &self.texture else { return Vec3::ONE };
        let (width, height) = (i64::from(texture.width), i64::from(texture.height));
        let (low, share) = split(uv * Vec2::new(width as f32, height as f32) - 0.5);
        let at = |dx: i64, dy: i64| {
            let (x, y) = ((low[0] + dx).rem_euclid(width), (low[1] + dy).rem_euclid(height));
            let start = ((y * width + x) * 4) as usize;
            Vec3::from([0, 1, 2].map(|channel| self.linear.0[usize::from(texture.rgba[start + channel])]))
        };
        let row = |dy: i64| mix(at(0, dy), at(1, dy), share.x);
        mix(row(0), row(1), share.y)
    }
}

/// Whole and fractional part.
fn split(place: Vec2) -> ([i64; 2], Vec2) {
    let floor = place.floor();
    // Far beyond the range of an index, it does not matter which texel is used.
    let index = |value: f32| value.clamp(-1e9, 1e9) as i64;
    ([index(floor.x), index(floor.y)], place - floor)
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn texture_repeats_and_survives_nonsense() {
        let picture = Picture { width: 2, height: 1, rgba: vec![255, 0, 0, 255, 0, 255, 0, 255] };
        let sampler = TextureSampler { texture: Some(&picture), linear: &LinearBytes::new() };
        assert_eq!(sampler.sample(Vec2::new(0.25, 0.5)), Vec3::X);
        assert_eq!(sampler.sample(Vec2::new(-0.25, 7.5)), Vec3::Y);
        assert_eq!(sampler.sample(Vec2::new(0.5, 0.5)), Vec3::new(0.5, 0.5, 0.0));
        let _ = sampler.sample(Vec2::new(f32::NAN, f32::INFINITY));
    }
}
