//! What a graphics chip provides to shaders: textures and the functions of WGSL.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};

use crate::contact_shadow::{ContactShadow, SHADOW_SIDE};
use crate::mip_levels::mip_levels;
use crate::srgb::linear_from_srgb;
use crate::{Map, Picture, Wrap};

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

/// What each byte of a map stands for.
pub(crate) struct Bytes {
    srgb: [f32; 256],
    linear: [f32; 256],
}

impl Bytes {
    pub(crate) fn new() -> Self {
        let linear = std::array::from_fn(|byte| byte as f32 / 255.0);
        Self { srgb: linear.map(linear_from_srgb), linear }
    }

    /// `is_srgb`: whether its colours are; opacity is always linear.
    pub(crate) fn sampler<'a>(&'a self, map: Option<&'a Map>, levels: &'a Levels, is_srgb: bool) -> MapSampler<'a> {
        let color = if is_srgb { &self.srgb } else { &self.linear };
        let smaller = map.map_or(&[][..], |map| levels.of(map, is_srgb));
        MapSampler { map, smaller, color, opacity: &self.linear }
    }
}

/// The mip levels of images, each made once even if several materials share it.
#[derive(Default)]
pub(crate) struct Levels {
    /// By address, and whether it is stored as sRGB.
    made: Vec<(*const Picture, bool, Vec<Picture>)>,
}

impl Levels {
    pub(crate) fn make(&mut self, map: &Map, is_srgb: bool) {
        let key = Arc::as_ptr(&map.picture);
        if !self.made.iter().any(|(known, srgb, _)| (*known, *srgb) == (key, is_srgb)) {
            self.made.push((key, is_srgb, mip_levels(&map.picture, is_srgb)));
        }
    }

    fn of(&self, map: &Map, is_srgb: bool) -> &[Picture] {
        let key = (Arc::as_ptr(&map.picture), is_srgb);
        self.made.iter().find(|(known, srgb, _)| (*known, *srgb) == key).map_or(&[], |(_, _, levels)| levels.as_slice())
    }
}

/// A place on a map, and how far it moves from a pixel to the next, across and down.
#[derive(Clone, Copy, Default)]
pub(crate) struct Place {
    pub(crate) uv: Vec2,
    pub(crate) steps: [Vec2; 2],
}

/// A map: trilinear, filtered in linear light. White without an image.
pub(crate) struct MapSampler<'a> {
    map: Option<&'a Map>,
    /// Its mip levels after the first.
    smaller: &'a [Picture],
    color: &'a [f32; 256],
    opacity: &'a [f32; 256],
}

impl MapSampler<'_> {
    pub(crate) fn sample(&self, place: Place) -> Vec4 {
        let Some(Map { picture, wrap }) = self.map else { return Vec4::ONE };
        let size = Vec2::new(picture.width as f32, picture.height as f32);
        let texels = place.steps.map(|step| (step * size).length_squared());
        // Texels to a pixel, as a power of two.
        let level = 0.5 * texels[0].max(texels[1]).log2();
        if level.is_nan() || level <= 0.0 || self.smaller.is_empty() {
            return self.bilinear(picture, *wrap, place.uv);
        }
        let level = level.min(self.smaller.len() as f32);
        let (finer, share) = (level.floor() as usize, level.fract());
        let of = |level: usize| level.checked_sub(1).map_or(&**picture, |smaller| &self.smaller[smaller]);
        let fine = self.bilinear(of(finer), *wrap, place.uv);
        if share == 0.0 {
            return fine;
        }
        fine * (1.0 - share) + self.bilinear(of(finer + 1), *wrap, place.uv) * share
    }

    fn bilinear(&self, picture: &Picture, wrap: [Wrap; 2], uv: Vec2) -> Vec4 {
        let (width, height) = (i64::from(picture.width), i64::from(picture.height));
        let (low, share) = split(uv * Vec2::new(width as f32, height as f32) - 0.5);
        let at = |dx: i64, dy: i64| {
            let (x, y) = (wrapped(low[0] + dx, width, wrap[0]), wrapped(low[1] + dy, height, wrap[1]));
            let start = ((y * width + x) * 4) as usize;
            let texel = |channel: usize| usize::from(picture.rgba[start + channel]);
            Vec4::new(self.color[texel(0)], self.color[texel(1)], self.color[texel(2)], self.opacity[texel(3)])
        };
        let row = |dy: i64| at(0, dy) * (1.0 - share.x) + at(1, dy) * share.x;
        row(0) * (1.0 - share.y) + row(1) * share.y
    }
}

/// The texel that is seen at a place within or outside of the image.
fn wrapped(at: i64, side: i64, wrap: Wrap) -> i64 {
    match wrap {
        Wrap::Repeat => at.rem_euclid(side),
        Wrap::Mirror => {
            let along = at.rem_euclid(2 * side);
            along.min(2 * side - 1 - along)
        }
        Wrap::Clamp => at.clamp(0, side - 1),
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
    fn maps_wrap_and_survive_nonsense() {
        let picture = Arc::new(Picture { width: 2, height: 1, rgba: vec![255, 0, 0, 255, 0, 255, 0, 0] });
        let (red, green) = (Vec4::new(1.0, 0.0, 0.0, 1.0), Vec4::new(0.0, 1.0, 0.0, 0.0));
        let bytes = Bytes::new();
        for (wrap, beyond) in [(Wrap::Repeat, green), (Wrap::Mirror, red), (Wrap::Clamp, red)] {
            let map = Map { picture: picture.clone(), wrap: [wrap, Wrap::Repeat] };
            let mut levels = Levels::default();
            levels.make(&map, true);
            let sampler = bytes.sampler(Some(&map), &levels, true);
            let at = |u: f32, v: f32| sampler.sample(Place { uv: Vec2::new(u, v), ..Place::default() });
            assert_eq!(at(0.25, 0.5), red);
            assert_eq!(at(-0.25, 7.5), beyond, "{wrap:?}");
            assert_eq!(at(0.5, 0.5), 0.5 * (red + green));
            let _ = at(f32::NAN, f32::INFINITY);
            // From a texel to a pixel on, a mean takes over.
            let wide = |step: f32| {
                let steps = [Vec2::new(0.0, 0.0), Vec2::new(step, 0.0)];
                sampler.sample(Place { uv: Vec2::new(0.25, 0.5), steps })
            };
            assert_eq!(wide(0.5), red);
            let half = 0.5 * (red + green);
            assert!((wide(1.0) - half).abs().max_element() < 3e-3 && wide(64.0) == wide(1.0), "{:?}", wide(1.0));
            let between = wide(std::f32::consts::FRAC_1_SQRT_2);
            assert!((between - 0.5 * (red + half)).abs().max_element() < 3e-3, "{between:?}");
            let _ = wide(f32::NAN);
            let _ = wide(f32::INFINITY);
        }
        assert_eq!(bytes.sampler(None, &Levels::default(), true).sample(Place::default()), Vec4::ONE);
    }
}
